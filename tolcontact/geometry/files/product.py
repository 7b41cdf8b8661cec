"""The product in a STEP file: its bodies in their poses. A part is one body. Lengths in mm."""

import logging
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from tolcontact.errors import GeometryFault, nearest_name
from tolcontact.geometry.files.step_shapes import MIRROR, StepShape, rounded, step_shape
from tolcontact.geometry.files.step_text import StepText
from tolcontact.texts import clipped

STEP_CHORD, STEP_ANGLE = 0.002, 0.1  # largest distance [mm] and angle [rad] between triangles and true faces of a STEP file
STEP_SHARE = 5e-6  # the chord of files larger than 0.4 m, as a share of their extent
MAX_LISTED = 12  # bodies that a message lists
MAX_COORDINATE = 1e7  # [mm]
MERGE_DISTANCE = 1e-7  # [mm], beyond 1 mm from the origin a share: vertices of a shape that are closer are one
STRETCH_TOLERANCE = 1e-6  # relative, for a rigid motion
MAX_OFFSET = 3.0  # in chords: vertices at a larger distance from the surface of their B-rep face are not moved onto it
BREP = "brep_index"  # face attribute of a mesh: the B-rep face of each triangle
STATED_FACES = "stated_faces"  # in its metadata: each B-rep face as the file states it
FROM_PRODUCT = "from_product"  # and R (3, 3) and t (3,) [mm] from the frame of its product, which PMI refers to; R may mirror

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Body:
    """A body in its place.

    name          a name that no other body of the file has; "" if the file states none
    path          names of the products that contain the body, from the root on
    place         (4, 4): from its own frame to the frame of the file [mm]
    mirror        (3, 3): from the frame of its product to its own; x is reversed if the file places the product mirrored
    box           (2, 3) lower and upper corner of the box around the body in its place
    is_open       whether its triangles do not close
    """

    name: str
    path: tuple[str, ...]
    place: np.ndarray
    mirror: np.ndarray
    box: np.ndarray
    is_open: bool
    shape: StepShape

    def __str__(self) -> str:
        title = ("open, " if self.is_open else "") + (f'"{clipped(self.name, 60)}"' if self.name else "without a name")
        size = " x ".join(f"{length:.4g}" for length in self.box[1] - self.box[0])
        return f"{title}, {size} mm at ({', '.join(f'{x:.4g}' for x in self.box.sum(axis=0) / 2)})"


def uniquely_named(bodies: Sequence[Body]) -> Iterator[Body]:
    """Yield the bodies with different names: repeated names are numbered in the file's order."""
    names = {body.name for body in bodies}
    used: set[str] = set()
    for body in bodies:
        name, number = body.name, 1
        while name and (name in used or (number > 1 and name in names)):
            number += 1
            name = f"{body.name} ({number})"
        used.add(name)
        yield replace(body, name=name)


def listed(bodies: Sequence[Body]) -> str:
    """Return a list of bodies for a message: numbers, names, sizes and places."""
    entries = "; ".join(f"{number}. {body}" for number, body in enumerate(bodies[:MAX_LISTED], start=1))
    return entries + (f"; and {len(bodies) - MAX_LISTED} more (see tolcontact bodies)" if len(bodies) > MAX_LISTED else "")


@dataclass(frozen=True, eq=False)
class Product:
    """The shapes that are bodies somewhere, and the bodies in their places.

    face_count   number of B-rep faces of all shapes, copies included
    units        of lengths of shapes, as the file names them; empty if it states none
    """

    path: Path
    shapes: tuple[StepShape, ...]
    bodies: tuple[Body, ...]
    face_count: int
    units: str

    @property
    def missing_faces(self) -> int:
        """The number of B-rep faces without triangles that are no copies of others."""
        return sum(len(shape.faces) - len(np.unique(shape.brep)) for shape in self.shapes)

    def body(self, selector: str | int | None) -> Body:
        """Return the body with a name or a number from 1; with None, the only body.

        Raises GeometryFault if no body matches, or more than one.
        """
        if selector is None:
            if len(self.bodies) > 1:
                raise GeometryFault(
                    f'"{self.path}" holds {len(self.bodies)} bodies, but a part is one body; name one, '
                    'tc.Mesh(..., body="...") or --body "...", '
                    f"or declare all with tc.io.parts_from: {listed(self.bodies)}"
                )
            return self.bodies[0]
        number = (
            selector - 1
            if isinstance(selector, int)
            else next((k for k, b in enumerate(self.bodies) if b.name == selector), -1)
        )
        if not 0 <= number < len(self.bodies):
            nearest = nearest_name(selector, [body.name for body in self.bodies]) if isinstance(selector, str) else ""
            bodies = f"{len(self.bodies)}: {listed(self.bodies)}{nearest}"
            raise GeometryFault(f'"{self.path}" holds no body {selector!r}; it holds {bodies}')
        return self.bodies[number]

    def part(self, selector: str | int | None) -> trimesh.Trimesh:
        """Return the mesh of a body: in its own frame if it is selected, in its place if `selector` is None.

        The mesh has BREP, whose indices follow the file's order, STATED_FACES, and FROM_PRODUCT.
        """
        body = self.body(selector)
        shape = body.shape
        vertices, faces, from_product = np.array(shape.vertices), shape.faces, (body.mirror, np.zeros(3))
        if selector is None and not np.array_equal(body.place, np.eye(4)):
            R, t = body.place[:3, :3], body.place[:3, 3]
            vertices = vertices @ R.T + t
            faces, from_product = tuple(face.placed(R, t) for face in faces), (R @ body.mirror, t)
        mesh = trimesh.Trimesh(vertices, np.array(shape.triangles), process=False)
        mesh.units = "mm"
        mesh.face_attributes[BREP] = np.array(shape.brep)
        mesh.metadata[STATED_FACES], mesh.metadata[FROM_PRODUCT] = faces, from_product
        if shape.face_count and len(self.bodies) == 1 and shape.gap_count:
            raise GeometryFault(
                f'"{self.path}" holds a solid whose faces do not close ({shape.gap_count} edges have a triangle on one side '
                f"only; {len(np.unique(shape.brep))} of {shape.face_count} faces could be read); repair it in CAD, or export "
                "it again"
            )
        return mesh


