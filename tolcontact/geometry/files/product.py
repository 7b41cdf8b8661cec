"""The product in a STEP file: shapes, moved onto the surfaces that it states, and bodies in their places. Lengths in mm."""

import json
import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from tolcontact.declaration.geometry import UNITS
from tolcontact.errors import GeometryFault
from tolcontact.geometry.analytic_surfaces import AnalyticSurface
from tolcontact.geometry.edges import rim
from tolcontact.geometry.files.bodies import Body, ShapePlace, StepMesh, bodies, listed
from tolcontact.geometry.files.step_surfaces import credible, onto, stated_surfaces
from tolcontact.geometry.files.step_text import StepText

STEP_CHORD, STEP_ANGLE = 0.002, 0.1  # largest distance [mm] and angle [rad] between triangles and true faces of a STEP file
STEP_SHARE = 5e-6  # the chord of files larger than 0.4 m, as a share of their extent
MAX_COORDINATE = 1e7  # [mm]; single precision resolves only whole millimetres there
STRETCH_TOLERANCE = 1e-5  # relative, for a rigid motion that passed through single precision
MAX_OFFSET = 3.0  # in chords: vertices at a larger distance from the surface of their B-rep face are not moved onto it
BREP = "brep_index"  # face attribute of a mesh: the B-rep face of each triangle
SURFACES = "surfaces"  # in its metadata: the surface of each B-rep face, None if the file states none
FACE_NAMES = "face_names"  # in its metadata: the name of each B-rep face; empty if the file names none

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Product:
    """All shapes in one mesh, each in its own frame, and the bodies in their places.

    shape, brep   (face,) the shape of each triangle, and the B-rep face within the shape
    surfaces      (shape,) lists of the surfaces of B-rep faces, None for an unknown one
    """

    path: Path
    mesh: trimesh.Trimesh
    shape: np.ndarray
    brep: np.ndarray
    surfaces: tuple[list[AnalyticSurface | None], ...]
    bodies: tuple[Body, ...]
    text: StepText

    def body(self, selector: str | int | None) -> Body:
        """Return the body with a name or a number from 1; with None, the only body.

        Raises GeometryFault if no body matches, or more than one.
        """
        if selector is None:
            if len(self.bodies) > 1:
                raise GeometryFault(
                    f'"{self.path}" holds {len(self.bodies)} bodies, but a part is one body; name one, '
                    'tc.Mesh(..., body="..."), '
                    f"or declare all with tc.parts_from: {listed(self.bodies)}"
                )
            return self.bodies[0]
        number = (
            selector - 1
            if isinstance(selector, int)
            else next((k for k, b in enumerate(self.bodies) if b.name == selector), -1)
        )
        if not 0 <= number < len(self.bodies):
            raise GeometryFault(f'"{self.path}" holds no body {selector!r}; it holds {len(self.bodies)}: {listed(self.bodies)}')
        if not len(self.bodies[number].triangles):
            raise GeometryFault(
                f'"{self.path}": the triangles of body {selector!r} cannot be told from others; export it alone'
            )
        return self.bodies[number]

    def part(self, selector: str | int | None) -> trimesh.Trimesh:
        """Return the mesh of a body: in its own frame if it is selected, in its place if `selector` is None.

        The mesh carries BREP, whose numbers start from 0 in the file's order, SURFACES and FACE_NAMES.
        """
        body = self.body(selector)
        triangles = body.triangles
        corners, faces = np.unique(self.mesh.faces[triangles], return_inverse=True)
        vertices = np.asarray(self.mesh.vertices)[corners]
        numbers, brep = np.unique(self.brep[triangles], return_inverse=True)
        stated = self.surfaces[int(self.shape[triangles[0]])]
        surfaces = [stated[number] if number < len(stated) else None for number in numbers]
        if selector is None and not np.array_equal(body.place, np.eye(4)):
            vertices = vertices @ body.place[:3, :3].T + body.place[:3, 3]
            surfaces = [
                None if surface is None else surface.placed(body.place[:3, :3], body.place[:3, 3]) for surface in surfaces
            ]
        mesh = trimesh.Trimesh(vertices, faces.reshape(-1, 3), process=False)
        mesh.units = "mm"
        mesh.face_attributes[BREP] = brep.ravel()
        mesh.metadata[SURFACES] = surfaces
        mesh.metadata[FACE_NAMES] = body.face_names if any(body.face_names) else ()
        self._check_closed(mesh, brep)
        return mesh

    def _check_closed(self, mesh: trimesh.Trimesh, brep: np.ndarray) -> None:
        gaps = len(rim(mesh.faces)) if self.text.solids and len(self.bodies) == 1 else 0
        if gaps:
            raise GeometryFault(
                f'"{self.path}" holds a solid whose faces do not close ({gaps} edges have a triangle on one side only; '
                f"{len(np.unique(brep))} of {len(self.text.solids[0].faces)} faces could be read); repair it in CAD, or "
                "export it again"
            )


