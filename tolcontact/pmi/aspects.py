"""Shape aspects, and the faces, edges and points that they represent; datums, their targets [mm], and datum systems."""

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence

from tolcontact.declaration.values import Vector
from tolcontact.errors import OptionError
from tolcontact.pmi.annotations import Datum, DatumReference, DatumTarget
from tolcontact.pmi.part21 import Parameters, Records, Reference, Value, Word, flat, length, length_unit

MAX_VISITS = 2_000_000  # of records, in the search for faces; the largest files of NIST take some thousands
MAX_TARGETS = 10_000  # of a file; a drawing has some ten
_FACES = ("ADVANCED_FACE", "FACE_SURFACE", "FACE")
_USAGES = ("GEOMETRIC_ITEM_SPECIFIC_USAGE", "ITEM_IDENTIFIED_REPRESENTATION_USAGE")
# From a composite, a pattern or a derived aspect (a centre of symmetry) to its components, or from a feature to its target.
_COMPOSITIONS = (
    "SHAPE_ASPECT_RELATIONSHIP", "SHAPE_ASPECT_DERIVING_RELATIONSHIP", "SHAPE_ASPECT_ASSOCIATIVITY",
    "COMPONENT_FEATURE_RELATIONSHIP", "FEATURE_FOR_DATUM_TARGET_RELATIONSHIP",
)  # fmt: skip
LOCATIONS = ("DIMENSIONAL_LOCATION", "DIRECTED_DIMENSIONAL_LOCATION", "DIMENSIONAL_LOCATION_WITH_PATH", "ANGULAR_LOCATION")
SIZES = ("DIMENSIONAL_SIZE", "ANGULAR_SIZE", "DIMENSIONAL_SIZE_WITH_PATH")
DATUM_SIZE = "DIMENSIONAL_SIZE_WITH_DATUM_FEATURE"
_PRODUCT = "PRODUCT_DEFINITION_SHAPE"
_EXTENTS = {"ALL_AROUND_SHAPE_ASPECT": "all around", "BETWEEN_SHAPE_ASPECT": "between", _PRODUCT: "all over"}
_TARGETS = ("DATUM_TARGET", "PLACED_DATUM_TARGET_FEATURE")
_COLLECTIONS = {
    "CONNECTED_FACE_SUB_SET", "CONNECTED_FACE_SET", "OPEN_SHELL", "CLOSED_SHELL", "CONNECTED_EDGE_SET", "GEOMETRIC_SET",
    "GEOMETRIC_CURVE_SET", "SHELL_BASED_SURFACE_MODEL", "MANIFOLD_SOLID_BREP",
    "BREP_WITH_VOIDS",
}  # fmt: skip
_ELEMENT = "DATUM_REFERENCE_ELEMENT"
_EARLIER = ("DATUM_REFERENCE", "REFERENCED_MODIFIED_DATUM")  # references without a datum system
_SHAPE = "SHAPE_REPRESENTATION_WITH_PARAMETERS"
Items = tuple[tuple[int, ...], tuple[int, ...]]  # numbers of records: B-rep faces, and other items, such as edges and points


