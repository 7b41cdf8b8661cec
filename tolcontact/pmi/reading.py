"""Reading of a STEP file's product and manufacturing information: geometric tolerances, dimensions with limits, and datums."""

import math
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tolcontact.errors import OptionError
from tolcontact.input_files import fault_of
from tolcontact.pmi.annotations import Dimension, Pmi, Tolerance
from tolcontact.pmi.aspects import DATUM_SIZE, LOCATIONS, SIZES, Aspects, datum_system, datums_of, features_of
from tolcontact.pmi.part21 import Quantity, Records, length, quantity
from tolcontact.texts import clipped

MAX_SIZE = 2_000_000_000  # [byte]; reading takes several times as much memory
HEAD_SIZE = 10_000  # [byte] of a file that show its kind
MAX_NOTES = 1000  # records of notes of a dimension, which may refer to each other
_EXPECTED = "expected a STEP file of AP242, edition 1 to 3 (.stp, .step)"
# Other kinds of files, by their beginnings and suffixes.
_FORMATS = (
    (b"<QIFDocument", ".qif", "a QIF document"),
    (b"<?xml", ".stpx", "an XML document"),
    (b"PK\x03\x04", ".stpz", "a compressed file"),
    (b"\x1f\x8b", ".gz", "a compressed file"),
)
_AP242 = "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING"
_VERSION = re.compile(r"\{\s*1\s+0\s+10303\s+442\s+(\d{1,4})\b")
_EDITIONS = {1: 1, 2: 2, 3: 2, 4: 3}  # by the version in the object identifier of the schema
_TESSELLATED = ("TESSELLATED_SOLID", "TESSELLATED_SHELL", "TESSELLATED_CLOSED_SHELL", "TESSELLATED_OPEN_SHELL")
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
_DIMENSIONS = {
    "ANGULAR_SIZE": "angular size", "DIMENSIONAL_SIZE_WITH_PATH": "size with path", DATUM_SIZE: "size",
    "DIMENSIONAL_SIZE": "size", "ANGULAR_LOCATION": "angular location", "DIRECTED_DIMENSIONAL_LOCATION": "directed location",
    "DIMENSIONAL_LOCATION_WITH_PATH": "location with path", "DIMENSIONAL_LOCATION": "location",
}  # fmt: skip
_LIMITS = {"upper limit": "upper", "lower limit": "lower"}
Values = dict[str, Quantity]  # of a dimension, by their roles: "nominal", "lower", "upper", "lower deviation", ...


def read_pmi(path: str | Path) -> Pmi:
    """Return the geometric tolerances, dimensions and datums that a STEP file of AP242 (edition 1 to 3) at a `path` states.

    `tc.io.read_pmi("cover.stp").tolerances`
    Raises OptionError if it cannot be read, and for AP242 edition 4 and other kinds of files.
    """
    records = Records(_content(Path(path)), str(path))
    is_ap242 = records.schema.upper().startswith(_AP242)
    edition = _edition(records.schema, path) if is_ap242 else None
    is_tessellated = bool(records.numbers(*_TESSELLATED)) and not records.numbers("ADVANCED_FACE", "FACE_SURFACE")
    drawings = len(records.numbers(*(name for name in records.names() if name.endswith("ANNOTATION_OCCURRENCE"))))
    if not is_ap242:
        return Pmi(records.schema, None, False, is_tessellated, drawings, (), (), ())
    aspects = Aspects(records, str(path))
    annotations = _tolerances(records, aspects), _dimensions(records, aspects), datums_of(records, aspects)
    return Pmi(records.schema, edition, True, is_tessellated, drawings, *annotations)


def _content(path: Path) -> bytes:
    """Return the content of a STEP file. Raises OptionError for any other file."""
    if fault := fault_of(path, MAX_SIZE):
        raise OptionError(f'"{path}" {fault}; {_EXPECTED}')
    try:
        content = path.read_bytes()
    except OSError as error:
        raise OptionError(f'"{path}" cannot be opened ({error.strerror}); {_EXPECTED}') from error
    head = content[:HEAD_SIZE]
    if b"ISO-10303-21" in head:
        return content
    if not content:
        raise OptionError(f'"{path}" is empty; export it again')
    for beginning, suffix, kind in _FORMATS:
        if beginning in head or path.suffix.lower() == suffix:
            raise OptionError(f'"{path}" is {kind}, which is not read; {_EXPECTED}')
    raise OptionError(f'"{path}" is not a STEP file: it does not begin with ISO-10303-21; {_EXPECTED}')


