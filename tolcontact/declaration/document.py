"""The document of an assembly: what an archive keeps of a model, and what a JSON model says.

The two differ in three things. An archive has faces as triangles, meshes beside the document, and nothing is left out of it.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import UNSET, Meta, UnsetType

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.codec import (
    CODECS,
    Choice,
    Codec,
    EntryError,
    Inline,
    Items,
    Named,
    Optional,
    Place,
    Plain,
    Record,
    Sources,
)
from tolcontact.declaration.contact_pair import VERTICES, ContactPair
from tolcontact.declaration.contributor import Correlation, Population, Variable
from tolcontact.declaration.feature_tolerance import BONUSES, KINDS, MATERIALS, MOVES, RULES, ZONES, Size
from tolcontact.declaration.force import Force
from tolcontact.declaration.geometry import UNITS, Box, Mesh
from tolcontact.declaration.locator import Location, Locator, ThreeTwoOne
from tolcontact.declaration.measure import Measure
from tolcontact.declaration.part import Face, Feature, Part, Point
from tolcontact.declaration.selection import KINDS as SURFACES
from tolcontact.declaration.selection import Brep, Cylinder, Facing, Inside, Largest, Near, Picked, Triangles
from tolcontact.declaration.tape import Tape, tape_of
from tolcontact.declaration.tolerance import SHAPES, Tolerance, scipy_distribution
from tolcontact.declaration.vectors import DIRECTIONS, Vector, direction
from tolcontact.errors import ArchiveError
from tolcontact.method import ACTIVE_SETS, OBJECTIVES, REGULARIZATIONS, RESOLUTIONS, SEARCHES, Method
from tolcontact.poses import ENTRIES

Document = dict[str, Any]
UNIT_TOLERANCE = 1e-12  # of the length of a direction
MAX_FREEDOMS = 7  # of a feature, with its size
MAX_INDEX = 2**31 - 1  # of triangles, points, faces


@dataclass(frozen=True)
class Writing:
    """What a document is written with.

    triangles   the indices of the triangles of a face
    tapes       the steps of the users' own expressions, by measure
    folder      the folder of a JSON model; None for an archive
    """

    triangles: Callable[[Face], list[int]]
    tapes: Mapping[str, Tape]
    folder: Path | None = None


def _text(choices: Iterable[str]) -> Any:
    """Return the type of a text whose choices the JSON schema lists; its class refuses others."""
    return Annotated[str, Meta(extra_json_schema={"enum": list(choices)})]


def _number(**limits: float) -> Any:
    """Return the type of a number whose limits the JSON schema states; its class refuses others."""
    return Annotated[float, Meta(extra_json_schema=limits)]


# Limits that msgspec itself would check crash its 0.22 in a union with a list: classes check them, or `_indices`.
INDEX = Annotated[int, Meta(extra_json_schema={"minimum": 0, "maximum": MAX_INDEX})]
POSITIVE, NOT_NEGATIVE = _number(exclusiveMinimum=0), _number(minimum=0)


def _part(name: str, place: Place) -> Part:
    """Return the part that an entry names."""
    if name not in place.sources.parts:
        raise place.mismatch("the name of a part", name)
    return place.sources.parts[name]  # type: ignore[no-any-return]


def _feature(name: str, place: Place) -> Feature:
    """Return the feature that an entry names, of the part that its record names."""
    features = {feature.name: feature for feature in place.part.features}
    if name not in features:
        raise place.mismatch(f'the name of a feature of part "{place.part.name}"', name)
    return features[name]


def _unit_vector(value: Any, place: Place) -> Vector:
    is_unit = not isinstance(value, str) and abs(math.hypot(*value) - 1) <= UNIT_TOLERANCE
    return value if is_unit else direction(value)


def _floats(value: Any, writing: Writing) -> Any:
    if isinstance(value, Mapping):
        return {key: float(item) for key, item in value.items()}
    if isinstance(value, tuple):
        return [None if item is None else float(item) for item in value]
    return None if value is None else float(value)


def _indices(value: Any, place: Place) -> Any:
    """Return indices, or what else stands for them. Raises EntryError for one that no triangle, point or face can have."""
    for k, index in enumerate(value) if isinstance(value, tuple) else [(None, value)]:
        if isinstance(index, int) and not 0 <= index <= MAX_INDEX:
            raise (place if k is None else place[k]).mismatch(f"a whole number from 0 to {MAX_INDEX}", index)
    return value


def _brep(value: Any, place: Place) -> Any:
    """Return the number, the name or the point of a B-rep face."""
    return value if isinstance(value, tuple) else _indices(value, place)


def _array(rows: list[list[float]], place: Place) -> np.ndarray:
    """Return rows of equal length as an array (row, column)."""
    for k, row in enumerate(rows):
        if len(row) != len(rows[0]):
            raise place[k].mismatch(f"a list of {len(rows[0])}", row)
    return np.array(rows, dtype=float).reshape(len(rows), len(rows[0]) if rows else 0)


class AxisFace(Plain):
    """Criteria that are one of six directions, without an angle."""

    def __init__(self) -> None:
        super().__init__(
            _text(DIRECTIONS), lambda face, writing: face.direction, lambda text, place: place.checked(Facing(text))
        )

    def holds(self, value: Any) -> bool:
        return isinstance(value, Facing) and isinstance(value.direction, str) and value == Facing(value.direction)


class Wrapped(Codec):
    """Entries with one value, under the key `mark`."""

    def __init__(self, mark: str, codec: Codec) -> None:
        self.mark, self.codec, self.cls = mark, codec, codec.cls
        self.struct = msgspec.defstruct(mark.title(), [(mark, codec.wire)], forbid_unknown_fields=True)
        schema = msgspec.json.schema_components([self.struct])[1][mark.title()]
        self.wire = Annotated[Any, Meta(extra_json_schema=schema)]

    def encode(self, value: Any, writing: Writing) -> Document:
        return {self.mark: self.codec.encode(value, writing)}

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        return self.codec.decode(getattr(place.converted(entry, self.struct), self.mark), place[self.mark])

    def fits(self, entry: Any) -> bool:
        return isinstance(entry, dict) and self.mark in entry


class Faces(Named):
    """Faces: their criteria in a JSON model; a direction or triangles, and boxes, in an archive."""

    cls = Face

    def __init__(self) -> None:
        super().__init__("Face")
        self.struct = msgspec.defstruct("Face", [
            ("part", str), ("select", list[CRITERION.wire] | UnsetType, UNSET),  # type: ignore[name-defined]
            ("direction", AXIS.wire | UnsetType, UNSET), ("triangles", TRIANGLES.wire | UnsetType, UNSET),
            ("inside", BOXES.wire, ()),
        ], forbid_unknown_fields=True)  # fmt: skip

    def encode(self, value: Face, writing: Writing) -> Document:
        if writing.folder is not None:
            return {
                "part": value.part.name,
                "select": [_criterion(value, criterion, writing) for criterion in value.selections],
            }
        boxes = [[box.lower, box.upper] for box in value.selections if isinstance(box, Inside)]
        others = [criterion for criterion in value.selections if not isinstance(criterion, Inside)]
        is_axis = len(others) == 1 and AXIS.holds(others[0])
        triangles = {"direction": str(others[0])} if is_axis else {"triangles": writing.triangles(value)}
        return {"part": value.part.name, **triangles, "inside": boxes}

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Face:
        struct = place.converted(entry, self.struct)
        part, criteria = _part(struct.part, place["part"]), []
        if struct.select is not UNSET:
            criteria = [CRITERION.decode(item, place["select"][k]) for k, item in enumerate(struct.select)]
        if struct.direction is not UNSET:
            criteria.append(AXIS.decode(struct.direction, place["direction"]))
        if struct.triangles is not UNSET:
            criteria.append(Triangles(TRIANGLES.decode(struct.triangles, place["triangles"])))
        criteria += [Inside(*box) for box in BOXES.decode(struct.inside, place["inside"])]
        return place.checked(Face(part, tuple(criteria)))  # type: ignore[no-any-return]


def _criterion(face: Face, criterion: Any, writing: Writing) -> Any:
    """Return the entry of a criterion; what a function picks are triangles."""
    if isinstance(criterion, Picked):
        criterion = Triangles(tuple(map(int, writing.triangles(Face(face.part, (criterion,))))))
    return CRITERION.encode(criterion, writing)


class Shape(Choice):
    """Shapes of parts. Meshes are files of a JSON model; an archive has them beside the document, by the names of parts."""

    def encode(self, value: Any, writing: Writing) -> Any:
        return {"mesh": str(value)} if isinstance(value, Mesh) and writing.folder is None else super().encode(value, writing)


def _mesh(place: Place) -> Mesh:
    """Return the mesh that an archive has beside the document."""
    if place.record.name not in place.sources.meshes:
        raise place.error("expected that of a part with a mesh, or with a box")
    return Mesh(place.sources.meshes[place.record.name])


def _file_name(source: Any, writing: Writing) -> str:
    path, folder = Path(source).resolve(), writing.folder or Path()
    return (path.relative_to(folder) if path.is_relative_to(folder) else path).as_posix()


def _file(name: str, place: Place) -> Path:
    if place.sources.folder is None:
        raise place.error("an archive names no files; expected that of a part with a mesh, or with a box")
    return place.sources.folder / name


def _distribution_entries(thing: Any, writing: Writing) -> Document:
    if isinstance(thing.distribution, str):
        return {"distribution": thing.distribution}
    frozen = thing.distribution
    return {"scipy": frozen.dist.name, "args": _floats(tuple(frozen.args), writing), "kwds": _floats(frozen.kwds, writing)}


def _distribution(entries: Mapping[str, Any], place: Place) -> Any:
    """Return the distribution that is named, or the one of scipy.stats."""
    if "scipy" not in entries:
        for key in {"args", "kwds"} & set(entries):
            raise place[key].error('it goes with "scipy"; leave it out')
        return entries.get("distribution", UNSET)
    if "distribution" in entries:
        raise place["distribution"].error('it is given beside "scipy"; leave one of them out')
    name, family = entries["scipy"], scipy_distribution(entries["scipy"])
    if family is None:
        raise place["scipy"].mismatch("a continuous distribution of scipy.stats", name)
    positional = ARGUMENTS.decode(entries.get("args", []), place["args"])
    keywords = KEYWORDS.decode(entries.get("kwds", {}), place["kwds"])
    try:
        return family(*positional, **keywords)
    except (TypeError, ValueError) as error:  # parameters that it does not have
        raise place.error(f"scipy.stats.{name}: {error}") from error


def _measured_entries(measure: Measure, writing: Writing) -> Document:
    if isinstance(measure.of, Point):
        return {"of": POINT.encode(measure.of, writing)}
    return {"tape": writing.tapes[measure.name]}


def _measured(entries: Mapping[str, Any], place: Place) -> Point | Tape:
    if len(entries) != 1:
        raise place.error('expected either "of", a point, or "tape", the steps of an expression')
    if "of" in entries:
        return POINT.decode(entries["of"], place["of"])  # type: ignore[no-any-return]
    return tape_of(entries["tape"], place["tape"])


def _tolerance_record(cls: Any) -> Record:
    """Return the record of a geometric tolerance: its width, and what is not at its default."""
    keys = ["width", *(f"{member.name}?" for member in fields(cls) if member.name != "width")]
    return Record(
        cls, " ".join(keys), kind=cls.kind, width=Plain(NOT_NEGATIVE),
        zone=Plain(_text(ZONES) | None), along=Optional(FREE_DIRECTION),
        material=Plain(_text(MATERIALS)), bonus=Plain(_text(BONUSES)), rule=Plain(_text(RULES)),
    )  # fmt: skip


UNIT_VECTOR = Plain(_text([*DIRECTIONS, "x", "y", "z"]) | Vector, read=_unit_vector)
FREE_DIRECTION = Plain(_text([*DIRECTIONS, "x", "y", "z"]) | Vector, write=lambda value, writing: direction(value))
AXIS = AxisFace()
TRIANGLES = Plain(tuple[INDEX, ...], lambda indices, writing: list(map(int, indices)), _indices)
BOXES = Plain(tuple[tuple[Vector, Vector], ...])
FLOAT, ARGUMENTS, KEYWORDS = Plain(float, write=_floats), Plain(tuple[float, ...]), Plain(Mapping[str, float])
CODECS |= {
    Part: Plain(str, lambda part, writing: part.name, _part),
    Feature: Plain(str, lambda feature, writing: feature.name, _feature),
    np.ndarray: Plain(list[list[float]], lambda array, writing: array.tolist(), _array),
}
CRITERION = Choice(
    "Criterion",
    "a direction, or one of facing, inside, near, brep, cylinder, largest, triangles",
    AXIS,
    Record(Facing, "facing=direction angle", mark="facing", facing=FREE_DIRECTION, angle=Plain(POSITIVE)),
    Record(Inside, "inside=lower+upper", mark="inside"),
    Record(Near, "near=part within", mark="near", near=CODECS[Part], within=Plain(POSITIVE)),
    Record(Brep, "brep=which", mark="brep", brep=Plain(INDEX | str | Vector, read=_brep)),
    Wrapped("cylinder", Record(Cylinder, "radius? inner?", radius=Plain(POSITIVE | None))),
    Record(
        Largest, "largest=kind direction?", mark="largest", largest=Plain(_text(SURFACES)), direction=Optional(FREE_DIRECTION)
    ),
    Record(Triangles, "triangles=indices", mark="triangles", triangles=TRIANGLES),
)
CODECS[Face] = Faces()
POINT = CODECS[Point] = Record(Point, "part on? end? position?")
DISTRIBUTION = Inline(
    {"distribution": _text(SHAPES), "scipy": str, "args": ARGUMENTS.wire, "kwds": KEYWORDS.wire},
    _distribution_entries,
    _distribution,
)
ZONE = Record(
    Tolerance, "range? distribution shift? cp? cpk?", name="Zone", range=Plain(NOT_NEGATIVE | None), distribution=DISTRIBUTION,
    shift=FLOAT, cp=Plain(POSITIVE | None, write=_floats), cpk=Plain(float | None, write=_floats),
)  # fmt: skip
WIDTH = Plain(NOT_NEGATIVE, read=lambda width, place: place.checked(Tolerance(width)))
CODECS[Tolerance] = Choice("Tolerance", "a width in mm, or named values", ZONE, WIDTH)
SIZE = Record(
    Size, "nominal upper lower cp cpk moves distribution", kind="size", nominal=Plain(POSITIVE), lower=Plain(float | None),
    moves=Plain(_text(MOVES)), distribution=DISTRIBUTION,
)  # fmt: skip
CONTROL = Choice(
    "FeatureTolerance", f"kind: one of {', '.join(['size', *KINDS])}", SIZE, *map(_tolerance_record, KINDS.values())
)
FEATURE = Record(Feature, "faces tolerances name datum declared_at", tolerances=Items(CONTROL))
SHAPE = Shape(
    "Shape",
    "a box, or a file",
    Record(Box, "box=x+y+z", mark="box"),
    Record(
        Mesh, "file=source units? body? chord?", mark="file", units=Plain(_text(UNITS) | None), chord=Plain(POSITIVE | None),
        file=Plain(Annotated[str, Meta(description="path, from the folder of this file")], _file_name, _file),
    ),
    Wrapped("mesh", Plain(str, read=lambda text, place: _mesh(place))),
)  # fmt: skip
LOCATOR = Record(
    Locator, "name point direction one_sided stiffness tolerance on?",
    direction=UNIT_VECTOR, stiffness=Plain(POSITIVE, write=_floats),
)  # fmt: skip
SCHEME = Choice(
    "Scheme",
    "a list of locators, or a 3-2-1 scheme",
    Items(LOCATOR),
    Record(ThreeTwoOne, "three_two_one=primary+secondary+tertiary inset", inset=Plain(NOT_NEGATIVE, write=_floats)),
)
METHOD = Record(
    Method, " ".join(member.name for member in fields(Method)), resolution=Plain(_text(RESOLUTIONS)),
    objective=Plain(_text(OBJECTIVES)), regularization=Plain(_text(REGULARIZATIONS)), active_set=Plain(_text(ACTIVE_SETS)),
    search=Plain(_text(SEARCHES)),
)  # fmt: skip
# A part is read without its features, whose faces may refer to all parts.
FEATURES = Inline(
    {"features": Items(FEATURE).wire},
    lambda part, writing: {"features": [FEATURE.encode(feature, writing) for feature in part.features]},
    lambda entries, place: UNSET,
)
LISTS = {
    "parts": Record(Part, "geometry name at rotation fixed declared_at features", geometry=SHAPE, features=FEATURES),
    "locations": Record(Location, "part on tolerance scheme declared_at floating?", scheme=SCHEME),
    "pairs": Record(
        ContactPair, "moving reference name points spacing within declared_at",
        points=Plain(INDEX | _text([VERTICES]) | None, read=_indices),
        spacing=Plain(POSITIVE | None), within=Plain(POSITIVE | None),
    ),
    "measures": Record(
        Measure, "name of to? along tolerance units declared_at absolute? limits?", of=Inline(
            {"of": POINT.wire, "tape": Annotated[list[list[str | int | float]], Meta(description="steps of an expression")]},
            _measured_entries, _measured,
        ), along=Optional(UNIT_VECTOR), tolerance=Plain(POSITIVE | None),
        limits=Plain(tuple[float | None, float | None] | None, write=_floats),
    ),
    "forces": Record(Force, "at name vector declared_at"),
    "variables": Record(Variable, "tolerance drives name units declared_at", drives=Plain(Mapping[str, float], write=_floats)),
    "correlations": Record(Correlation, "labels matrix declared_at"),
    "populations": Record(Population, "values columns source declared_at"),
}  # fmt: skip
DOCUMENT = msgspec.defstruct("Document", [
    ("name", str), ("parts", Items(LISTS["parts"]).wire), ("measures", Items(LISTS["measures"]).wire),
    ("schema", str | UnsetType, UNSET), ("method", METHOD.wire | None, None),
    *((name, Items(record).wire, []) for name, record in LISTS.items() if name not in ("parts", "measures")),
], forbid_unknown_fields=True, rename={"schema": "$schema"})  # fmt: skip


def to_document(assembly: Assembly, writing: Writing) -> Document:
    """Return the document of an assembly, for an archive or a JSON model."""
    lists = {name: [record.encode(thing, writing) for thing in getattr(assembly, name)] for name, record in LISTS.items()}
    return {"name": assembly.name, "method": Optional(METHOD).encode(assembly.method, writing), **lists}


def from_document(document: Any, meshes: Mapping[str, Any]) -> Assembly:
    """Return the assembly of an archive's document; `meshes` holds a mesh (vertices and faces) for each mesh part.

    Raises ArchiveError for a document that `to_document` cannot have made. Nothing in it is run.
    """
    try:
        return assembly_of(document, Sources(meshes))
    except EntryError as error:
        raise ArchiveError(f"the declared model in the archive is damaged: {error}") from error


def assembly_of(document: Any, sources: Sources) -> Assembly:
    """Return the assembly of a document. Raises EntryError, which states the place of the first fault."""
    place = Place(sources)
    struct = place.converted(document, DOCUMENT)
    for k, entry in enumerate(struct.parts):
        part = LISTS["parts"].decode(entry, place["parts"][k])
        if part.name in sources.parts:
            raise place["parts"][k]["name"].mismatch("a name that no other part has", part.name)
        sources.parts[part.name] = part
    parts = list(sources.parts.values())
    for k, (part, entry) in enumerate(zip(parts, struct.parts, strict=True)):
        part.add(*Items(FEATURE).decode(entry.get("features", []), place["parts"][k]["features"], part=part))

    things: dict[str, Any] = {"parts": parts}
    for name in [name for name in LISTS if name not in ("parts", "measures")]:
        things[name] = Items(LISTS[name]).decode(getattr(struct, name), place[name])
    locators = sum(len(each.scheme) if isinstance(each.scheme, tuple) else 6 for each in things["locations"])
    deviations = locators + MAX_FREEDOMS * sum(len(part.features) for part in parts) + len(things["variables"])
    sources = replace(sources, inputs=ENTRIES * len(parts) + deviations)
    things["measures"] = Items(LISTS["measures"]).decode(struct.measures, Place(sources)["measures"])
    method = Optional(METHOD).decode(struct.method, place["method"])
    assembly = Assembly.of(struct.name, method, **things)
    for fault in assembly.faults():  # a model that has any is not archived
        raise place.error(fault)
    return assembly