class Aspects:
    """The shape aspects of a file.

    datum_features   shape aspects by the datum, or the datum target, that they establish
    """

    def __init__(self, records: Records, title: str) -> None:
        self._records = records
        self._title = title
        self._visits = 0
        self._known: dict[int, Items] = {}
        self._items: dict[int, list[int]] = defaultdict(list)
        self._components: dict[int, list[int]] = defaultdict(list)
        self.datum_features: dict[int, list[int]] = defaultdict(list)
        for _, usage in records.each(*_USAGES):
            self._items[usage.reference(2)].extend(usage.references(4))
        for number in records.numbers(*_COMPOSITIONS):
            for relationship in () if records.has(number, *LOCATIONS) else records.entities(number).values():
                relating, related = relationship.reference(2), relationship.reference(3)
                if relating and related and records.has(related, "DATUM", *_TARGETS):
                    self.datum_features[related].append(relating)
                elif relating and related:
                    self._components[relating].append(related)

    def items(self, *aspects: int) -> Items:
        """Return all items that aspects, dimensions or datums represent, each once, in their order."""
        for aspect in aspects:
            if aspect not in self._known:
                self._known[aspect] = self._search(aspect)
        parts = [self._known[aspect] for aspect in aspects]
        self._count(sum(len(faces) + len(others) for faces, others in parts))
        if len(parts) == 1:
            return parts[0]
        faces = dict.fromkeys(face for faces, _ in parts for face in faces)
        return tuple(faces), tuple(dict.fromkeys(other for _, others in parts for other in others))

    def extent(self, aspect: int) -> str:
        """Return the words of a drawing for an aspect of several faces: "all around", "between", "all over", or nothing."""
        entities = self._records.entities(aspect)
        return next((words for entity, words in _EXTENTS.items() if entity in entities), "")

    def _search(self, start: int) -> Items:
        """Return the items below an aspect. Each record is visited once, so that circles end."""
        faces, others = list[int](), list[int]()
        visited, waiting = set[tuple[int, bool]](), [(start, False)]
        while waiting:
            number, is_item = place = waiting.pop()
            if place in visited:
                continue
            visited.add(place)
            self._count(1)
            if not is_item:
                waiting.extend(reversed(self._below(number)))
            elif self._records.has(number, *_FACES):
                faces.append(number)
            elif elements := self._elements(number):
                waiting.extend((element, True) for element in reversed(elements))
            else:
                others.append(number)
        return tuple(faces), tuple(others)

    def _below(self, aspect: int) -> list[tuple[int, bool]]:
        """Return the items that a file states for an aspect, and its components, each with whether it is an item.

        A whole product has all faces of the file. The components of a dimension are its features.
        """
        items, components = self._items.get(aspect, []), self._components.get(aspect, [])
        if self._records.has(aspect, _PRODUCT):
            items = self._records.numbers("ADVANCED_FACE", "FACE_SURFACE")
        if self._records.has(aspect, *LOCATIONS, *SIZES, DATUM_SIZE):
            components = [*components, *filter(None, features_of(self._records, aspect))]
        return [*((item, True) for item in items), *((component, False) for component in components)]

    def _elements(self, item: int) -> list[int]:
        """Return the elements of a collection, such as the faces of a shell: its first list, or its first reference."""
        entity = next(iter(_COLLECTIONS & self._records.entities(item).keys()), "")
        parameters = self._records.parameters(item, entity)
        places = sorted(range(len(parameters)), key=lambda index: not isinstance(parameters[index], Parameters))
        return next((numbers for index in places if (numbers := parameters.references(index))), [])

    def _count(self, visits: int) -> None:
        """Raise OptionError if the search takes too long: each tolerance of a hostile file may refer to all of its faces."""
        self._visits += visits
        if self._visits > MAX_VISITS:
            raise OptionError(
                f'"{self._title}": its tolerances refer to more than {MAX_VISITS} faces and shape aspects; it is damaged, '
                "or too large to read"
            )


def features_of(records: Records, number: int) -> tuple[int, ...]:
    """Return the shape aspect of a size, or the two of a location; 0 for one that is missing."""
    if records.has(number, DATUM_SIZE):
        return (records.parameters(number, DATUM_SIZE).reference(4),)
    if records.has(number, *SIZES):
        return (records.parameters(number, *SIZES).reference(0),)
    ends = ((parameters.reference(2), parameters.reference(3)) for parameters in records.entities(number).values())
    return next((pair for pair in ends if all(pair)), (0, 0))


def datums_of(records: Records, aspects: Aspects) -> tuple[Datum, ...]:
    """Return the datums of a file, in the order of their records."""
    datums, points = [], _target_points(records)
    for number in records.numbers("DATUM"):
        letter, features = _letter(records, number), aspects.datum_features.get(number, [])
        targets = tuple(
            _target(records, aspects, feature, letter, points.get(feature))
            for feature in features if records.has(feature, *_TARGETS)
        )  # fmt: skip
        named = [part for target in targets for part in aspects.datum_features.get(target.record, ())]
        datums.append(Datum(letter, number, targets, *aspects.items(number, *features, *named)))
    return tuple(datums)