def product(path: Path, content: Mapping[str, Any], text: StepText, chord: float) -> Product:
    """Return the product in a STEP file from what the kernel reads at a `chord` [mm] (`kernel.step_document`), and the text.

    Raises GeometryFault if the file holds no surfaces, or coordinates are not finite or too large.
    """
    vertices = np.concatenate([np.zeros((0, 3)), *(entry["vertices"] for entry in content["shapes"])])
    check_numbers(vertices, f'"{path}"')
    merge_distance = MERGE_DISTANCE * max(1.0, float(np.abs(rounded(vertices)).max(initial=0)))
    max_offset = MAX_OFFSET * min(chord, usual_chord(text))  # vertices are on the true faces at any chord
    # The kernel counts records; if it counts others than the text has, their numbers are unknown.
    is_counted = content["record_count"] == len(text.order)
    numbers = np.array([0, *text.order]) if is_counted else np.zeros(content["record_count"] + 1, dtype=np.int64)
    omissions: Counter[str] = Counter()
    shapes = [step_shape(entry, numbers, merge_distance, max_offset, omissions) for entry in content["shapes"]]
    for kind, count in omissions.items():
        log.info('"%s": %d triangles %s are left out', path, count, kind)
    if not any(len(shape.triangles) for shape in shapes):
        raise GeometryFault(f'"{path}" holds no surfaces that could be read; export the part itself as a solid')
    entries = [entry for entry in content["bodies"] if len(shapes[entry[0]].triangles)]
    bodies = [_body(path, entry, shapes[entry[0]], is_alone=len(entries) == 1) for entry in entries]
    face_count = sum(len(entry["surfaces"]) for entry in content["shapes"])
    drawn = tuple(shape for shape in shapes if len(shape.triangles))
    return Product(path, drawn, tuple(uniquely_named(bodies)), face_count, ", ".join(text.units))


def _body(path: Path, entry: Sequence[Any], shape: StepShape, *, is_alone: bool) -> Body:
    _, transform, box, names, name = entry
    mirror = MIRROR if np.linalg.det(transform[:3, :3]) < 0 else np.eye(3)
    place = rigid_motion(path, transform, mirror)
    # A solid that is alone in its file is no sheet, though faces may be missing.
    is_open = shape.gap_count > 0 and not (is_alone and shape.face_count)
    return Body(name, tuple(names), place, mirror, box, is_open, shape.mirrored if mirror is MIRROR else shape)


def usual_chord(text: StepText) -> float:
    """Return the largest distance [mm] between triangles and true faces of a STEP file for which no chord is required."""
    return max(STEP_CHORD, STEP_SHARE * text.extent * text.unit)


def check_numbers(vertices: np.ndarray, subject: str) -> None:
    """Raise GeometryFault if coordinates [mm] are not finite, or too large."""
    if not np.isfinite(vertices).all():
        raise GeometryFault(f"{subject} has vertices that are not finite; export it again")
    largest = float(np.abs(vertices).max(initial=0))
    if largest > MAX_COORDINATE:
        raise GeometryFault(
            f"{subject} reaches as far as {largest:.3g} mm, beyond the limit of {MAX_COORDINATE:g} mm; it is damaged, "
            "or in other units: export it again, or state its units"
        )


def rigid_motion(path: Path, transform: np.ndarray, mirror: np.ndarray) -> np.ndarray:
    """Return a transform (4, 4) [mm] after a `mirror` (3, 3) is undone, with a rotation that is orthogonal to the last digit.

    Raises GeometryFault if the transform scales.
    """
    place = np.eye(4)
    U, scales, V = np.linalg.svd(transform[:3, :3] @ mirror)
    if np.abs(scales - 1).max() > STRETCH_TOLERANCE:
        raise GeometryFault(f'"{path}" places a body scaled, which bodies of a rigid assembly are not; export it as it is')
    place[:3, :3] = U @ V
    place[:3, 3] = transform[:3, 3]
    return place
