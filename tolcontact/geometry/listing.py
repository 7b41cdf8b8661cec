"""Listings before a run: bodies and faces of a STEP file, its bodies as parts, and previews of parts. Lengths in mm."""

import logging
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from tolcontact.declaration import Assembly, Mesh, Part
from tolcontact.declaration.geometry import STEP
from tolcontact.declaration.selection import FACE_ANGLE, FACE_GROUPS
from tolcontact.declaration.values import Vector
from tolcontact.errors import GeometryFault, ModelError, OptionError, nearest_name
from tolcontact.geometry.brep_face import describe_faces, number_faces, plain_vector
from tolcontact.geometry.face_groups import GENERAL, FaceInFile
from tolcontact.geometry.files import BREP, STATED_FACES, key_of, read_files
from tolcontact.geometry.files.product import MAX_LISTED, Product
from tolcontact.geometry.shapes import placement_of, shape
from tolcontact.geometry.tolerances import SAME_DIRECTION, SAME_PLACE
from tolcontact.geometry.triangle_mesh import placed_mesh
from tolcontact.readable import Readable
from tolcontact.shape_worker import UnfinishedRead
from tolcontact.texts import CONTROL_CHARACTERS, shown, shown_name

LISTING_CHORD = 0.5  # [mm] of triangles that only show which faces exist and which of them touch

log = logging.getLogger(__name__)


@dataclass(frozen=True, repr=False)
class BodyInFile(Readable):
    """A body of a STEP file.

    number, name   from 1 in the file's order; a name that is unique in the file
    path           names of the products that contain the body, starting at the root
    lower, upper   corners of the box around the body in its pose [mm]
    at, rotation   pose of its own frame, as for a Part [mm, rad]
    faces          number of its B-rep faces
    is_open        whether its faces do not form a closed body
    units          units of length in the file, as named there; empty if it states none. All lengths here are in mm
    """

    number: int
    name: str
    path: tuple[str, ...]
    lower: Vector
    upper: Vector
    at: Vector
    rotation: Vector
    faces: int
    is_open: bool
    units: str

    def __str__(self) -> str:
        title = f"{self.number}. {shown_name(self.name) or 'without a name'}"
        size = " x ".join(f"{up - low:.4g}" for low, up in zip(self.lower, self.upper, strict=True))
        return f"{title}: {'open, ' if self.is_open else ''}{size} mm, {self.faces} faces"


def bodies_in(path: str | Path) -> tuple[BodyInFile, ...]:
    """Return the bodies of the STEP file at a `path`, in its order, as in `tc.io.bodies_in("parts.stp")`.

    Raises OptionError if it cannot be read.
    """
    return _bodies(_listed_product(path))


def faces_in(path: str | Path, body: str | int | None = None) -> tuple[FaceInFile, ...]:
    """Return the B-rep faces of a body of the STEP file at a `path`, as in `tc.io.faces_in("parts.stp", "bolt")`.

    The `body` is a name or a number from 1, and may be left out if there is only one.
    Raises OptionError if the file cannot be read, or has no such body.
    """
    mesh = _part(_listed_product(path), body)
    faces = describe_faces(mesh)
    is_fitted = any(
        stated.surface is None and face.kind != GENERAL for stated, face in zip(mesh.metadata[STATED_FACES], faces, strict=True)
    )
    # A surface that does not fit a few vertices does not fit many; a surface that does may still fail for many.
    return describe_faces(_part(_product(path), body)) if is_fitted else faces


@dataclass(frozen=True, repr=False)
class RecordedFace(Readable):
    """A B-rep face by its `number` and `name` in a body, and the numbers of the `bodies` that have it, one per occurrence.

    kind   of its surface; empty if the shape of the body was not examined
    """

    number: int
    name: str
    bodies: tuple[int, ...]
    kind: str = ""

    def __str__(self) -> str:
        return f"{self.number}" if self.bodies == (1,) else f"{self.number} of body {', '.join(map(str, self.bodies))}"


FacesOfRecords = Mapping[int, RecordedFace]


def faces_of_records(path: str | Path) -> dict[int, RecordedFace]:
    """Return the B-rep faces of a STEP file that states PMI, by the numbers of their records in the file's text.

    Raises OptionError if the file cannot be read.
    """
    recorded_faces: dict[int, RecordedFace] = {}
    for number, body in enumerate(_listed_product(path).bodies, start=1):
        for face_number, face in enumerate(body.shape.faces, start=1):
            for record in face.records:
                bodies = (*(recorded_faces[record].bodies if record in recorded_faces else ()), number)
                recorded_faces[record] = RecordedFace(face_number, face.name, bodies)
    return recorded_faces


