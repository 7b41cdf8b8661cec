"""The shapes of the bodies of a STEP file, with their B-rep faces and vertices on the stated surfaces. Lengths in mm.

A face may occur in its shell a second time. Its triangles then repeat the triangles of the first one, which counts for both.
All other faces have numbers, even if the kernel makes no triangles of them at some chord: numbers do not depend on the chord.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.spatial
import trimesh

from tolcontact.geometry.analytic_surfaces import ANALYTIC_SURFACES, AnalyticSurface
from tolcontact.geometry.triangle_mesh import distinct_triangles, rim

COORDINATE_DIGITS = 9  # of vertices after the point [mm]
MAX_ITERATIONS = 4  # of Newton's method: they bring vertices that are off by micrometres to the last digit
MIRROR = np.diag([-1.0, 1.0, 1.0])  # from the frame of a product to the frame of a mirrored body
MIN_SINGULAR = 0.05  # smallest relative singular value of the normals in a vertex whose surfaces count as different


class FaceMeasure(NamedTuple):
    """The `area` of a face [mm2], a `point` (3,) on it [mm], and its outward `normal` (3,) there."""

    area: float
    point: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True, eq=False)
class StatedFace:
    """A B-rep face as a file states it.

    surface  None for an unknown one
    name     "" for a face without a name
    records  numbers of its records in the file's text, its own first, then the records of its copies; empty if it states no PMI
    copies   number of other faces in the same place, which have no triangles
    measure  None if the kernel finds none, as for a face that the file states by triangles, and for faces from an archive
    """

    surface: AnalyticSurface | None = None
    name: str = ""
    records: tuple[int, ...] = ()
    copies: int = 0
    measure: FaceMeasure | None = None

    def placed(self, R: np.ndarray, t: np.ndarray) -> "StatedFace":
        """Return the face rotated or mirrored by R (3, 3), then translated by t (3,) [mm]."""
        surface = self.surface and self.surface.placed(R, t)
        measure = self.measure and FaceMeasure(self.measure.area, R @ self.measure.point + t, R @ self.measure.normal)
        return replace(self, surface=surface, measure=measure)


@dataclass(frozen=True, eq=False)
class StepShape:
    """The shape of a body, or of several equal ones, in the frame of its product.

    vertices     (vertex, 3) [mm]
    triangles    (triangle, 3)
    brep         (triangle,) the B-rep face of each triangle, from 0
    faces        the B-rep faces, in the file's order
    face_count   number of B-rep faces that the file states for a solid; 0 if it is no solid
    gap_count    number of edges that have a triangle on one side only
    """

    vertices: np.ndarray
    triangles: np.ndarray
    brep: np.ndarray
    faces: tuple[StatedFace, ...]
    face_count: int
    gap_count: int

    @cached_property
    def mirrored(self) -> "StepShape":
        """The shape with its x reversed."""
        faces = tuple(face.placed(MIRROR, np.zeros(3)) for face in self.faces)
        return replace(self, vertices=self.vertices @ MIRROR, triangles=self.triangles[:, ::-1], faces=faces)


def step_shape(
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
    from a face that occurs twice in its shell. Corners fall together at the ends of an edge that is shorter than coordinates
    resolve.
    """
    proper = np.flatnonzero((triangles != np.roll(triangles, 1, axis=1)).all(axis=1))
    unique, group = distinct_triangles(triangles[proper])
    counts = {"on edges of no length": len(triangles) - len(proper), "that stand twice": len(proper) - len(unique)}
    omissions += Counter(counts)
    pairs = np.column_stack([proper, proper[unique][group]])
    return proper[np.sort(unique)], pairs[pairs[:, 0] != pairs[:, 1]]


def rounded(vertices: np.ndarray) -> np.ndarray:
    """Return vertices (vertex, 3) [mm] rounded to the digits that are kept."""
    return np.round(vertices, COORDINATE_DIGITS) + 0.0  # no negative zeros


