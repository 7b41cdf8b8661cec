"""Geometric tolerances in the records of a file."""

from collections import defaultdict
from typing import NamedTuple

from tolcontact.pmi.annotations import Tolerance
from tolcontact.pmi.aspects import Aspects
from tolcontact.pmi.datums import datum_system
from tolcontact.pmi.part21 import Parameters, Records, length

# Entities, and the kinds of tolerances that ISO 1101 and ASME Y14.5 know.
KINDS = {
    f"{kind.replace(' ', '_').upper()}_TOLERANCE": kind
    for kind in (
        "angularity", "circular runout", "coaxiality", "concentricity", "cylindricity", "flatness", "line profile",
        "parallelism", "perpendicularity", "position", "roundness", "straightness", "surface profile", "symmetry",
        "total runout",
    )
}  # fmt: skip
_BASE = "GEOMETRIC_TOLERANCE"
_WITH = f"{_BASE}_WITH_"


class _Zone(NamedTuple):
    """The form of a tolerance zone in words, and the length of a projected zone [mm]."""

    form: str = ""
    projected: float | None = None


def tolerances_of(records: Records, aspects: Aspects) -> tuple[Tolerance, ...]:
    """Return the geometric tolerances of a file, in the order of their records."""
    numbers = records.numbers(_BASE, *KINDS)
    order = {number: k for k, number in enumerate(numbers, 1)}
    zones, refined = _zones(records), _refined(records)
    return tuple(
        _tolerance(records, aspects, record, order[record], zones.get(record, _Zone()), order.get(refined.get(record, 0)))
        for record in numbers
    )


def _tolerance(records: Records, aspects: Aspects, record: int, number: int, zone: _Zone, refines: int | None) -> Tolerance:
    entities = records.entities(record)
    parameters = records.parameters(record, _BASE, *KINDS)
    aspect = parameters.reference(3)
    systems = entities.get(f"{_WITH}DATUM_REFERENCE", Parameters()).references(0) or parameters.references(4)
    unit, area = (entities.get(f"{_WITH}{name}", Parameters()) for name in ("DEFINED_UNIT", "DEFINED_AREA_UNIT"))
    sides = [length(records, number) for number in (unit.reference(0), area.reference(1))]
    items = aspects.items(aspect)
    return Tolerance(
        number=number,
        record=record,
        kind=next((kind for entity, kind in KINDS.items() if entity in entities), ""),
        name=parameters.text(0),
        value=length(records, parameters.reference(2)),
        zone=zone.form,
        projected=zone.projected,
        modifiers=_modifiers(records, record),
        per_unit=tuple(side for side in sides if side is not None),
        unit_shape=next(iter(area.words(0)), ""),
        displacement=_length_in(records, record, f"UNEQUALLY_DISPOSED_{_BASE}"),
        maximum=_length_in(records, record, f"{_WITH}MAXIMUM_TOLERANCE"),
        extent=aspects.extent(aspect),
        datums=datum_system(records, systems),
        refines=refines,
        face_records=items.faces,
        other_records=items.others,
    )


def _modifiers(records: Records, record: int) -> tuple[str, ...]:
    """Return the modifiers of a tolerance in words: a set of them, or a single one in older files."""
    entities = records.entities(record)
    words = entities.get(f"{_WITH}MODIFIERS", Parameters()).words(0)
    earlier = entities.get(f"MODIFIED_{_BASE}", Parameters())
    words += earlier.words(max(len(earlier) - 1, 0))
    return tuple(dict.fromkeys(words))


def _length_in(records: Records, record: int, entity: str) -> float | None:
    """Return the length [mm] in the first parameter of an entity, if the record is of it."""
    return length(records, records.entities(record).get(entity, Parameters()).reference(0))


def _zones(records: Records) -> dict[int, _Zone]:
    """Return the zones by the records of their tolerances."""
    definitions = records.numbers("PROJECTED_ZONE_DEFINITION")
    projected: dict[int, float | None] = {}
    for number in definitions:
        parameters = records.parameters(number, "PROJECTED_ZONE_DEFINITION")
        projected[parameters.reference(0)] = length(records, parameters.reference(3))
    zones: dict[int, list[_Zone]] = defaultdict(list)
    for number in records.numbers("TOLERANCE_ZONE"):
        parameters = records.parameters(number, "TOLERANCE_ZONE")
        form = records.parameters(parameters.reference(5), "TOLERANCE_ZONE_FORM").text(0)
        for tolerance in parameters.references(4):
            zones[tolerance].append(_Zone(form, projected.get(number)))
    return {tolerance: _merged(entries) for tolerance, entries in zones.items()}


def _merged(zones: list[_Zone]) -> _Zone:
    """Return a tolerance's zone: most have one record, and a projected zone may have a second one."""
    forms = dict.fromkeys(zone.form for zone in zones if zone.form)
    return _Zone(", ".join(forms), next((zone.projected for zone in zones if zone.projected is not None), None))


def _refined(records: Records) -> dict[int, int]:
    """Return the record of the tolerance above, by the record of each tolerance that refines it in a composite frame."""
    refined = {}
    for number in records.numbers(f"{_BASE}_RELATIONSHIP"):
        parameters = records.parameters(number, f"{_BASE}_RELATIONSHIP")
        refined[parameters.reference(3)] = parameters.reference(2)
    return refined
