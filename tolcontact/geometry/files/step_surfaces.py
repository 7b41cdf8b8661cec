"""The surfaces that a STEP file states for its B-rep faces, and vertices moved onto them. Lengths in mm."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tolcontact.geometry.analytic_surfaces import ANALYTIC_SURFACES, AnalyticSurface

MAX_ITERATIONS = 4  # of Newton's method: they bring vertices that are off by micrometres to the last digit
PARALLEL = 0.05  # smallest relative singular value of the normals in a vertex whose surfaces count as different


def stated_surface(entry: Mapping[str, Any] | None) -> AnalyticSurface | None:
    """Return the surface of a B-rep face as `kernel.brep_faces` describes it; None for a face of another kind."""
    if entry is None:
        return None
    numbers = {name: np.array(value) if isinstance(value, list) else value for name, value in entry.items() if name != "kind"}
    return ANALYTIC_SURFACES[entry["kind"]].of(numbers) if all(np.isfinite(value).all() for value in numbers.values()) else None


def credible(
    vertices: np.ndarray,
    faces: np.ndarray,
    brep: np.ndarray,
    surfaces: Sequence[AnalyticSurface | None],
    max_distance: float,
) -> list[AnalyticSurface | None]:
    """Return the surfaces of B-rep faces; None if a vertex of the face is more than `max_distance` [mm] off."""
    checked = list(surfaces)
    for number, surface in enumerate(surfaces):
        corners = np.unique(faces[brep == number]) if surface is not None else ()
        if surface is not None and not (len(corners) and np.abs(surface.distance(vertices[corners])[0]).max() <= max_distance):
            checked[number] = None
    return checked


def onto(
    vertices: np.ndarray,
    faces: np.ndarray,
    brep: np.ndarray,
    surfaces: Sequence[AnalyticSurface | None],
    max_distance: float,
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

    `meetings` (meeting, 2) are the numbers of a vertex and of a surface there, in order of vertices.
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
            step[movers] = np.einsum("nij,nj->ni", np.linalg.pinv(slope[rows], rcond=PARALLEL), value[rows])
    return step
