"""Datums, their targets [mm], and the datum systems of tolerances."""

import math
from collections.abc import Iterator, Sequence

from tolcontact.declaration.values import Vector
from tolcontact.pmi.annotations import Datum, DatumReference, DatumTarget
from tolcontact.pmi.aspects import TARGETS, Aspects
from tolcontact.pmi.part21 import Parameters, Records, Reference, Typed, Word, flat, length, length_unit

_COMPARTMENT, _ELEMENT = "DATUM_REFERENCE_COMPARTMENT", "DATUM_REFERENCE_ELEMENT"
_SHAPE = "SHAPE_REPRESENTATION_WITH_PARAMETERS"
MAX_TARGETS = 10_000  # of a file; a drawing has some ten
_EARLIER = ("DATUM_REFERENCE", "REFERENCED_MODIFIED_DATUM")  # references without a datum system


def datums_of(records: Records, aspects: Aspects) -> tuple[Datum, ...]:
    """Return the datums of a file, in the order of their records."""
    datums = []
    points = _target_points(records)
    for number in records.numbers("DATUM"):
        features = aspects.datum_features.get(number, [])
        letter = _letter(records, number)
        targets = tuple(
            _target(records, aspects, feature, letter, points.get(feature)) for feature in _targets(records, features)
        )
        named = [part for target in targets for part in aspects.datum_features.get(target.record, ())]
        items = aspects.items(number, *features, *named)
        datums.append(Datum(letter, number, targets, items.faces, items.others))
    return tuple(datums)


def datum_system(records: Records, systems: Sequence[int]) -> tuple[DatumReference, ...]:
    """Return the references of datum systems, or of references without a system, in order of precedence."""
    references: list[tuple[float, DatumReference]] = []
    for number in systems:
        if records.has(number, "DATUM_SYSTEM"):
            compartments = records.parameters(number, "DATUM_SYSTEM").references(4)
            references += [(float(place), _reference(records, part)) for place, part in enumerate(compartments)]
        elif records.has(number, *_EARLIER):
            references.append(_earlier_reference(records, number))
    return tuple(reference for _, reference in sorted(references, key=lambda item: item[0]))


def _reference(records: Records, compartment: int) -> DatumReference:
    """Return the reference in a compartment: a datum, or several elements, which form a common datum."""
    parameters = records.parameters(compartment, _COMPARTMENT, _ELEMENT)
    modifiers = list(_modifiers(records, parameters.value(5)))
    letters: list[str] = []
    for base in parameters.references(4):
        if records.has(base, _ELEMENT):
            element = records.parameters(base, _ELEMENT)
            modifiers += _modifiers(records, element.value(5))
            letters += [_letter(records, datum) for datum in element.references(4)]
        else:
            letters.append(_letter(records, base))
    return DatumReference(tuple(letters), tuple(dict.fromkeys(modifiers)))


def _earlier_reference(records: Records, number: int) -> tuple[float, DatumReference]:
    """Return the precedence of a reference without a datum system, and the reference."""
    parameters = records.parameters(number, *_EARLIER)
    modified = records.parameters(number, "REFERENCED_MODIFIED_DATUM")
    modifiers = tuple(word for index in (0, 2) for word in modified.words(index))
    precedence = parameters.value(0)
    place = precedence if isinstance(precedence, float) else 0.0
    return place, DatumReference((_letter(records, parameters.reference(1)),), modifiers)


def _modifiers(records: Records, value: object) -> Iterator[str]:
    """Yield the modifiers of a datum reference in words; those with a value are records of their own."""
    for item in flat(value) if isinstance(value, Typed | Parameters | Word | Reference) else ():
        if isinstance(item, Word):
            yield item.text
        elif isinstance(item, Reference):
            parameters = records.parameters(item, "DATUM_REFERENCE_MODIFIER_WITH_VALUE")
            size = length(records, parameters.reference(1))
            yield from (f"{word} {'' if size is None else f'{size:.6g}'}".strip() for word in parameters.words(0))


def _letter(records: Records, datum: int) -> str:
    """Return the letter of a datum, which is its last parameter."""
    parameters = records.parameters(datum, "DATUM", "COMMON_DATUM")
    return parameters.text(len(parameters) - 1) if parameters else ""


def _targets(records: Records, features: Sequence[int]) -> list[int]:
    return [feature for feature in features if records.has(feature, *TARGETS)]


def _target(records: Records, aspects: Aspects, number: int, letter: str, point: Vector | None) -> DatumTarget:
    parameters = records.parameters(number, *TARGETS)
    label = letter + parameters.text(len(parameters) - 1)
    kind = records.parameters(number, *TARGETS, "SHAPE_ASPECT").text(1)
    items = aspects.items(number, *aspects.datum_features.get(number, ()))
    return DatumTarget(label, kind, number, point, items.faces, items.others)


def _target_points(records: Records) -> dict[int, Vector]:
    """Return the points [mm] of datum targets, in the frame of their product, by record number."""
    shapes = {
        target: records.parameters(definition.reference(1), _SHAPE)
        for number in records.numbers("SHAPE_DEFINITION_REPRESENTATION")
        if (definition := records.parameters(number, "SHAPE_DEFINITION_REPRESENTATION"))
        and records.has(definition.reference(1), _SHAPE)
        and records.has(target := records.parameters(definition.reference(0), "PROPERTY_DEFINITION").reference(2), *TARGETS)
    }
    items = {item for shape in list(shapes.values())[:MAX_TARGETS] for item in shape.references(1)}
    placements = {number: item.reference(1) for number, item in records.shapes(*items).items()}
    coordinates = records.shapes(*placements.values())
    points = {}
    for target, shape in shapes.items():
        unit = length_unit(records, shape.reference(2))
        places = [coordinates.get(placements.get(item, 0), Parameters()) for item in shape.references(1)]
        point = next((point for place in places if (point := _point(place, unit or math.nan))), None)
        if point is not None:
            points[target] = point
    return points


def _point(coordinates: Parameters, unit: float) -> Vector | None:
    """Return a point [mm] from the parameters of its record; None if they are no finite coordinates."""
    values = coordinates.value(1)
    numbers = [value * unit for value in values if isinstance(value, float)] if isinstance(values, Parameters) else []
    return (numbers[0], numbers[1], numbers[2]) if len(numbers) == 3 and all(map(math.isfinite, numbers)) else None
