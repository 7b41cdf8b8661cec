"""Shape aspects, and the faces, edges and points that they represent."""

from collections import defaultdict
from typing import NamedTuple

from tolcontact.errors import OptionError
from tolcontact.pmi.part21 import Parameters, Records

MAX_VISITS = 2_000_000  # of records, in the search for faces; the largest files of NIST take some thousands
_FACES = ("ADVANCED_FACE", "FACE_SURFACE", "FACE")
_USAGES = ("GEOMETRIC_ITEM_SPECIFIC_USAGE", "ITEM_IDENTIFIED_REPRESENTATION_USAGE")
# From a composite, a pattern or a derived aspect (a centre of symmetry) to its components.
_COMPOSITIONS = (
    "SHAPE_ASPECT_RELATIONSHIP", "SHAPE_ASPECT_DERIVING_RELATIONSHIP", "SHAPE_ASPECT_ASSOCIATIVITY",
    "COMPONENT_FEATURE_RELATIONSHIP",
)  # fmt: skip
LOCATIONS = ("DIMENSIONAL_LOCATION", "DIRECTED_DIMENSIONAL_LOCATION", "DIMENSIONAL_LOCATION_WITH_PATH", "ANGULAR_LOCATION")
SIZES = ("DIMENSIONAL_SIZE", "ANGULAR_SIZE", "DIMENSIONAL_SIZE_WITH_PATH")
DATUM_SIZE = "DIMENSIONAL_SIZE_WITH_DATUM_FEATURE"
_PRODUCT = "PRODUCT_DEFINITION_SHAPE"
TARGETS = ("DATUM_TARGET", "PLACED_DATUM_TARGET_FEATURE")
_COLLECTIONS = {
    "CONNECTED_FACE_SUB_SET", "CONNECTED_FACE_SET", "OPEN_SHELL", "CLOSED_SHELL", "CONNECTED_EDGE_SET", "GEOMETRIC_SET",
    "GEOMETRIC_CURVE_SET", "SHELL_BASED_SURFACE_MODEL", "MANIFOLD_SOLID_BREP",
    "BREP_WITH_VOIDS",
}  # fmt: skip


class Items(NamedTuple):
    """Numbers of records: B-rep faces, and other items, such as edges and points."""

    faces: tuple[int, ...] = ()
    others: tuple[int, ...] = ()


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
        for number in records.numbers(*_USAGES):
            usage = records.parameters(number, *_USAGES)
            self._items[usage.reference(2)].extend(usage.references(4))
        for number in records.numbers(*_COMPOSITIONS, "FEATURE_FOR_DATUM_TARGET_RELATIONSHIP"):
            if not records.has(number, *LOCATIONS):
                self._relate(number)

    def items(self, *aspects: int) -> Items:
        """Return all items that aspects, dimensions or datums represent, each once, in their order."""
        for aspect in aspects:
            if aspect not in self._known:
                self._known[aspect] = self._search(aspect)
        parts = [self._known[aspect] for aspect in aspects]
        self._count(sum(len(faces) + len(others) for faces, others in parts))
        if len(parts) == 1:
            return parts[0]
        faces = dict.fromkeys(face for part in parts for face in part.faces)
        others = dict.fromkeys(other for part in parts for other in part.others)
        return Items(tuple(faces), tuple(others))

    def extent(self, aspect: int) -> str:
        """Return the words of a drawing for an aspect of several faces: "all around", "between", "all over", or nothing."""
        entities = self._records.entities(aspect)
        names = {"ALL_AROUND_SHAPE_ASPECT": "all around", "BETWEEN_SHAPE_ASPECT": "between", _PRODUCT: "all over"}
        return next((words for entity, words in names.items() if entity in entities), "")

    def _relate(self, number: int) -> None:
        entities = self._records.entities(number)
        for relationship in entities.values():
            relating, related = relationship.reference(2), relationship.reference(3)
            if not (relating and related):
                continue
            if self._records.has(related, "DATUM", *TARGETS):
                self.datum_features[related].append(relating)
            else:
                self._components[relating].append(related)

    def _search(self, start: int) -> Items:
        """Return the items below an aspect. Each record is visited once, so that circles end."""
        faces: list[int] = []
        others: list[int] = []
        visited: set[tuple[int, bool]] = set()
        waiting = [(start, False)]
        while waiting:
            number, is_item = place = waiting.pop()
            if place in visited:
                continue
            visited.add(place)
            self._count(1)
            if not is_item:
                waiting.extend((part, False) for part in reversed(self._parts(number)))
                waiting.extend((item, True) for item in reversed(self._items_of(number)))
            elif self._records.has(number, *_FACES):
                faces.append(number)
            elif elements := self._elements(number):
                waiting.extend((element, True) for element in reversed(elements))
            else:
                others.append(number)
        return Items(tuple(faces), tuple(others))

    def _items_of(self, aspect: int) -> list[int]:
        """Return the items that a file states for an aspect; a whole product has all faces of the file."""
        if self._records.has(aspect, _PRODUCT):
            return self._records.numbers("ADVANCED_FACE", "FACE_SURFACE")
        return self._items.get(aspect, [])

    def _parts(self, aspect: int) -> list[int]:
        """Return the components of an aspect, or the features of a dimension."""
        components = self._components.get(aspect, [])
        if self._records.has(aspect, *LOCATIONS, *SIZES, DATUM_SIZE):
            return [*components, *filter(None, features_of(self._records, aspect))]
        return components

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
    relationship = next((p for p in records.entities(number).values() if p.reference(2) and p.reference(3)), None)
    return (relationship.reference(2), relationship.reference(3)) if relationship else (0, 0)