class PartsOfFile(dict[str, Part]):
    """The parts of a STEP file by their names."""

    def __missing__(self, name: str) -> Part:
        listed, nearest = _first(list(self)), nearest_name(str(name), self)
        raise OptionError(f'no part "{shown(str(name))}" is declared of the file; its parts are: {listed}{nearest}')


def parts_from(
    model: Assembly,
    path: str | Path,
    names: Sequence[str] | None = None,
    *,
    fixed: bool | Sequence[str] | None = None,
    chord: float | None = None,
) -> "PartsOfFile":
    """Declare bodies of the STEP file at a `path` as parts of a `model`, each in its pose, and return the parts by their names.

    `parts = tc.io.parts_from(model, "gearbox.stp", fixed=["housing"])`

    All bodies are declared, or only the bodies in `names`. A part has the name of its body in the file, without the characters
    that are not permitted in part names; where a name repeats, the second body is "name (2)" and so on. The part's own frame is
    the frame of its product, which is the same for all occurrences of the product. `fixed` is as for a Part and applies to all
    parts, or it lists the fixed bodies, as in fixed=["plate"]. `chord` [mm] is as for a Mesh.
    Raises ModelError if the file cannot be read, or has no body of a name; TypeError if `names` or `fixed` is one text.
    """
    if not isinstance(model, Assembly):
        raise TypeError(f'model is a {type(model).__name__}; expected an assembly, as in tc.io.parts_from(model, "file.stp")')
    selected_names = None if names is None else _names("names", names)
    fixed_names = [] if fixed is None or isinstance(fixed, bool) else _names("fixed", fixed)
    try:
        bodies = _bodies(_product(path, chord))  # with the triangles that the parts will have
    except OptionError as error:
        raise ModelError(model.name, [str(error)]) from error
    by_name = {body.name: body for body in bodies}
    if missing := [name for name in (*(selected_names or ()), *fixed_names) if name not in by_name]:
        listed = _first([body.name for body in bodies])
        faults = [f'"{path}" holds no body "{name}"; it holds {listed}{nearest_name(name, by_name)}' for name in missing]
        raise ModelError(model.name, faults)
    declared = bodies if selected_names is None else [by_name[name] for name in selected_names]
    if undeclared := [name for name in fixed_names if by_name[name] not in declared]:
        raise ModelError(
            model.name, [f'fixed has the body "{name}", which is not in names; add it there' for name in undeclared]
        )
    parts = PartsOfFile()
    for body in declared:
        is_fixed = fixed if isinstance(fixed, bool) else body.name in fixed_names or None
        mesh = Mesh(path, body=body.number, chord=chord)
        part = model.part(part_name(body), mesh, at=body.at, rotation=body.rotation, fixed=is_fixed)
        parts[part.name] = part
    return parts


def _first(names: Sequence[str]) -> str:
    """Return the first names of a list for a message."""
    return ", ".join(f'"{shown_name(name)}"' for name in names[:MAX_LISTED]) + (", ..." if len(names) > MAX_LISTED else "")


def _names(option: str, value: Any) -> list[str]:
    """Return the names of bodies that an option lists. Raises TypeError for anything except a list of texts."""
    is_list = isinstance(value, Iterable) and not isinstance(value, str | Mapping)
    names = list(value) if is_list else []
    if not is_list or not all(isinstance(name, str) for name in names):
        example = value if isinstance(value, str) else "plate"
        raise TypeError(f'{option} is {value!r}; expected a list of the names of bodies, as in {option}=["{example}"]')
    return names


def part_name(body: BodyInFile) -> str:
    """Return the name of a body without the characters that are not permitted in part names."""
    name = re.sub(r"[/\t\n]", "_", CONTROL_CHARACTERS.sub("_", body.name)).strip()
    return name if re.match(r"\w", name) else f"body {body.number} {name}".strip()


def _listed_product(path: str | Path) -> Product:
    """Return a product for listing its bodies and faces, with a coarse triangulation if that is enough."""
    try:
        product = _product(path, LISTING_CHORD if Mesh(path).is_step else None)
    except OptionError as error:
        if not isinstance(error.__cause__, UnfinishedRead):
            raise
        product = _product(path)  # the chord of a very large file is coarser
    if product.missing_faces:
        product = _product(path)
    if product.missing_faces:
        log.warning(
            '"%s": %d of %d faces cannot be chosen, since the CAD kernel makes no triangles of them',
            path, product.missing_faces, product.face_count,
        )  # fmt: skip
    return product


def _part(product: Product, body: str | int | None) -> trimesh.Trimesh:
    try:
        return product.part(body)
    except GeometryFault as fault:
        raise OptionError(str(fault)) from fault


