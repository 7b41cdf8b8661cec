"""Entries of faces and their criteria, of points and measurements in a document."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from tolcontact.declaration.checks import POSITIVE, text_type
from tolcontact.declaration.codec import CODECS, Choice, Document, Items, Plain
from tolcontact.declaration.measure import Tape
from tolcontact.declaration.measurement import MEASUREMENTS, Chain, Combination, Measurement
from tolcontact.declaration.part import Face, Feature, Part, Point
from tolcontact.declaration.place import Place
from tolcontact.declaration.record import Field, Record
from tolcontact.declaration.selection import (
    FACE_GROUPS,
    Brep,
    Cylinder,
    Facing,
    Inside,
    Largest,
    Near,
    Picked,
    Triangles,
)
from tolcontact.declaration.values import DIRECTIONS, Vector, direction

UNIT_TOLERANCE = 1e-12  # of the length of a direction
MAX_INDEX = 2**31 - 1  # of triangles, points, faces
INDEX = Annotated[int, Meta(extra_json_schema={"minimum": 0, "maximum": MAX_INDEX})]


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


def _array(rows: list[list[float]], place: Place) -> np.ndarray:
    """Return rows of equal length as an array (row, column)."""
    for k, row in enumerate(rows):
        if len(row) != len(rows[0]):
            raise place[k].mismatch(f"a list of {len(rows[0])}", row)
    return np.array(rows, dtype=float).reshape(len(rows), len(rows[0]) if rows else 0)


def _unit_vector(value: Any, place: Place) -> Vector:
    is_unit = not isinstance(value, str) and abs(math.hypot(*value) - 1) <= UNIT_TOLERANCE
    return value if is_unit else direction(value)


def _indices(value: Any, place: Place) -> Any:
    """Return indices, or an entry in their place. Raises EntryError for an index out of range."""
    for k, index in enumerate(value) if isinstance(value, tuple) else [(None, value)]:
        if isinstance(index, int) and not 0 <= index <= MAX_INDEX:
            raise (place if k is None else place[k]).mismatch(f"a whole number from 0 to {MAX_INDEX}", index)
    return value


CODECS |= {
    Part: Plain(str, lambda part, writing: part.name, _part),
    Feature: Plain(str, lambda feature, writing: feature.name, feature_named),
    np.ndarray: Plain(list[list[float]], lambda array, writing: array.tolist(), _array),
}
UNIT_VECTOR = Plain(text_type([*DIRECTIONS, "x", "y", "z"]) | Vector, read=_unit_vector)
FREE_DIRECTION = Plain(text_type([*DIRECTIONS, "x", "y", "z"]) | Vector, lambda value, writing: direction(value))


def _brep_faces(value: Any, place: Place) -> Any:
    """Return the numbers, names or points of one B-rep face, or of several."""
    if isinstance(value, dict):
        if list(value) != ["any"]:
            raise place.mismatch('faces under the key "any"', list(value))
        return tuple(_brep_faces(face, place["any"][k])[0] for k, face in enumerate(value["any"]))
    return (value if isinstance(value, tuple) else _indices(value, place),)


def _is_axis(criterion: Any) -> bool:
    """Return True for a criterion that is one of six directions, without its own angle."""
    is_text = isinstance(criterion, Facing) and isinstance(criterion.direction, str)
    return is_text and criterion == Facing(criterion.direction)


AXIS = Plain(
    text_type(DIRECTIONS), lambda face, writing: face.direction, lambda text, place: place.checked(Facing(text)), _is_axis
)
TRIANGLES = Plain(tuple[INDEX, ...], lambda indices, writing: list(map(int, indices)), _indices)
BREP_FACES = Plain(
    INDEX | str | Vector | dict[str, list[INDEX | str | Vector]],  # type: ignore[misc]
    lambda faces, writing: faces[0] if len(faces) == 1 else {"any": faces},
    _brep_faces,
)
CYLINDER = Record(Cylinder, omitted="radius inner")
CRITERION = Choice(
    "Criterion",
    "a direction, or one of facing, inside, near, brep, cylinder, largest, triangles",
    AXIS,
    Record(Facing, mark="facing", direction=FREE_DIRECTION, angle=Plain(POSITIVE)),
    Record(Inside, mark="inside", marked=2),
    Record(Near, mark="near", part=CODECS[Part]),
    Record(
        Brep, mark="brep", omitted="whole", which=BREP_FACES, whole=Plain(bool | text_type(FACE_GROUPS)),
        build=lambda which, whole=False: Brep(*which, whole=whole),
    ),
    Record(Cylinder, mark="cylinder", fields="cylinder", name="CylinderCriterion", cylinder=Field(
        {"cylinder": CYLINDER}, lambda cylinder, writing: {"cylinder": cylinder}, lambda values, place: values, is_required=True
    ), build=lambda cylinder: cylinder),
    Record(Largest, mark="largest", omitted="direction", direction=FREE_DIRECTION),
    Record(Triangles, mark="triangles", indices=TRIANGLES),
)  # fmt: skip


def _criteria(face: Face, writing: Writing) -> Document:
    """Return the criteria of a face in a JSON model; in an archive a direction or triangles, and boxes."""
    boxes = [criterion for criterion in face.selections if isinstance(criterion, Inside)]
    others = [criterion for criterion in face.selections if not isinstance(criterion, Inside)]
    if writing.folder is None:
        is_axis = len(others) == 1 and _is_axis(others[0])
        criteria = {"direction": others[0]} if is_axis else {"triangles": writing.triangles(face)}
        return {**criteria, "inside": tuple((box.lower, box.upper) for box in boxes)}
    return {
        "select": [
            Triangles(tuple(map(int, writing.triangles(Face(face.part, (criterion,)))))) if isinstance(criterion, Picked)
            else criterion
            for criterion in face.selections
        ]
    }  # fmt: skip


def _selections(values: Document, place: Place) -> Document:
    triangles = [Triangles(values["triangles"])] if "triangles" in values else []
    directions = [values["direction"]] if "direction" in values else []
    boxes = [Inside(*box) for box in values.get("inside", ())]
    return {"selections": (*values.get("select", ()), *directions, *triangles, *boxes)}


CODECS[Face] = Record(Face, part=CODECS[Part], selections=Field({
    "select": Items(CRITERION), "direction": AXIS, "triangles": TRIANGLES, "inside": Plain(tuple[tuple[Vector, Vector], ...]),
}, _criteria, _selections))  # fmt: skip
CODECS[Point] = Record(Point, mark="part", fields="part on end position", omitted="on end position")


def _record(cls: Any) -> Record:
    """Return the record of a kind of measurement: its faces and points, and its directions if it has any."""
    if issubclass(cls, Combination):
        return Record(cls, kind=cls.kind, fields="measurements", build=lambda measurements: cls(*measurements))
    if cls is Chain:
        return Record(cls, kind=cls.kind, omitted="nominal units", floats="sensitivities nominal")
    return Record(cls, kind=cls.kind, omitted="across along about", across=UNIT_VECTOR, along=UNIT_VECTOR, about=UNIT_VECTOR)


KIND = f"a measurement whose kind is one of {', '.join(MEASUREMENTS)}"
KINDS = tuple(map(_record, MEASUREMENTS.values()))
CODECS[str | Measurement] = Choice("Operand", f"the name of a measurement, or {KIND}", *KINDS, Plain(str))
MEASURED = Choice("Measured", f"a point, or {KIND}", *KINDS, CODECS[Point])