def _letter(records: Records, datum: int) -> str:
    """Return the letter of a datum, which is its last parameter."""
    parameters = records.parameters(datum, "DATUM", "COMMON_DATUM")
    return parameters.text(len(parameters) - 1) if parameters else ""


def _target(records: Records, aspects: Aspects, number: int, letter: str, point: Vector | None) -> DatumTarget:
    parameters = records.parameters(number, *_TARGETS)
    label = letter + parameters.text(len(parameters) - 1)
    kind = records.parameters(number, *_TARGETS, "SHAPE_ASPECT").text(1)
    return DatumTarget(label, kind, number, point, *aspects.items(number, *aspects.datum_features.get(number, ())))


def _target_points(records: Records) -> dict[int, Vector]:
    """Return the points [mm] of datum targets, in the frame of their product, by record number."""
    shapes = {
        target: records.parameters(definition.reference(1), _SHAPE)
        for _, definition in records.each("SHAPE_DEFINITION_REPRESENTATION")
        if definition and records.has(definition.reference(1), _SHAPE)
        and records.has(target := records.parameters(definition.reference(0), "PROPERTY_DEFINITION").reference(2), *_TARGETS)
    }  # fmt: skip
    items = {item for shape in list(shapes.values())[:MAX_TARGETS] for item in shape.references(1)}
    placements = {number: item.reference(1) for number, item in records.shapes(*items).items()}
    coordinates = records.shapes(*placements.values())
    points = {}
    for target, shape in shapes.items():
        unit = length_unit(records, shape.reference(2)) or math.nan
        places = [coordinates.get(placements.get(item, 0), Parameters()) for item in shape.references(1)]
        if point := next((point for place in places if (point := _point(place.value(1), unit))), None):
            points[target] = point
    return points


def _point(values: Value, unit: float) -> Vector | None:
    """Return a point [mm] from its coordinates in a record; None if they are none, or not finite."""
    numbers = [value * unit for value in values if isinstance(value, float)] if isinstance(values, Parameters) else []
    return (numbers[0], numbers[1], numbers[2]) if len(numbers) == 3 and all(map(math.isfinite, numbers)) else None


def datum_system(records: Records, systems: Sequence[int]) -> tuple[DatumReference, ...]:
    """Return the references of datum systems, or of references without a system, in order of precedence."""
    references = list[tuple[float, DatumReference]]()
    for number in systems:
        if records.has(number, "DATUM_SYSTEM"):
            compartments = records.parameters(number, "DATUM_SYSTEM").references(4)
            references += [(float(place), _reference(records, part)) for place, part in enumerate(compartments)]
        elif records.has(number, *_EARLIER):
            references.append(_earlier_reference(records, number))
    return tuple(reference for _, reference in sorted(references, key=lambda item: item[0]))


def _reference(records: Records, compartment: int) -> DatumReference:
    """Return the reference in a compartment: a datum, or several elements, which form a common datum."""
    parameters = records.parameters(compartment, "DATUM_REFERENCE_COMPARTMENT", _ELEMENT)
    modifiers, letters = list(_modifiers(records, parameters.value(5))), list[str]()
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
    modified, precedence = records.parameters(number, "REFERENCED_MODIFIED_DATUM"), parameters.value(0)
    reference = DatumReference((_letter(records, parameters.reference(1)),), tuple(modified.words(0) + modified.words(2)))
    return precedence if isinstance(precedence, float) else 0.0, reference


def _modifiers(records: Records, value: Value) -> Iterator[str]:
    """Yield the modifiers of a datum reference in words; those with a value are records of their own."""
    for item in flat(value):
        if isinstance(item, Word):
            yield str(item)
        elif isinstance(item, Reference):
            parameters = records.parameters(item, "DATUM_REFERENCE_MODIFIER_WITH_VALUE")
            size = length(records, parameters.reference(1))
            yield from (f"{word} {'' if size is None else f'{size:.6g}'}".strip() for word in parameters.words(0))
