"""Entries of shapes, faces, features, tolerances, measurements and locators in a document: what classes do not determine.

An archive differs from a JSON model in three ways: its faces are triangles, its meshes are next to the document, and it states
all defaults.
"""

import math
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from tolcontact.declaration.checks import NOT_NEGATIVE, POSITIVE, text_type
from tolcontact.declaration.codec import CODECS, Choice, Document, Items, Place, Plain, Writing, floats
from tolcontact.declaration.feature_tolerance import KINDS, GeometricTolerance
from tolcontact.declaration.geometry import Box, Elastic, Mesh, Pin
from tolcontact.declaration.locator import USUAL_STIFFNESS, Locator, ThreeTwoOne
from tolcontact.declaration.measurement import MEASUREMENTS, Chain, Combination, Measurement
from tolcontact.declaration.part import DatumTargets, Face, Feature, Part, Pattern, Point
from tolcontact.declaration.record import Field, Record
from tolcontact.declaration.selection import FACE_GROUPS, Brep, Cylinder, Facing, Inside, Largest, Near, Picked, Triangles
from tolcontact.declaration.size import Form, Size
from tolcontact.declaration.tolerance import SHAPES, Tolerance, scipy_distribution
from tolcontact.declaration.values import DIRECTIONS, Vector, direction

UNIT_TOLERANCE = 1e-12  # of the length of a direction
MAX_INDEX = 2**31 - 1  # of triangles, points, faces
INDEX = Annotated[int, Meta(extra_json_schema={"minimum": 0, "maximum": MAX_INDEX})]
FILE_PATH = Annotated[str, Meta(description="path, from the folder of this file")]


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


def _is_axis(criterion: Any, writing: Any = None) -> bool:
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
        {"cylinder": Record(Cylinder, omitted="radius inner")}, lambda cylinder, writing: {"cylinder": cylinder},
        lambda values, place: values, is_required=True,
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


def _measurement(cls: Any) -> Record:
    """Return the record of a kind of measurement: its faces and points, and its directions if it has any."""
    if issubclass(cls, Combination):
        return Record(cls, kind=cls.kind, fields="measurements", build=lambda measurements: cls(*measurements))
    if cls is Chain:
        return Record(cls, kind=cls.kind, omitted="nominal units", floats="sensitivities nominal")
    return Record(cls, kind=cls.kind, omitted="across along about", across=UNIT_VECTOR, along=UNIT_VECTOR, about=UNIT_VECTOR)


KIND = f"a measurement whose kind is one of {', '.join(MEASUREMENTS)}"
MEASUREMENT_RECORDS = tuple(map(_measurement, MEASUREMENTS.values()))
CODECS[str | Measurement] = Choice("Operand", f"the name of a measurement, or {KIND}", *MEASUREMENT_RECORDS, Plain(str))
MEASURED = Choice("Measured", f"a point, or {KIND}", *MEASUREMENT_RECORDS, CODECS[Point])


def _distribution_values(thing: Any, writing: Writing) -> Document:
    if isinstance(thing.distribution, str):
        return {"distribution": thing.distribution}
    frozen = thing.distribution
    return {"scipy": frozen.dist.name, "args": tuple(frozen.args), "kwds": frozen.kwds}


def _distribution(values: Document, place: Place) -> Document:
    """Return the name of a distribution, or a frozen distribution of scipy.stats."""
    if "scipy" not in values:
        for key in {"args", "kwds"} & set(values):
            raise place[key].error('it goes with "scipy"; leave it out')
        return values
    if "distribution" in values:
        raise place["distribution"].error('it is given together with "scipy"; leave one of them out')
    name, family = values["scipy"], scipy_distribution(values["scipy"])
    if family is None:
        raise place["scipy"].mismatch("a continuous distribution of scipy.stats", name)
    try:
        return {"distribution": family(*values.get("args", ()), **values.get("kwds", {}))}
    except (TypeError, ValueError) as error:  # unknown parameters
        raise place.error(f"scipy.stats.{name}: {error}") from error


