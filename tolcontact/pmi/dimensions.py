"""Dimensions in the records of a file: sizes, distances and angles, with their limits."""

import math
from collections import defaultdict
from collections.abc import Iterator
from typing import Any

from tolcontact.pmi.annotations import Dimension
from tolcontact.pmi.aspects import DATUM_SIZE, LOCATIONS, SIZES, Aspects, features_of
from tolcontact.pmi.part21 import Quantity, Records, quantity

_KINDS = {
    "ANGULAR_SIZE": "angular size", "DIMENSIONAL_SIZE_WITH_PATH": "size with path", DATUM_SIZE: "size",
    "DIMENSIONAL_SIZE": "size", "ANGULAR_LOCATION": "angular location", "DIRECTED_DIMENSIONAL_LOCATION": "directed location",
    "DIMENSIONAL_LOCATION_WITH_PATH": "location with path", "DIMENSIONAL_LOCATION": "location",
}  # fmt: skip
_LIMITS = {"upper limit": "upper", "lower limit": "lower"}
MAX_NOTES = 1000  # records of notes of a dimension, which may refer to each other


Values = dict[str, Quantity]  # of a dimension, by their roles: "nominal", "lower", "upper", "lower deviation", ...


def dimensions_of(records: Records, aspects: Aspects) -> tuple[Dimension, ...]:
    """Return the dimensions of a file, in the order of their records."""
    values, notes = _values_and_notes(records)
    fits = _add_deviations(records, values)
    return tuple(
        _dimension(
            records,
            aspects,
            record,
            values.get(record, {}),
            number=number,
            fit=fits.get(record, ""),
            modifiers=tuple(dict.fromkeys(notes.get(record, ()))),
        )
        for number, record in enumerate(records.numbers(*_KINDS), 1)
    )


def _dimension(records: Records, aspects: Aspects, record: int, values: Values, **stated: Any) -> Dimension:
    """Return a dimension, with what other records have `stated` of it."""
    entities = records.entities(record)
    start, *end = features_of(records, record)
    items, end_items = aspects.items(start), aspects.items(*end)
    return Dimension(
        record=record,
        kind=next(kind for entity, kind in _KINDS.items() if entity in entities),
        name=_name(records, record),
        unit=next((measure.unit for measure in values.values()), ""),
        nominal=values["nominal"].value if "nominal" in values else None,
        lower=_limit(values, "lower"),
        upper=_limit(values, "upper"),
        face_records=items.faces,
        other_records=items.others,
        end_face_records=end_items.faces,
        end_other_records=end_items.others,
        **stated,
    )


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
    for number in records.numbers("DIMENSIONAL_CHARACTERISTIC_REPRESENTATION"):
        parameters = records.parameters(number, "DIMENSIONAL_CHARACTERISTIC_REPRESENTATION")
        dimension = parameters.reference(0)
        shape = records.parameters(parameters.reference(1), "SHAPE_DIMENSION_REPRESENTATION", "REPRESENTATION")
        for item in shape.references(1):
            measure = quantity(records, item)
            if measure is None:
                notes[dimension].extend(_notes(records, item))
                continue
            qualifiers = [note for note in _qualifiers(records, item) if note not in ("designed", "nominal")]
            role = _LIMITS.get(_item_name(records, item), "nominal")
            notes[dimension].extend(qualifiers)
            values[dimension].setdefault(role, measure)
    return values, notes


def _item_name(records: Records, item: int) -> str:
    simple = next((parameters.text(0) for parameters in records.entities(item).values() if parameters.text(0)), "")
    return records.parameters(item, "REPRESENTATION_ITEM").text(0) or simple


def _qualifiers(records: Records, item: int) -> Iterator[str]:
    """Yield the qualifiers of a value, such as "maximum"."""
    for qualifier in records.parameters(item, "QUALIFIED_REPRESENTATION_ITEM").references(0):
        name = records.parameters(qualifier, "TYPE_QUALIFIER").text(0)
        if name:
            yield name


def _notes(records: Records, item: int) -> Iterator[str]:
    """Yield the texts in an item, also those in a compound of items."""
    visited: set[int] = set()
    waiting = [item]
    while waiting and len(visited) < MAX_NOTES:
        number = waiting.pop()
        if number in visited:
            continue
        visited.add(number)
        text = records.parameters(number, "DESCRIPTIVE_REPRESENTATION_ITEM").text(1)
        if text:
            yield text
        waiting.extend(reversed(records.parameters(number, "COMPOUND_REPRESENTATION_ITEM").references(1)))


def _add_deviations(records: Records, values: dict[int, Values]) -> dict[int, str]:
    """Add deviations from nominal values to the values, and return fits by the records of their dimensions."""
    fits = {}
    for number in records.numbers("PLUS_MINUS_TOLERANCE"):
        parameters = records.parameters(number, "PLUS_MINUS_TOLERANCE")
        source, dimension = parameters.reference(0), parameters.reference(1)
        deviations = records.parameters(source, "TOLERANCE_VALUE")
        for index, role in enumerate(("lower deviation", "upper deviation")):
            values[dimension].pop(role, None)
            if deviation := quantity(records, deviations.reference(index)):
                values[dimension][role] = deviation
        fit = records.parameters(source, "LIMITS_AND_FITS")
        # Some systems write the grade with the form variance ("H7"), and leave its own place empty.
        fits[dimension] = " ".join(filter(None, (fit.text(0) + fit.text(2), fit.text(1))))
    return fits