def product(path: Path, arrays: Mapping[str, np.ndarray], text: StepText) -> Product:
    """Return the product in a STEP file, in double precision, from the `arrays` of `worker` and the file's text.

    Raises GeometryFault if the file holds no surfaces, or coordinates are not finite or too large.
    """
    if not len(arrays["faces"]):
        raise GeometryFault(f'"{path}" holds no surfaces that could be read; export the part itself as a solid')
    mesh = trimesh.Trimesh(arrays["vertices"], arrays["faces"], process=False)
    mesh.apply_scale(UNITS["m"])
    check_numbers(mesh.vertices, f'"{path}"')
    mesh.vertices = _rounded(np.asarray(mesh.vertices))
    shape_of_vertex = np.zeros(len(mesh.vertices), dtype=np.int64)
    shape_of_vertex[np.asarray(mesh.faces).ravel()] = np.repeat(arrays["piece"], 3)
    mesh = _merge_vertices(mesh, shape_of_vertex)
    proper = _proper_triangles(path, mesh.faces)
    mesh.update_faces(proper)
    shape, brep = arrays["piece"][proper], arrays["brep"][proper]
    vertices, max_distance = np.array(mesh.vertices), MAX_OFFSET * float(arrays["chord"])
    surfaces: list[list[AnalyticSurface | None]] = []
    for k, stated in enumerate(arrays["surfaces"]):
        triangles = np.flatnonzero(shape == k)
        corners, faces = np.unique(mesh.faces[triangles], return_inverse=True)
        faces, face_numbers = faces.reshape(-1, 3), brep[triangles]
        surfaces.append(credible(vertices[corners], faces, face_numbers, stated_surfaces(str(stated)), max_distance))
        vertices[corners] = onto(vertices[corners], faces, face_numbers, surfaces[-1], max_distance)
    mesh = trimesh.Trimesh(vertices, mesh.faces, process=False)
    places = [
        ShapePlace(int(number), rigid_motion(path, transform), tuple(json.loads(str(names))))
        for number, transform, names in zip(arrays["shape"], arrays["transforms"], arrays["paths"], strict=True)
    ]
    step_mesh = StepMesh(
        np.asarray(mesh.triangles), np.asarray(mesh.faces), shape, brep, arrays["products"], arrays["coloured"],
        surfaces, text.unit,
    )  # fmt: skip
    return Product(path, mesh, shape, brep, tuple(surfaces), tuple(bodies(step_mesh, places, text.solids)), text)


def _proper_triangles(path: Path, faces: np.ndarray) -> np.ndarray:
    """Return indices of triangles (face, 3), without repeated ones and without those that have two corners in one place.

    Repeated triangles come from a face that stands twice in its shell. Corners fall together at the ends of an edge that is
    shorter than coordinates resolve.
    """
    proper = np.flatnonzero((faces != np.roll(faces, 1, axis=1)).all(axis=1))
    lowest = np.argmin(faces[proper], axis=1)
    turned = np.take_along_axis(faces[proper], (lowest[:, None] + np.arange(3)) % 3, axis=1)
    unique, _ = trimesh.grouping.unique_rows(turned)
    for count, kind in ((len(faces) - len(proper), "on edges of no length"), (len(proper) - len(unique), "that stand twice")):
        if count:
            log.info('"%s": %d triangles %s are left out', path, count, kind)
    return proper[np.sort(unique)]


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


def _rounded(vertices: np.ndarray) -> np.ndarray:
    """Return vertices [mm] that passed through single precision, rounded to its resolution: round lengths come back."""
    resolution = UNITS["m"] * float(np.spacing(np.float32(np.abs(vertices).max(initial=0) / UNITS["m"])))
    power = 10.0 ** math.floor(math.log10(resolution))
    step = power * next(digit for digit in (1, 2, 5, 10) if digit * power >= resolution)
    return np.round(np.round(vertices / step) * step, 12)


def _merge_vertices(mesh: trimesh.Trimesh, shape: np.ndarray) -> trimesh.Trimesh:
    """Return a mesh without repeated vertices; vertices in one place stay apart if their `shape` (vertex,) differs."""
    _, representative, number = np.unique(
        np.column_stack([shape, np.asarray(mesh.vertices)]), axis=0, return_index=True, return_inverse=True
    )
    return trimesh.Trimesh(np.asarray(mesh.vertices)[representative], number.ravel()[np.asarray(mesh.faces)], process=False)


def rigid_motion(path: Path, transform: np.ndarray) -> np.ndarray:
    """Return a rigid motion (4, 4) [mm] from a transform [m] that passed through single precision.

    Its rotation is orthogonal again, and its translation is rounded. Raises GeometryFault if the transform mirrors or scales.
    """
    place = np.eye(4)
    U, scales, V = np.linalg.svd(transform[:3, :3])
    if np.abs(scales - 1).max() > STRETCH_TOLERANCE or np.linalg.det(transform[:3, :3]) < 0:
        raise GeometryFault(
            f'"{path}" places a body mirrored or scaled, which bodies of a rigid assembly are not; export it as it is'
        )
    place[:3, :3] = U @ V
    place[:3, 3] = _rounded(UNITS["m"] * transform[:3, 3]) if transform[:3, 3].any() else 0.0
    return place