DISTRIBUTION = Field({
    "distribution": Plain(text_type(SHAPES)), "scipy": Plain(str), "args": Plain(tuple[float, ...], floats),
    "kwds": Plain(Mapping[str, float], floats),
}, _distribution_values, _distribution)  # fmt: skip
CODECS[Tolerance] = Choice(
    "Tolerance",
    "a width in mm, a text such as '±0.1', or named values",
    Record(
        Tolerance, name="Zone", omitted="range shift cp cpk side parts", floats="shift cpk", range=Plain(NOT_NEGATIVE | str),
        distribution=DISTRIBUTION, cp=Plain(POSITIVE, floats),
    ),
    Plain(NOT_NEGATIVE | str, read=lambda width, place: place.checked(Tolerance(width))),
)  # fmt: skip
CODECS[Form] = Record(Form, omitted="covariance length modes lobes measured")
TOLERANCE_FIELDS = [member.name for member in fields(GeometricTolerance) if member.name != "of"]
CONTROL = CODECS[Size | GeometricTolerance] = Choice(
    "FeatureTolerance",
    f"kind: one of {', '.join(['size', *KINDS])}",
    Record(
        Size, kind="size", omitted="tolerance_class envelope side parts",
        nominal=Plain(POSITIVE), upper=Plain(float | str), distribution=DISTRIBUTION,
    ),
    *(
        Record(
            GeometricTolerance, kind=kind.kind, name=kind.name, build=kind, fields=" ".join(TOLERANCE_FIELDS),
            omitted=" ".join(TOLERANCE_FIELDS[1:]), width=Plain(NOT_NEGATIVE), along=FREE_DIRECTION,
        )
        for kind in KINDS.values()
    ),
)  # fmt: skip
MEMBER = Choice("Member", "a list of faces, or the name of a feature", Items(CODECS[Face]), CODECS[Feature])
TARGETS = Record(
    DatumTargets, fields="letter points declared_at", keys={"letter": "datum", "points": "targets"}, name="DatumTargets"
)
TOLERANCED = Choice(
    "Toleranced",
    "a feature, or a pattern with members",
    Record(Pattern, mark="members", fields="constituents tolerances name datum declared_at", constituents=Items(MEMBER)),
    Record(Feature, fields="faces tolerances name datum association declared_at", omitted="association"),
)


def _mesh_source(values: Document, place: Place) -> Document:
    """Return the mesh that an archive has next to the document, by the name of its part."""
    if place.record.name not in place.sources.meshes:
        raise place["mesh"].error("expected that of a part with a mesh, or with a box")
    return {"source": place.sources.meshes[place.record.name]}


def _file_name(source: Any, writing: Writing) -> str:
    path, folder = Path(source).resolve(), writing.folder or Path()
    return (path.relative_to(folder) if path.is_relative_to(folder) else path).as_posix()


def _file(name: str, place: Place) -> Path:
    if place.sources.folder is None:
        raise place.error("an archive names no files; expected that of a part with a mesh, or with a box")
    return place.sources.folder / name


SHAPE = Choice(
    "Shape",
    "a box, a pin, or a file",
    Record(Box, mark="box", marked=3),
    Record(Pin, mark="pin", marked=2, omitted="head"),
    Record(
        Mesh, mark="mesh", name="ArchivedMesh", fields="source", when=lambda mesh, writing: writing.folder is None,
        source=Field({"mesh": Plain(str)}, lambda mesh, writing: {"mesh": str(mesh)}, _mesh_source, is_required=True),
    ),
    Record(Mesh, mark="file", omitted="units body chord", source=Plain(FILE_PATH, _file_name, _file)),
)  # fmt: skip
MATRIX_FILE = Plain(  # archives have the path as it was stated
    FILE_PATH,
    lambda source, writing: str(source) if writing.folder is None else _file_name(source, writing),
    lambda name, place: Path(name) if place.sources.folder is None else _file(name, place),
)
ELASTIC = Record(
    Elastic, omitted="E nu density stiffness nodes pad element_size", floats="E nu density pad element_size",
    stiffness=MATRIX_FILE, nodes=MATRIX_FILE,
)  # fmt: skip
# Their faces may refer to all parts: a document is read for them once it has all parts.
OF_PART = Field(
    {"features": Items(TOLERANCED), "datum_targets": Items(TARGETS), "elastic": Items(ELASTIC)},
    lambda part, writing: {
        "features": part.toleranced,
        **({"datum_targets": part.targets} if part.targets else {}),
        **({"elastic": [part.elasticity]} if part.elasticity else {}),
    },
)


def _stiffness_values(locator: Locator, writing: Writing) -> Document:
    """Return the stiffness, by default the usual one: a compliant support, and a declared usual one, have a mark."""
    if locator.stiffness is None:
        return {"stiffness": USUAL_STIFFNESS}
    mark = {"springy": True} if locator.one_sided or locator.stiffness == USUAL_STIFFNESS else {}
    return {"stiffness": float(locator.stiffness), **mark}


def _stiffness(values: Document, place: Place) -> Document:
    """Return a declared stiffness; None for the usual one without a mark."""
    stiffness = values.get("stiffness", USUAL_STIFFNESS)
    return {"stiffness": stiffness if values.get("springy") or stiffness != USUAL_STIFFNESS else None}


LOCATOR = Record(
    Locator, fields="name point direction one_sided stiffness tolerance part on", omitted="part on", direction=UNIT_VECTOR,
    stiffness=Field({"stiffness": Plain(POSITIVE), "springy": Plain(bool)}, _stiffness_values, _stiffness),
)  # fmt: skip
SCHEME = Choice(
    "Scheme",
    "a list of locators, or a 3-2-1 scheme",
    Items(LOCATOR),
    Record(ThreeTwoOne, mark="three_two_one", marked=3, floats="inset"),
)
