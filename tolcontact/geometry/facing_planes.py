"""The planes of two bodies that face each other, and their corners at which no gap is the smallest."""

import numpy as np
import trimesh

from tolcontact.arrays import Array, Bool, Int
from tolcontact.geometry.kernel import CORNER_ON_FACET, EDGE_ON_EDGE, FACET_ON_CORNER
from tolcontact.geometry.outlines import plane_of
from tolcontact.geometry.polyhedron import Polyhedron

FACING = -0.99  # cosine of the angle between the normals of planes that face each other
STRAIGHT = 1e-6  # rad: a larger interior angle than a straight one is reflex


def facing_planes(A: Polyhedron, B: Polyhedron, passed: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of facing planes in a table (plane of A + 1, plane of B + 1), -1 for others, and their facets (n, 2).

    The last row and column mean no plane. Only planes count that are nominally near each other and through which the bodies
    may have penetrated each other: the planes at the ends of a short overlap are already beyond each other.

    passed, height   [mm]: the largest depth and the largest gap of planes that face each other
    """
    table, facets = np.full((plane_count(A) + 1, plane_count(B) + 1), -1), list[tuple[int, int]]()
    planes_A, firsts_A = np.unique(A.facet_planes, return_index=True)
    planes_B, firsts_B = np.unique(B.facet_planes, return_index=True)
    cosines = A.normals[firsts_A] @ B.normals[firsts_B].T
    for i, j in np.argwhere(cosines < FACING):
        heights = (A.facets[A.facet_planes == planes_A[i]] - B.facets[firsts_B[j], 0]) @ B.normals[firsts_B[j]]
        if heights.max() >= -passed and heights.min() <= height:
            table[planes_A[i], planes_B[j]] = len(facets)
            facets.append((int(firsts_A[i]), int(firsts_B[j])))
    return table, np.array(facets, dtype=np.int64).reshape(-1, 2)


def plane_count(body: Polyhedron) -> int:
    """Return how many indices of planes a body has."""
    return int(max(body.facet_planes.max(initial=-1), body.edge_planes.max(initial=-1), body.vertex_planes.max(initial=-1))) + 1


def moot_corners(A: Polyhedron, B: Polyhedron, facets: Int[Array, "plane 2"], table: Int[Array, "c 4"]) -> Bool[Array, " c"]:
    """Return which candidates (kind, first, second, plane) are corners of facing planes that are not the first to touch (c,).

    The gap of two planes is linear, and smallest at a convex corner of their overlap. A reflex corner of one plane, such as one
    of a hole, is none. It still counts if it could also touch something else, since it then tells whether bodies are behind
    each other there.

    facets   of the moving and of the reference plane, for each pair of facing planes
    """
    kinds, firsts, seconds, planes = table.T
    is_other, moot = planes < 0, np.zeros(len(table), dtype=bool)
    for side, (body, kind, numbers) in enumerate(((A, CORNER_ON_FACET, firsts), (B, FACET_ON_CORNER, seconds))):
        is_engaged = np.zeros(len(body.vertices), dtype=bool)
        is_engaged[numbers[is_other & (kinds == kind)]] = True
        is_engaged[body.ends[numbers[is_other & (kinds == EDGE_ON_EDGE)]]] = True
        reflex = {facet: _reflex_corners(body, facet) & ~is_engaged for facet in set(facets[:, side].tolist())}
        for plane, facet in enumerate(facets[:, side].tolist()):
            of_plane = np.flatnonzero((planes == plane) & (kinds == kind))
            moot[of_plane] = reflex[facet][numbers[of_plane]]
    return moot


def _reflex_corners(body: Polyhedron, facet: int) -> Bool[Array, " v"]:
    """Return at which corners the plane of a facet has a single interior angle, of more than 180 degrees (v,)."""
    corners, numbers, rim = plane_of(body, facet)
    angles = np.bincount(numbers.ravel(), weights=trimesh.triangles.angles(corners[numbers]).ravel())
    on_rim = np.bincount(rim.ravel(), minlength=len(corners))
    reflex = corners[(angles > np.pi + STRAIGHT) & (on_rim == 2)]
    _, same = np.unique(np.concatenate([reflex, body.vertices]), axis=0, return_inverse=True)
    return np.isin(same.ravel()[len(reflex) :], same.ravel()[: len(reflex)])
