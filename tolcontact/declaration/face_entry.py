"""Entries of faces and their criteria, of points and measurements, and of the values in all entries."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import UNSET, Meta, UnsetType

from tolcontact.declaration.codec import CODECS, Choice, Codec, DocumentRecord, Items, Named, Optional, Plain
from tolcontact.declaration.measure import Tape
from tolcontact.declaration.measurement import MAX_DEPTH, MEASUREMENTS, Combination
from tolcontact.declaration.part import Face, Feature, Part, Point
from tolcontact.declaration.place import Place
from tolcontact.declaration.selection import (
    FACE_GROUPS,
    KINDS as SURFACES,
    Brep,
    Cylinder,
    Facing,
    Inside,
    Largest,
    Near,
    Picked,
    Triangles,
)  # fmt: skip
from tolcontact.declaration.values import DIRECTIONS, Vector, direction

Document = dict[str, Any]
UNIT_TOLERANCE = 1e-12  # of the length of a direction
MAX_INDEX = 2**31 - 1  # of triangles, points, faces


@dataclass(frozen=True)
class Writing:
    """The data for writing a document.

    triangles   the indices of the triangles of a face
    tapes       the steps of the users' own expressions, by measure
    folder      the folder of a JSON model; None for an archive
    """

    triangles: Callable[[Face], list[int]]
    tapes: Mapping[str, Tape]
    folder: Path | None = None


def text_type(choices: Iterable[str]) -> Any:
    """Return the type of a text whose choices the JSON schema lists; its class refuses others."""
    return Annotated[str, Meta(extra_json_schema={"enum": list(choices)})]


def number_type(**limits: float) -> Any:
    """Return the type of a number whose limits the JSON schema states; its class refuses others."""
    return Annotated[float, Meta(extra_json_schema=limits)]


# Limits that msgspec itself would check crash its 0.22 in a union with a list: classes check them, or `indices_of`.
INDEX = Annotated[int, Meta(extra_json_schema={"minimum": 0, "maximum": MAX_INDEX})]
POSITIVE, NOT_NEGATIVE = number_type(exclusiveMinimum=0), number_type(minimum=0)


def _part(name: str, place: Place) -> Part:
    """Return the part that an entry names."""
    if name not in place.sources.parts:
        raise place.mismatch("the name of a part", name)
    return place.sources.parts[name]  # type: ignore[no-any-return]


def feature_named(name: str, place: Place) -> Feature:
    """Return the feature that an entry names, of the part that its record names."""
    features = {feature.name: feature for feature in place.part.features}
    if name not in features:
        raise place.mismatch(f'the name of a feature of part "{place.part.name}"', name)
    return features[name]


def _unit_vector(value: Any, place: Place) -> Vector:
    is_unit = not isinstance(value, str) and abs(math.hypot(*value) - 1) <= UNIT_TOLERANCE
    return value if is_unit else direction(value)


def floats(value: Any, writing: Writing) -> Any:
    """Return a number as a float; also in tuples and mappings. Scripts may have integers, or numbers of NumPy."""
    if isinstance(value, Mapping):
        return {key: float(item) for key, item in value.items()}
    if isinstance(value, tuple):
        return [None if item is None else float(item) for item in value]
    return None if value is None else float(value)


def indices_of(value: Any, place: Place) -> Any:
    """Return indices, or an entry in their place. Raises EntryError for an index out of range."""
    for k, index in enumerate(value) if isinstance(value, tuple) else [(None, value)]:
        if isinstance(index, int) and not 0 <= index <= MAX_INDEX:
            raise (place if k is None else place[k]).mismatch(f"a whole number from 0 to {MAX_INDEX}", index)
    return value


def _brep_faces(value: Any, place: Place) -> Any:
    """Return the numbers, names or points of one B-rep face, or of several."""
    if isinstance(value, dict):
        if list(value) != ["any"]:
            raise place.mismatch('faces under the key "any"', list(value))
        return tuple(_brep_faces(face, place["any"][k])[0] for k, face in enumerate(value["any"]))
    return (value if isinstance(value, tuple) else indices_of(value, place),)


def _brep_entry(faces: tuple[Any, ...], writing: Writing) -> Any:
    return faces[0] if len(faces) == 1 else {"any": faces}


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
            text_type(DIRECTIONS), lambda face, writing: face.direction, lambda text, place: place.checked(Facing(text))
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
        criteria = [criterion for criterion in value.selections if not isinstance(criterion, Inside)]
        is_axis = len(criteria) == 1 and AXIS.holds(criteria[0])
        triangles = {"direction": str(criteria[0])} if is_axis else {"triangles": writing.triangles(value)}
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
    """Return the entry of a criterion; a function is replaced by the triangles that it picks."""
    if isinstance(criterion, Picked):
        criterion = Triangles(tuple(map(int, writing.triangles(Face(face.part, (criterion,))))))
    return CRITERION.encode(criterion, writing)


UNIT_VECTOR = Plain(text_type([*DIRECTIONS, "x", "y", "z"]) | Vector, read=_unit_vector)
FREE_DIRECTION = Plain(text_type([*DIRECTIONS, "x", "y", "z"]) | Vector, write=lambda value, writing: direction(value))
AXIS = AxisFace()
TRIANGLES = Plain(tuple[INDEX, ...], lambda indices, writing: list(map(int, indices)), indices_of)
BOXES = Plain(tuple[tuple[Vector, Vector], ...])
FLOAT = Plain(float, write=floats)
CODECS |= {
    Part: Plain(str, lambda part, writing: part.name, _part),
    Feature: Plain(str, lambda feature, writing: feature.name, feature_named),
    np.ndarray: Plain(list[list[float]], lambda array, writing: array.tolist(), _array),
}
CRITERION = Choice(
    "Criterion",
    "a direction, or one of facing, inside, near, brep, cylinder, largest, triangles",
    AXIS,
    DocumentRecord(Facing, "facing=direction angle", mark="facing", facing=FREE_DIRECTION, angle=Plain(POSITIVE)),
    DocumentRecord(Inside, "inside=lower+upper", mark="inside"),
    DocumentRecord(Near, "near=part within", mark="near", near=CODECS[Part], within=Plain(POSITIVE)),
    DocumentRecord(
        Brep,
        "brep=which whole?",
        mark="brep",
        build=lambda which, whole=False: Brep(*which, whole=whole),
        brep=Plain(INDEX | str | Vector | dict[str, list[INDEX | str | Vector]], _brep_entry, _brep_faces),  # type: ignore[misc]
        whole=Plain(bool | text_type(FACE_GROUPS)),
    ),
    Wrapped("cylinder", DocumentRecord(Cylinder, "radius? inner?", radius=Plain(POSITIVE | None))),
    DocumentRecord(
        Largest,
        "largest=kind direction?",
        mark="largest",
        largest=Plain(text_type(SURFACES)),
        direction=Optional(FREE_DIRECTION),
    ),
    DocumentRecord(Triangles, "triangles=indices", mark="triangles", triangles=TRIANGLES),
)
CODECS[Face] = Faces()


class Operands(Items):
    """The measurements of a combination."""

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        if place.path.count(".measurements") > MAX_DEPTH:
            raise place.error(f"its measurements are nested too deeply; expected at most {MAX_DEPTH} combinations")
        return super().decode(entry, place, **arguments)


def _record(cls: Any) -> DocumentRecord:
    """Return the record of a kind of measurement: its faces and points, and directions if it has some."""
    if issubclass(cls, Combination):
        return DocumentRecord(
            cls, "measurements", kind=cls.kind, measurements=Operands(OPERAND), build=lambda measurements: cls(*measurements)
        )
    keys = " ".join(f"{member.name}?" if member.default is None else member.name for member in fields(cls))
    vector = Optional(UNIT_VECTOR)
    return DocumentRecord(cls, keys, kind=cls.kind, across=vector, along=vector, about=vector)


CODECS[Point] = DocumentRecord(Point, "part on? end? position?", mark="part")
KIND = f"a measurement whose kind is one of {', '.join(MEASUREMENTS)}"
OPERAND = Choice("Operand", f"the name of a measurement, or {KIND}")
KINDS = tuple(map(_record, MEASUREMENTS.values()))
OPERAND.codecs = (*KINDS, Plain(str))
MEASURED = Choice("Measured", f"a point, or {KIND}", *KINDS, CODECS[Point])
