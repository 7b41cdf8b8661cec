"""Geometric tolerances in the records of a file."""

from collections import defaultdict
from typing import Any

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


def tolerances_of(records: Records, aspects: Aspects) -> tuple[Tolerance, ...]:
    """Return the geometric tolerances of a file, in the order of their records."""
    numbers = records.numbers(_BASE, *KINDS)
    order = {number: k for k, number in enumerate(numbers, 1)}
    (forms, projected), refined = _zones(records), _refined(records)
    return tuple(
        _tolerance(
            records,
            aspects,
            record,
            number=order[record],
            zone=", ".join(dict.fromkeys(filter(None, forms.get(record, ())))),
            projected=projected.get(record),
            refines=order.get(refined.get(record, 0)),
        )
        for record in numbers
    )


def _tolerance(records: Records, aspects: Aspects, record: int, **stated: Any) -> Tolerance:
    """Return a tolerance, with what other records have `stated` of it."""
    entities = records.entities(record)
    parameters = records.parameters(record, _BASE, *KINDS)
    aspect = parameters.reference(3)
    systems = entities.get(f"{_WITH}DATUM_REFERENCE", Parameters()).references(0) or parameters.references(4)
    unit, area = (entities.get(f"{_WITH}{name}", Parameters()) for name in ("DEFINED_UNIT", "DEFINED_AREA_UNIT"))
    sides = [length(records, number) for number in (unit.reference(0), area.reference(1))]
    items = aspects.items(aspect)
    return Tolerance(
        record=record,
        kind=next((kind for entity, kind in KINDS.items() if entity in entities), ""),
        name=parameters.text(0),
        value=length(records, parameters.reference(2)),
        modifiers=_modifiers(records, record),
        per_unit=tuple(side for side in sides if side is not None),
        unit_shape=next(iter(area.words(0)), ""),
        displacement=_length_in(records, record, f"UNEQUALLY_DISPOSED_{_BASE}"),
        maximum=_length_in(records, record, f"{_WITH}MAXIMUM_TOLERANCE"),
        extent=aspects.extent(aspect),
        datums=datum_system(records, systems),
        face_records=items.faces,
        other_records=items.others,
        **stated,
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


def _zones(records: Records) -> tuple[dict[int, list[str]], dict[int, float]]:
    """Return the forms of zones in words, and the lengths of projected zones [mm], by the records of their tolerances.

    Most tolerances have one zone, and a projected zone may have a second record.
    """
    lengths: dict[int, float | None] = {}
    for number in records.numbers("PROJECTED_ZONE_DEFINITION"):
        parameters = records.parameters(number, "PROJECTED_ZONE_DEFINITION")
        lengths[parameters.reference(0)] = length(records, parameters.reference(3))
    forms, projected = defaultdict[int, list[str]](list), dict[int, float]()
    for number in records.numbers("TOLERANCE_ZONE"):
        parameters = records.parameters(number, "TOLERANCE_ZONE")
        form = records.parameters(parameters.reference(5), "TOLERANCE_ZONE_FORM").text(0)
        for tolerance in parameters.references(4):
            forms[tolerance].append(form)
            if (height := lengths.get(number)) is not None:
                projected.setdefault(tolerance, height)
    return forms, projected


def _refined(records: Records) -> dict[int, int]:
    """Return the record of the tolerance above, by the record of each tolerance that refines it in a composite frame."""
    refined = {}
    for number in records.numbers(f"{_BASE}_RELATIONSHIP"):
        parameters = records.parameters(number, f"{_BASE}_RELATIONSHIP")
        refined[parameters.reference(3)] = parameters.reference(2)
    return refined
