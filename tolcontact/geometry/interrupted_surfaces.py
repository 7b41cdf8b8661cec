"""Cylinders and cones that are interrupted by two keyways, slots or splines, so that their faces do not touch. Lengths in mm.

Such faces form one surface if they overlap along the axis, and if there is no material between them on the surface. So a bore
with two keyways is one hole; holes in two lugs are two holes, and walls of curved slots around one axis remain separate.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import trimesh

from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Cone, Cylinder
from tolcontact.geometry.body_overlap import SolidBody

FaceOnSurface = tuple[AnalyticSurface | None, np.ndarray]  # a surface, if one is known, and the triangles (face,) on it
SameSurface = Callable[[FaceOnSurface, FaceOnSurface], bool]

MIN_COMMON_SHARE = 0.5  # of the shorter face along the axis
DIRECTIONS = 360  # samples around the axis
COINCIDENCE = 1e-6  # of a part's size
CHORD_FACTOR = 2.0  # times the height of the surface over its triangles


def interruptions(
    mesh: trimesh.Trimesh, faces: Sequence[FaceOnSurface], label: np.ndarray, is_same: SameSurface
) -> Iterator[tuple[int, int]]:
    """Yield pairs of indices of faces that form one interrupted cylinder or cone.

    label     (face,) equal for faces that touch and already form one surface
    is_same   whether two faces are parts of one surface
    """
    firsts = [int(number) for number in np.unique(label, return_index=True)[1]]
    candidates = [(number, faces[number][0]) for number in firsts if len(faces[number][1])]
    round_faces = [(number, surface) for number, surface in candidates if isinstance(surface, Cylinder | Cone)]
    body = SolidBody(mesh)
    margin = COINCIDENCE * float(mesh.scale)
    for (first, surface), (second, neighbour) in itertools.combinations(round_faces, 2):
        if _is_coaxial(surface, neighbour, margin) and is_same(faces[first], faces[second]) and body.is_closed:
            parts = [_triangles(faces, label, number) for number in (first, second)]
            if _is_interrupted(body, surface, parts, margin):
                yield first, second


def _triangles(faces: Sequence[FaceOnSurface], label: np.ndarray, number: int) -> np.ndarray:
    """Return the triangles (face,) of all faces that form one surface with a face."""
    return np.concatenate([faces[int(member)][1] for member in np.flatnonzero(label == label[number])])


def _is_coaxial(surface: AnalyticSurface, neighbour: AnalyticSurface, margin: float) -> bool:
    """Return whether two surfaces may be one: same kind, same size, same axis; a quick check."""
    if surface.kind != neighbour.kind or abs(surface.radius - neighbour.radius) > 1e3 * margin:
        return False
    return bool(np.linalg.norm(np.cross(neighbour.origin - surface.origin, surface.axis)) < 1e3 * margin)


def _is_interrupted(body: SolidBody, surface: Cylinder | Cone, parts: Sequence[np.ndarray], margin: float) -> bool:
    """Return whether two parts of a surface, the triangles (face,) of each, overlap along its axis without material between."""
    corners = [np.asarray(body.mesh.triangles)[triangles].reshape(-1, 3) for triangles in parts]
    along = [(points - surface.origin) @ surface.axis for points in corners]
    lower, upper = max(coordinates.min() for coordinates in along), min(coordinates.max() for coordinates in along)
    if upper - lower < MIN_COMMON_SHARE * min(float(np.ptp(coordinates)) for coordinates in along):
        return False
    middle = (lower + upper) / 2
    radius = surface.radius if isinstance(surface, Cylinder) else abs(middle) * np.tan(surface.angle)
    across = np.linalg.svd(surface.axis[None])[2][1:]
    angles = np.linspace(0, 2 * np.pi, DIRECTIONS, endpoint=False)
    circle = surface.origin + middle * surface.axis + radius * np.column_stack([np.cos(angles), np.sin(angles)]) @ across
    middles = np.concatenate(
        [(points.reshape(-1, 3, 3) + np.roll(points.reshape(-1, 3, 3), 1, axis=1)) / 2 for points in corners]
    )
    chord = float(np.abs(surface.distance(middles.reshape(-1, 3))[0]).max())
    return bool((body.depth(circle) < CHORD_FACTOR * chord + margin).all())