def _edition(schema: str, path: str | Path) -> int | None:
    """Return the edition of AP242 by the object identifier of its schema; None if that is not stated."""
    version = _VERSION.search(schema)
    if version and int(version[1]) not in _EDITIONS:
        raise OptionError(
            f'"{path}" is AP242 edition 4 or later ({clipped(schema, 100)}), which is not read; export it as edition 1, 2 or 3'
        )
    return _EDITIONS[int(version[1])] if version else None


def _tolerances(records: Records, aspects: Aspects) -> tuple[Tolerance, ...]:
    """Return the geometric tolerances of a file, in the order of their records."""
    order = {number: k for k, number in enumerate(records.numbers(_BASE, *KINDS), 1)}
    zones, projected = _zones(records)
    # From a tolerance to the one that it refines in a composite frame.
    refined = {
        relationship.reference(3): relationship.reference(2) for _, relationship in records.each(f"{_BASE}_RELATIONSHIP")
    }
    return tuple(
        _tolerance(
            records, aspects, record,
            number=number,
            zone=", ".join(dict.fromkeys(filter(None, zones.get(record, ())))),
            projected=projected.get(record),
            refines=order.get(refined.get(record, 0)),
        )
        for record, number in order.items()
    )  # fmt: skip


def _tolerance(records: Records, aspects: Aspects, record: int, **stated: Any) -> Tolerance:
    """Return a tolerance, with what other records have `stated` of it."""
    entities, parameters = records.entities(record), records.parameters(record, _BASE, *KINDS)
    aspect = parameters.reference(3)
    unit = records.parameters(record, f"{_WITH}DEFINED_UNIT")
    area = records.parameters(record, f"{_WITH}DEFINED_AREA_UNIT")
    modifiers = records.parameters(record, f"{_WITH}MODIFIERS")
    earlier = records.parameters(record, f"MODIFIED_{_BASE}")  # a single modifier, in older files
    maximum = records.parameters(record, f"{_WITH}MAXIMUM_TOLERANCE")
    unequal = records.parameters(record, f"UNEQUALLY_DISPOSED_{_BASE}")
    system = records.parameters(record, f"{_WITH}DATUM_REFERENCE")
    sides = [length(records, number) for number in (unit.reference(0), area.reference(1))]
    faces, others = aspects.items(aspect)
    return Tolerance(
        record=record,
        kind=next((kind for entity, kind in KINDS.items() if entity in entities), ""),
        name=parameters.text(0),
        value=length(records, parameters.reference(2)),
        modifiers=tuple(dict.fromkeys([*modifiers.words(0), *earlier.words(max(len(earlier) - 1, 0))])),
        per_unit=tuple(side for side in sides if side is not None),
        unit_shape=next(iter(area.words(0)), ""),
        displacement=length(records, unequal.reference(0)),
        maximum=length(records, maximum.reference(0)),
        extent=aspects.extent(aspect),
        datums=datum_system(records, system.references(0) or parameters.references(4)),
        face_records=faces,
        other_records=others,
        **stated,
    )


def _zones(records: Records) -> tuple[dict[int, list[str]], dict[int, float]]:
    """Return the forms of zones in words, and the lengths of projected zones [mm], by the records of their tolerances.

    Most tolerances have one zone, and a projected zone may have a second record.
    """
    definitions = records.each("PROJECTED_ZONE_DEFINITION")
    lengths = {definition.reference(0): length(records, definition.reference(3)) for _, definition in definitions}
    forms, projected = defaultdict[int, list[str]](list), dict[int, float]()
    for number, zone in records.each("TOLERANCE_ZONE"):
        form = records.parameters(zone.reference(5), "TOLERANCE_ZONE_FORM").text(0)
        for tolerance in zone.references(4):
            forms[tolerance].append(form)
            if (height := lengths.get(number)) is not None:
                projected.setdefault(tolerance, height)
    return forms, projected


