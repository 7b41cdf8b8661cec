"""The product in a STEP file: shapes of bodies, moved onto the surfaces that it states, and bodies in their places.

Lengths in mm.
"""

import logging
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.spatial
import trimesh

from tolcontact.errors import GeometryFault, nearest_name
from tolcontact.geometry.files.bodies import Body, FaceMeasure, StatedFace, StepShape, listed, uniquely_named
from tolcontact.geometry.files.step_surfaces import credible, onto, stated_surface
from tolcontact.geometry.files.step_text import StepText
from tolcontact.geometry.triangle_mesh import distinct_triangles, rim

STEP_CHORD, STEP_ANGLE = 0.002, 0.1  # largest distance [mm] and angle [rad] between triangles and true faces of a STEP file
STEP_SHARE = 5e-6  # the chord of files larger than 0.4 m, as a share of their extent
MAX_COORDINATE = 1e7  # [mm]
COORDINATE_DIGITS = 9  # of vertices after the point [mm]
MERGE_DISTANCE = 1e-7  # [mm], beyond 1 mm from the origin a share: vertices of a shape that are closer are one
STRETCH_TOLERANCE = 1e-6  # relative, for a rigid motion
MAX_OFFSET = 3.0  # in chords: vertices at a larger distance from the surface of their B-rep face are not moved onto it
BREP = "brep_index"  # face attribute of a mesh: the B-rep face of each triangle
STATED_FACES = "stated_faces"  # in its metadata: each B-rep face as the file states it

log = logging.getLogger(__name__)


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

    def part(self, selector: str | int | None) -> trimesh.Trimesh:
        """Return the mesh of a body: in its own frame if it is selected, in its place if `selector` is None.

        The mesh has BREP, whose indices follow the file's order, and STATED_FACES.
        """
        body = self.body(selector)
        shape = body.shape
        vertices, faces = np.array(shape.vertices), shape.faces
        if selector is None and not np.array_equal(body.place, np.eye(4)):
            R, t = body.place[:3, :3], body.place[:3, 3]
            vertices = vertices @ R.T + t
            faces = tuple(face.placed(R, t) for face in faces)
        mesh = trimesh.Trimesh(vertices, np.array(shape.triangles), process=False)
        mesh.units = "mm"
        mesh.face_attributes[BREP] = np.array(shape.brep)
        mesh.metadata[STATED_FACES] = faces
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
    merge_distance = MERGE_DISTANCE * max(1.0, float(np.abs(_rounded(vertices)).max(initial=0)))
    max_offset = MAX_OFFSET * min(chord, usual_chord(text))  # vertices are on the true faces at any chord
    # The kernel counts records; if it counts others than the text has, their numbers are unknown.
    is_counted = content["record_count"] == len(text.order)
    numbers = np.array([0, *text.order]) if is_counted else np.zeros(content["record_count"] + 1, dtype=np.int64)
    omissions: Counter[str] = Counter()
    shapes = [_shape(entry, numbers, merge_distance, max_offset, omissions) for entry in content["shapes"]]
    for kind, count in omissions.items():
        log.info('"%s": %d triangles %s are left out', path, count, kind)
    if not any(len(shape.triangles) for shape in shapes):
        raise GeometryFault(f'"{path}" holds no surfaces that could be read; export the part itself as a solid')
    entries = [entry for entry in content["bodies"] if len(shapes[entry[0]].triangles)]
    bodies = [
        # A solid that is alone in its file is no sheet, though faces may be missing.
        Body(
            name,
            tuple(names),
            rigid_motion(path, transform),
            box,
            shapes[index].gap_count > 0 and not (len(entries) == 1 and shapes[index].face_count),
            shapes[index],
        )
        for index, transform, box, names, name in entries
    ]
    face_count = sum(len(entry["surfaces"]) for entry in content["shapes"])
    drawn = tuple(shape for shape in shapes if len(shape.triangles))
    return Product(path, drawn, tuple(uniquely_named(bodies)), face_count, text.units)