def _merge_vertices(vertices: np.ndarray, triangles: np.ndarray, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (vertex, 3) [mm] without those that are within a `distance` of others, and `triangles` (triangle, 3).

    The ends of an edge that is shorter than the kernel's triangulation resolves fall together.
    """
    rows, number = np.unique(rounded(vertices), axis=0, return_inverse=True)
    pairs = scipy.spatial.cKDTree(rows).query_pairs(distance, output_type="ndarray")
    if not len(pairs):
        return rows, number.ravel()[triangles]
    label = trimesh.graph.connected_component_labels(pairs, node_count=len(rows))
    _, first, cluster = np.unique(label, return_index=True, return_inverse=True)
    return rows[first], cluster.ravel()[number.ravel()][triangles]


def stated_surface(entry: Mapping[str, Any] | None) -> AnalyticSurface | None:
    """Return the surface of a B-rep face as `kernel.brep_faces` describes it; None for a face of another kind."""
    if entry is None:
        return None
    numbers = {name: np.array(value) if isinstance(value, list) else value for name, value in entry.items() if name != "kind"}
    return ANALYTIC_SURFACES[entry["kind"]].of(numbers) if all(np.isfinite(value).all() for value in numbers.values()) else None


def credible(
    vertices: np.ndarray, faces: np.ndarray, brep: np.ndarray, surfaces: Sequence[AnalyticSurface | None], max_distance: float
) -> list[AnalyticSurface | None]:
    """Return the surfaces of B-rep faces; None if a vertex of the face is more than `max_distance` [mm] off."""
    checked = list(surfaces)
    for number, surface in enumerate(surfaces):
        corners = np.unique(faces[brep == number]) if surface is not None else ()
        if surface is not None and not (len(corners) and np.abs(surface.distance(vertices[corners])[0]).max() <= max_distance):
            checked[number] = None
    return checked


def onto(
    vertices: np.ndarray, faces: np.ndarray, brep: np.ndarray, surfaces: Sequence[AnalyticSurface | None], max_distance: float
) -> np.ndarray:
    """Return `vertices` (vertex, 3) [mm], each moved the shortest way onto all analytic surfaces that meet in it.

    A vertex that would move by more than `max_distance` [mm] keeps its place. `faces` (face, 3) belong to the B-rep faces
    `brep` (face,), whose surfaces are `surfaces`.
    """
    is_analytic = np.array([surface is not None for surface in surfaces])
    meetings = np.unique(np.column_stack([faces.ravel(), np.repeat(brep, 3)]), axis=0)
    meetings = meetings[is_analytic[meetings[:, 1]]]
    moved = np.array(vertices)
    for _ in range(MAX_ITERATIONS):
        moved -= _steps(moved, meetings, surfaces)
    is_near = np.linalg.norm(moved - vertices, axis=1) <= max_distance
    return np.where(is_near[:, None], moved, vertices)


def _steps(vertices: np.ndarray, meetings: np.ndarray, surfaces: Sequence[AnalyticSurface | None]) -> np.ndarray:
    """Return the shortest steps (vertex, 3) that end, to first order, on all surfaces that meet in a vertex.

    `meetings` (meeting, 2) are the indices of a vertex and of a surface there, in order of vertices.
    """
    value, slope = np.zeros(len(meetings)), np.zeros((len(meetings), 3))
    for number in np.unique(meetings[:, 1]):
        surface, rows = surfaces[number], np.flatnonzero(meetings[:, 1] == number)
        if surface is not None:
            value[rows], slope[rows] = surface.distance(vertices[meetings[rows, 0]])
    step = np.zeros_like(vertices)
    vertex, start, count = np.unique(meetings[:, 0], return_index=True, return_counts=True)
    for size in np.unique(count):
        movers, starts = vertex[count == size], start[count == size]
        rows = starts[:, None] + np.arange(size)
        if size == 1:
            step[movers] = value[starts][:, None] * slope[starts]
        else:
            step[movers] = np.einsum("nij,nj->ni", np.linalg.pinv(slope[rows], rcond=MIN_SINGULAR), value[rows])
    return step