def _dimensions(records: Records, aspects: Aspects) -> tuple[Dimension, ...]:
    """Return the dimensions of a file, in the order of their records."""
    values, notes = _values_and_notes(records)
    fits = _add_deviations(records, values)
    dimensions = []
    for number, record in enumerate(records.numbers(*_DIMENSIONS), 1):
        entities, stated = records.entities(record), values.get(record, {})
        start, *end = features_of(records, record)
        (faces, others), (end_faces, end_others) = aspects.items(start), aspects.items(*end)
        dimensions.append(Dimension(
            number=number,
            record=record,
            kind=next(kind for entity, kind in _DIMENSIONS.items() if entity in entities),
            name=_name(records, record),
            unit=next((measure.unit for measure in stated.values()), ""),
            nominal=stated["nominal"].value if "nominal" in stated else None,
            lower=_limit(stated, "lower"),
            upper=_limit(stated, "upper"),
            fit=fits.get(record, ""),
            modifiers=tuple(dict.fromkeys(notes.get(record, ()))),
            face_records=faces,
            other_records=others,
            end_face_records=end_faces,
            end_other_records=end_others,
        ))  # fmt: skip
    return tuple(dimensions)


def _name(records: Records, record: int) -> str:
    """Return what a dimension measures: its own name, after those that it has as a shape aspect."""
    if records.has(record, DATUM_SIZE):
        return records.parameters(record, DATUM_SIZE).text(5) or records.parameters(record, "DIMENSIONAL_SIZE").text(1)
    if records.has(record, *SIZES):
        return records.parameters(record, *SIZES).text(1)
    return records.parameters(record, *LOCATIONS, "SHAPE_ASPECT_RELATIONSHIP").text(0)


def _limit(values: Values, side: str) -> float | None:
    """Return a limit that the file states, or the nominal value plus its deviation."""
    if side in values:
        return values[side].value
    nominal, deviation = values.get("nominal"), values.get(f"{side} deviation")
    if not (nominal and deviation and nominal.unit == deviation.unit):
        return None
    limit = nominal.value + deviation.value
    return limit if math.isfinite(limit) else None


def _values_and_notes(records: Records) -> tuple[dict[int, Values], dict[int, list[str]]]:
    """Return values, and notes, by the records of their dimensions."""
    values, notes = defaultdict[int, Values](dict), defaultdict[int, list[str]](list)
    for _, characteristic in records.each("DIMENSIONAL_CHARACTERISTIC_REPRESENTATION"):
        dimension = characteristic.reference(0)
        shape = records.parameters(characteristic.reference(1), "SHAPE_DIMENSION_REPRESENTATION", "REPRESENTATION")
        for item in shape.references(1):
            measure = quantity(records, item)
            if measure is None:
                notes[dimension].extend(_notes(records, item))
                continue
            qualifiers = records.parameters(item, "QUALIFIED_REPRESENTATION_ITEM").references(0)
            words = [records.parameters(qualifier, "TYPE_QUALIFIER").text(0) for qualifier in qualifiers]
            notes[dimension].extend(word for word in words if word not in ("", "designed", "nominal"))
            texts = (parameters.text(0) for parameters in records.entities(item).values())
            name = records.parameters(item, "REPRESENTATION_ITEM").text(0) or next(filter(None, texts), "")
            values[dimension].setdefault(_LIMITS.get(name, "nominal"), measure)
    return values, notes


def _notes(records: Records, item: int) -> Iterator[str]:
    """Yield the texts in an item, also those in a compound of items."""
    visited, waiting = set[int](), [item]
    while waiting and len(visited) < MAX_NOTES:
        number = waiting.pop()
        if number in visited:
            continue
        visited.add(number)
        if text := records.parameters(number, "DESCRIPTIVE_REPRESENTATION_ITEM").text(1):
            yield text
        waiting.extend(reversed(records.parameters(number, "COMPOUND_REPRESENTATION_ITEM").references(1)))


def _add_deviations(records: Records, values: dict[int, Values]) -> dict[int, str]:
    """Add deviations from nominal values to the values, and return fits by the records of their dimensions."""
    fits = {}
    for _, tolerance in records.each("PLUS_MINUS_TOLERANCE"):
        source, dimension = tolerance.reference(0), tolerance.reference(1)
        deviations = records.parameters(source, "TOLERANCE_VALUE")
        for index, role in enumerate(("lower deviation", "upper deviation")):
            values[dimension].pop(role, None)
            if deviation := quantity(records, deviations.reference(index)):
                values[dimension][role] = deviation
        fit = records.parameters(source, "LIMITS_AND_FITS")
        # Some systems write the grade with the form variance ("H7"), and leave its own place empty.
        fits[dimension] = " ".join(filter(None, (fit.text(0) + fit.text(2), fit.text(1))))
    return fits