def _product(path: str | Path, chord: float | None = None) -> Product:
    geometry = Mesh(path, chord=chord if Path(path).suffix.lower() in STEP else None)
    for fault in geometry.faults():
        raise OptionError(fault)
    content = read_files([geometry])[key_of(geometry)]
    if isinstance(content, GeometryFault):
        raise OptionError(str(content)) from content
    if not isinstance(content, Product):
        raise OptionError(f'"{path}" is not a STEP file; only these hold bodies and faces that have numbers')
    return content


def _bodies(product: Product) -> tuple[BodyInFile, ...]:
    bodies, units = [], shown(product.units)
    for number, body in enumerate(product.bodies, start=1):
        rotation = Rotation.from_matrix(body.place[:3, :3]).as_rotvec()
        lower, upper, at, turn = map(plain_vector, (*body.box, body.place[:3, 3], rotation))
        bodies.append(
            BodyInFile(number, body.name, body.path, lower, upper, at, turn, len(body.shape.faces), body.is_open, units)
        )
    return tuple(bodies)


class PartPreview(NamedTuple):
    """The triangles of a part in the nominal assembly: vertices (vertex, 3) [mm] and faces (triangle, 3).

    mesh          the same triangles in the part's own frame
    rotation      (3, 3) of the part, with the determinant -1 for a mirror image
    face_of       (triangle,) face indices: of the B-rep faces of a STEP file, or of smooth pieces
    descriptions  of the faces
    snippets      Python code that selects each face
    groups        Python code that selects the slot and the hole pattern of each face
    """

    mesh: trimesh.Trimesh
    rotation: np.ndarray
    vertices: np.ndarray
    faces: np.ndarray
    face_of: np.ndarray
    descriptions: tuple[FaceInFile, ...]
    snippets: tuple[str, ...]
    groups: tuple[tuple[str, ...], ...]


def preview(part: Part) -> PartPreview | None:
    """Return the preview of a part, None if its shape or its pose is invalid."""
    if any(part.faults()):
        return None
    try:
        mesh = shape(part.geometry)
    except GeometryFault:
        return None
    R, t = placement_of(part)
    placed = placed_mesh(mesh.vertices, mesh.faces, R, t)
    face_of, _ = number_faces(mesh)
    faces = describe_faces(mesh)
    snippets = tuple(_snippet(mesh, face_of, face) for face in faces)
    groups = tuple(
        tuple(_brep_snippet(face, f'whole="{word}"') for word in FACE_GROUPS if getattr(face, word)) for face in faces
    )
    return PartPreview(mesh, R, np.asarray(placed.vertices), np.asarray(placed.faces), face_of, faces, snippets, groups)


def _snippet(mesh: trimesh.Trimesh, face_of: np.ndarray, face: FaceInFile) -> str:
    if BREP in mesh.face_attributes:
        return _brep_snippet(face, "whole=True" if face.whole else "")
    if face.kind == "cylinder" and face.radius is not None:
        return f"face(tc.select.Cylinder(radius={face.radius:.6g}, inner={face.is_inner}))"
    mask = face_of == face.number - 1
    if face.kind == "plane" and face.direction is not None:
        normal = np.array(face.direction)
        axis = int(np.argmax(np.abs(normal)))
        is_axis = abs(normal[axis]) > 1 - SAME_DIRECTION
        direction = f'"{"+-"[int(normal[axis] < 0)]}{"xyz"[axis]}"' if is_axis else f"tc.select.Facing({_vector(normal)})"
        is_facing = np.asarray(mesh.face_normals) @ normal >= np.cos(FACE_ANGLE)
        return f"face({direction})" if (is_facing == mask).all() else f"face({direction}, {_box(mesh, mask)})"
    return f"face({_box(mesh, mask)})"


def _brep_snippet(face: FaceInFile, option: str) -> str:
    return f"face(tc.select.Brep({', '.join(filter(None, [_vector(np.array(face.point)), option]))}))"


def _box(mesh: trimesh.Trimesh, mask: np.ndarray) -> str:
    """Return code for the box, with a small margin, around the triangles of a mask (triangle,)."""
    corners, margin = np.asarray(mesh.vertices)[mesh.faces[mask]].reshape(-1, 3), SAME_PLACE * mesh.scale
    return f"tc.select.Inside({_vector(corners.min(axis=0) - margin)}, {_vector(corners.max(axis=0) + margin)})"


def _vector(x: np.ndarray) -> str:
    return "({:.7g}, {:.7g}, {:.7g})".format(*(np.round(x, 6) + 0.0))