def usual_chord(text: StepText) -> float:
    """Return the largest distance [mm] between triangles and true faces of a STEP file for which no chord is required."""
    return max(STEP_CHORD, STEP_SHARE * text.extent * text.unit)


def _shape(
    entry: Mapping[str, Any], numbers: np.ndarray, merge_distance: float, max_offset: float, omissions: Counter[str]
) -> StepShape:
    """Return a shape, without triangles that are degenerate or repeat others.

    entry            what the kernel reads
    numbers          (record + 1,) numbers of all records in the file's text, after a 0
    merge_distance   [mm] between vertices that are one
    max_offset       [mm] largest displacement of a vertex onto the surfaces of its faces
    omissions        counts of triangles by the reason for which they are left out
    """
    vertices, triangles = _merge_vertices(entry["vertices"], entry["triangles"], merge_distance)
    proper, repeated = _proper_triangles(triangles, omissions)
    brep = entry["brep"][proper]
    corners, triangles = np.unique(triangles[proper], return_inverse=True)
    vertices, triangles = vertices[corners], triangles.reshape(-1, 3)
    surfaces = credible(vertices, triangles, brep, list(map(stated_surface, entry["surfaces"])), max_offset)
    vertices = onto(vertices, triangles, brep, surfaces, max_offset)
    # The original of each face: itself, unless it is a copy.
    first = np.arange(len(surfaces))
    first[entry["brep"][repeated[::-1, 0]]] = entry["brep"][repeated[::-1, 1]]
    first[brep] = brep
    places, faces = np.unique(first), []
    for place in places:
        members = [place, *(member for member in np.flatnonzero(first == place) if member != place)]
        records = [int(numbers[entry["records"][member]]) for member in members] if entry["records"] else []
        measure = entry["measures"][place]
        faces.append(
            StatedFace(
                surfaces[place],
                entry["names"][place],
                records=tuple(filter(None, records)),
                copies=len(members) - 1,
                measure=None if measure is None else FaceMeasure(measure[0], np.array(measure[1]), np.array(measure[2])),
            )
        )
    return StepShape(
        vertices, triangles, np.searchsorted(places, brep), tuple(faces), entry["face_count"], gap_count=len(rim(triangles))
    )


def _proper_triangles(triangles: np.ndarray, omissions: Counter[str]) -> tuple[np.ndarray, np.ndarray]:
    """Return indices of triangles (triangle, 3), without repeated ones and without those that have two corners in one place.

    The second array (repeated, 2) has the indices of each repeated triangle and of the triangle that it repeats: they come
    from a face that stands twice in its shell. Corners fall together at the ends of an edge that is shorter than coordinates
    resolve.
    """
    proper = np.flatnonzero((triangles != np.roll(triangles, 1, axis=1)).all(axis=1))
    unique, group = distinct_triangles(triangles[proper])
    counts = {"on edges of no length": len(triangles) - len(proper), "that stand twice": len(proper) - len(unique)}
    omissions += Counter(counts)
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


def _rounded(vertices: np.ndarray) -> np.ndarray:
    return np.round(vertices, COORDINATE_DIGITS) + 0.0  # no negative zeros


def _merge_vertices(vertices: np.ndarray, triangles: np.ndarray, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (vertex, 3) [mm] without those that are within a `distance` of others, and `triangles` (triangle, 3).

    The ends of an edge that is shorter than the kernel's triangulation resolves fall together.
    """
    rows, number = np.unique(_rounded(vertices), axis=0, return_inverse=True)
    pairs = scipy.spatial.cKDTree(rows).query_pairs(distance, output_type="ndarray")
    if not len(pairs):
        return rows, number.ravel()[triangles]
    label = trimesh.graph.connected_component_labels(pairs, node_count=len(rows))
    _, first, cluster = np.unique(label, return_index=True, return_inverse=True)
    return rows[first], cluster.ravel()[number.ravel()][triangles]


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
