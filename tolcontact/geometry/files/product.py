"""The product in a STEP file: shapes of bodies, moved onto the surfaces that it states, and bodies in their places.

Lengths in mm.
"""

import json
import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.spatial
import trimesh

from tolcontact.errors import GeometryFault, nearest_name
from tolcontact.geometry.analytic_surfaces import AnalyticSurface
from tolcontact.geometry.edges import distinct_triangles, rim
from tolcontact.geometry.files.bodies import Body, ShapePlace, StepShape, bodies, listed
from tolcontact.geometry.files.stated_face import first_faces, stated_faces
from tolcontact.geometry.files.step_surfaces import credible, onto, stated_surfaces
from tolcontact.geometry.files.step_text import StepText, record_numbers

STEP_CHORD, STEP_ANGLE = 0.002, 0.1  # largest distance [mm] and angle [rad] between triangles and true faces of a STEP file
STEP_SHARE = 5e-6  # the chord of files larger than 0.4 m, as a share of their extent
MAX_COORDINATE = 1e7  # [mm]
COORDINATE_DIGITS = 9  # of vertices after the point [mm]
MERGE_DISTANCE = 1e-7  # [mm], beyond 1 mm from the origin a share: vertices of a shape that are closer are one
STRETCH_TOLERANCE = 1e-6  # relative, for a rigid motion
MAX_OFFSET = 3.0  # in chords: vertices at a larger distance from the surface of their B-rep face are not moved onto it
BREP = "brep_index"  # face attribute of a mesh: the B-rep face of each triangle
SURFACES = "surfaces"  # in its metadata: the surface of each B-rep face, None if the file states none
FACE_NAMES = "face_names"  # in its metadata: the name of each B-rep face; empty if the file names none
STATED_FACES = "stated_faces"  # in its metadata: each B-rep face as the file states it

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
                    'tc.Mesh(..., body="...") or --body "...", '
                    f"or declare all with tc.parts_from: {listed(self.bodies)}"
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

    @property
    def missing_faces(self) -> int:
        """The number of B-rep faces without triangles that are no copies of others."""
        faces_of_shapes = {int(self.shape[body.triangles[0]]): body.faces for body in self.bodies}
        pairs = np.unique(np.column_stack([self.shape, self.brep]), axis=0)
        return sum(map(len, faces_of_shapes.values())) - len(pairs)

    def part(self, selector: str | int | None) -> trimesh.Trimesh:
        """Return the mesh of a body: in its own frame if it is selected, in its place if `selector` is None.

        The mesh carries BREP, whose numbers start from 0 in the file's order, SURFACES, FACE_NAMES and STATED_FACES.
        """
        body = self.body(selector)
        triangles = body.triangles
        corners, faces = np.unique(self.mesh.faces[triangles], return_inverse=True)
        vertices = np.asarray(self.mesh.vertices)[corners]
        brep = np.searchsorted([face.place for face in body.faces], self.brep[triangles])
        stated = self.surfaces[int(self.shape[triangles[0]])]
        surfaces, stated_faces = [stated[face.place] for face in body.faces], body.faces
        if selector is None and not np.array_equal(body.place, np.eye(4)):
            vertices = vertices @ body.place[:3, :3].T + body.place[:3, 3]
            surfaces = [
                None if surface is None else surface.placed(body.place[:3, :3], body.place[:3, 3]) for surface in surfaces
            ]
            stated_faces = tuple(face.placed(body.place[:3, :3], body.place[:3, 3]) for face in stated_faces)
        mesh = trimesh.Trimesh(vertices, faces.reshape(-1, 3), process=False)
        mesh.units = "mm"
        mesh.face_attributes[BREP] = brep
        mesh.metadata[SURFACES] = surfaces
        names = tuple(face.name for face in stated_faces)
        mesh.metadata[FACE_NAMES] = names if any(names) else ()
        mesh.metadata[STATED_FACES] = stated_faces
        self._check_closed(body, mesh)
        return mesh

    def _check_closed(self, body: Body, mesh: trimesh.Trimesh) -> None:
        gaps = len(rim(mesh.faces)) if body.face_count and len(self.bodies) == 1 else 0
        if gaps:
            raise GeometryFault(
                f'"{self.path}" holds a solid whose faces do not close ({gaps} edges have a triangle on one side only; '
                f"{len(np.unique(mesh.face_attributes[BREP]))} of {body.face_count} faces could be read); repair it in CAD, or "
                "export it again"
            )


