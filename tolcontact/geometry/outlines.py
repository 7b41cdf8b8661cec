"""Outlines of the planes of two bodies that face each other, and how far their holes are from them."""

import numpy as np
import trimesh

from tolcontact.arrays import Array, Float, Int
from tolcontact.geometry.polyhedron import Polyhedron
from tolcontact.geometry.triangle_mesh import edges

MAX_COMPARISONS = 1_000_000  # of segments of two loops: finer ones count as if they met


def outline(body: Polyhedron, facet: int) -> Float[Array, "segment 2 3"]:
    """Return the outline of the face's facets in the plane of a facet: the edges that belong to only one of them.

    The face is on their left, as seen from outside.
    """
    corners, _, rim = plane_of(body, facet)
    return np.asarray(corners[rim])


def plane_of(body: Polyhedron, facet: int) -> tuple[Float[Array, "c 3"], Int[Array, "t 3"], Int[Array, "segment 2"]]:
    """Return the plane of a facet: corners [mm], and the indices of corners of its triangles and of the ends of its outline."""
    triangles = body.facets[body.facet_planes == body.facet_planes[facet]]
    corners, numbers = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    numbers = numbers.reshape(-1, 3)
    ends, edge, count = edges(numbers)
    return corners, numbers, ends[count[edge] == 1]


def across(normal: Float[Array, "3"]) -> Float[Array, "2 3"]:
    """Return two unit vectors across a normal."""
    direction = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    direction /= np.linalg.norm(direction)
    return np.stack([direction, np.cross(normal, direction)])


def hole_clearances(
    A: Polyhedron, B: Polyhedron, facing: Int[Array, "plane 2"], outlines: list[Float[Array, "segment 2 3"]]
) -> Float[Array, "edge plane"]:
    """Return how far [mm] bodies may move before edges of A around holes in facing planes matter (edge, plane); 0 for others.

    The gap of two planes is linear, and smallest at a corner of the convex hull of their overlap. This is no corner of a hole
    as long as the hole lies inside the outlines of both planes. A hole that meets another outline counts as a part of it.

    outlines   of the plane of A and of the plane of B, for each pair of facing planes in turn
    """
    clearances = np.zeros((len(A.edges), len(facing)))
    known: tuple[dict[int, list[np.ndarray]], ...] = {}, {}  # the loops of planes, of which many may face the same one
    for plane, facets in enumerate(facing.tolist()):
        frame, loops, are_holes = across(B.normals[facets[1]]), list[np.ndarray](), list[bool]()
        for body, of_planes, facet, segments in zip((A, B), known, facets, outlines[2 * plane : 2 * plane + 2], strict=True):
            if facet not in of_planes:
                of_planes[facet] = _loops(segments)
            loops += of_planes[facet]
            are_holes += [_is_hole(loop, body.normals[facet]) for loop in of_planes[facet]]
        for k, clearance in _holes([loop @ frame.T for loop in loops], are_holes).items():
            points = {tuple(point) for point in loops[k].reshape(-1, 3).tolist()}
            clearances[[all(tuple(end) in points for end in edge) for edge in A.edges.tolist()], plane] = clearance
    return clearances


def _loops(segments: Float[Array, "segment 2 3"]) -> list[Float[Array, "segment 2 3"]]:
    """Return the loops of an outline; loops that share a corner count as one."""
    _, ends = np.unique(segments.reshape(-1, 3), axis=0, return_inverse=True)
    ends = ends.reshape(-1, 2)
    labels = trimesh.graph.connected_component_labels(ends, node_count=int(ends.max()) + 1)[ends[:, 0]]
    return [segments[labels == label] for label in np.unique(labels)]


def _is_hole(loop: Float[Array, "segment 2 3"], normal: Float[Array, "3"]) -> bool:
    """Return whether a loop encloses no part of its face."""
    start, end = (loop - loop[0, 0]).transpose(1, 0, 2)
    return float(np.cross(start, end).sum(axis=0) @ normal) < 0


def _holes(loops: list[Float[Array, "segment 2 2"]], are_holes: list[bool]) -> dict[int, float]:
    """Return the loops that are holes and meet no other outline, and their distances [mm] from all that are not."""
    clearances = {k: np.inf for k, is_hole in enumerate(are_holes) if is_hole}
    outlines = [k for k, is_hole in enumerate(are_holes) if not is_hole]
    while outlines:
        other = outlines.pop()
        clearances = {k: min(value, _distance(loops[k], loops[other])) for k, value in clearances.items()}
        outlines += [k for k, value in clearances.items() if value == 0]
        clearances = {k: value for k, value in clearances.items() if value > 0}
    return clearances


def _distance(loop: Float[Array, "s 2 2"], other: Float[Array, "t 2 2"]) -> float:
    """Return the distance [mm] of two loops in a plane; 0 if they meet."""
    if len(loop) * len(other) > MAX_COMPARISONS:
        return 0.0
    least, crosses = np.inf, np.ones((len(loop), len(other)), dtype=bool)
    for is_other, (points, segments) in enumerate(((loop, other), (other, loop))):
        d, sides = segments[:, 1] - segments[:, 0], list[np.ndarray]()
        for point in points.transpose(1, 0, 2):
            arm = point[:, None] - segments[None, :, 0]
            share = np.clip((arm * d).sum(axis=2) / (d * d).sum(axis=1), 0, 1)
            least = min(least, float(np.linalg.norm(arm - share[..., None] * d, axis=2).min()))
            sides.append(d[:, 0] * arm[..., 1] - d[:, 1] * arm[..., 0])
        splits = sides[0] * sides[1] <= 0
        crosses &= splits.T if is_other else splits
    return 0.0 if crosses.any() else least