def product(path: Path, arrays: Mapping[str, np.ndarray], text: StepText) -> Product:
    """Return the product in a STEP file from the `arrays` of `worker` and the file's text.

    Raises GeometryFault if the file holds no surfaces, or coordinates are not finite or too large.
    """
    check_numbers(arrays["vertices"], f'"{path}"')
    shape_of_vertex = np.zeros(len(arrays["vertices"]), dtype=np.int64)
    shape_of_vertex[arrays["faces"].ravel()] = np.repeat(arrays["piece"], 3)
    vertices, faces = _merge_vertices(arrays["vertices"], arrays["faces"], shape_of_vertex)
    proper, repeated = _proper_triangles(path, faces)
    owner = np.column_stack([arrays["piece"], arrays["brep"]])
    (shape, brep), faces = owner[proper].T, faces[proper]
    max_distance = MAX_OFFSET * min(float(arrays["chord"]), usual_chord(text))  # vertices are on the true faces at any chord
    if not len(faces):
        raise GeometryFault(f'"{path}" holds no surfaces that could be read; export the part itself as a solid')
    surfaces: list[list[AnalyticSurface | None]] = []
    for k, stated in enumerate(arrays["surfaces"]):
        triangles = np.flatnonzero(shape == k)
        corners, own_faces = np.unique(faces[triangles], return_inverse=True)
        own_faces, face_numbers = own_faces.reshape(-1, 3), brep[triangles]
        surfaces.append(credible(vertices[corners], own_faces, face_numbers, stated_surfaces(str(stated)), max_distance))
        vertices[corners] = onto(vertices[corners], own_faces, face_numbers, surfaces[-1], max_distance)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    has_triangles = np.isin(arrays["shape"], shape)
    places = [
        ShapePlace(int(number), rigid_motion(path, transform), box, tuple(json.loads(str(names))), str(name))
        for number, transform, box, names, name in zip(
            *(arrays[name][has_triangles] for name in ("shape", "transforms", "boxes", "paths", "names")), strict=True
        )
    ]
    shapes = []
    numbers_of_records = _record_numbers(path, int(arrays["record_count"]))
    for k, face_count in enumerate(arrays["face_count"]):
        triangles = np.flatnonzero(shape == k)
        pairs = repeated[owner[repeated[:, 0], 0] == k]
        first_of = first_faces(brep[triangles], owner[pairs, 1], len(surfaces[k]))
        described = stated_faces(arrays, k, numbers_of_records, first_of)
        shapes.append(StepShape(triangles, len(rim(faces[triangles])) > 0, described, int(face_count)))
    return Product(path, mesh, shape, brep, tuple(surfaces), tuple(bodies(shapes, places)), text)


def usual_chord(text: StepText) -> float:
    """Return the largest distance [mm] between triangles and true faces of a STEP file for which no chord is required."""
    return max(STEP_CHORD, STEP_SHARE * text.extent * text.unit)


def _record_numbers(path: Path, count: int) -> np.ndarray:
    """Return the numbers (record + 1,) of the `count` records in a file's text, after a 0; zeros if they cannot be told."""
    numbers = record_numbers(path.read_bytes()) if count else []
    return np.array([0, *numbers] if len(numbers) == count else np.zeros(count + 1), dtype=np.int64)


def _proper_triangles(path: Path, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return indices of triangles (face, 3), without repeated ones and without those that have two corners in one place.

    The second array (repeated, 2) has the indices of each repeated triangle and of that which it repeats: they come from a face
    that stands twice in its shell. Corners fall together at the ends of an edge that is shorter than coordinates resolve.
    """
    proper = np.flatnonzero((faces != np.roll(faces, 1, axis=1)).all(axis=1))
    unique, group = distinct_triangles(faces[proper])
    for count, kind in ((len(faces) - len(proper), "on edges of no length"), (len(proper) - len(unique), "that stand twice")):
        if count:
            log.info('"%s": %d triangles %s are left out', path, count, kind)
    pairs = np.column_stack([proper, proper[unique][group]])
    return proper[np.sort(unique)], pairs[pairs[:, 0] != pairs[:, 1]]


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


def _merge_vertices(vertices: np.ndarray, faces: np.ndarray, shape: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (vertex, 3) [mm] without those that nearly repeat others, and `faces` (face, 3) that refer to them.

    Vertices stay apart if their `shape` (vertex,) differs. The ends of an edge that is shorter than the kernel's triangulation
    resolves fall together.
    """
    rounded = np.round(vertices, COORDINATE_DIGITS) + 0.0  # no negative zeros
    rows, number = np.unique(np.column_stack([shape, rounded]), axis=0, return_inverse=True)
    radius = MERGE_DISTANCE * max(1.0, float(np.abs(rounded).max(initial=0)))
    pairs = scipy.spatial.cKDTree(rows[:, 1:]).query_pairs(radius, output_type="ndarray")
    pairs = pairs[rows[pairs[:, 0], 0] == rows[pairs[:, 1], 0]]
    if not len(pairs):
        return rows[:, 1:], number.ravel()[faces]
    label = trimesh.graph.connected_component_labels(pairs, node_count=len(rows))
    _, first, cluster = np.unique(label, return_index=True, return_inverse=True)
    return rows[first, 1:], cluster.ravel()[number.ravel()][faces]


def rigid_motion(path: Path, transform: np.ndarray) -> np.ndarray:
    """Return a transform (4, 4) [mm] whose rotation is orthogonal to the last digit.

    Raises GeometryFault if the transform mirrors or scales.
    """
    place = np.eye(4)
    U, scales, V = np.linalg.svd(transform[:3, :3])
    if np.abs(scales - 1).max() > STRETCH_TOLERANCE or np.linalg.det(transform[:3, :3]) < 0:
        raise GeometryFault(
            f'"{path}" places a body mirrored or scaled, which bodies of a rigid assembly are not; export it as it is'
        )
    place[:3, :3] = U @ V
    place[:3, 3] = transform[:3, 3]
    return place
