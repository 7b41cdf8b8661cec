"""Compiled filter of contact points at which bodies are nominally behind each other, and so cannot have penetrated."""

import numpy as np

from tolcontact.compiled import inlined_uncounted, uncounted
from tolcontact.geometry.kernel import CORNER_ON_FACET, EDGE_ON_EDGE, INSIDE
from tolcontact.geometry.vector_kernel import along, dot, minus, row, row_of, turn_back

NEARLY_PARALLEL = 1e-3  # sine of the angle between edges, below which their common normal does not give their distance


@inlined_uncounted
def _nominal_height(A, B, candidates, s, X, n, point, projection):  # type: ignore[no-untyped-def]
    """Return the nominal height of candidate s: the height of its point over its projection along n, or along R'n.

    Two edges may have shifted along each other: their height is the distance of their lines.
    """
    arm = minus(point, projection)
    if candidates.kinds[s] == EDGE_ON_EDGE:
        start_A, start_B = row_of(A.edges, candidates.firsts[s], 0), row_of(B.edges, candidates.seconds[s], 0)
        d = minus(row_of(A.edges, candidates.firsts[s], 1), start_A)
        e = minus(row_of(B.edges, candidates.seconds[s], 1), start_B)
        arm = minus(start_A, start_B)
        arm = along(arm, -dot(arm, e) / dot(e, e), e)
        across = along(d, -dot(d, e) / dot(e, e), e)
        if dot(across, across) > NEARLY_PARALLEL * NEARLY_PARALLEL * dot(d, d):
            arm = along(arm, -dot(arm, across) / dot(across, across), across)
    return max(dot(n, arm), dot(turn_back(X, n), arm))  # whichever body the normal belongs to


@uncounted
def drop_passed(A, B, candidates, passed, X, touching, gaps, all_points, is_held):  # type: ignore[no-untyped-def]
    """Drop points that are nominally deeper than `passed` [mm] and have a held corner: the body penetrated at that corner.

    The corners of a point are the corner itself, or the ends of both edges. `is_held` (corner,) is false before and after, for
    the corners of the moving body followed by the corners of the reference body.
    """
    points, projections, normals = all_points
    count = A.vertices.shape[0]
    for is_first in (True, False):
        for s in touching:
            is_edge = candidates.kinds[s] == EDGE_ON_EDGE
            owner = candidates.firsts[s] if candidates.kinds[s] == CORNER_ON_FACET else count + candidates.seconds[s]
            height = _nominal_height(A, B, candidates, s, X, row(normals, s), row(points, s), row(projections, s))
            has_passed = height < -passed
            if is_first and not is_edge and not has_passed and gaps[s] <= INSIDE:
                is_held[owner] = True
            elif not is_first and has_passed and candidates.planes[s] < 0 and gaps[s] < -INSIDE:
                if is_edge:
                    for end in range(2):
                        is_at_A = is_held[A.ends[candidates.firsts[s], end]]
                        if is_at_A or is_held[count + B.ends[candidates.seconds[s], end]]:
                            gaps[s] = np.inf
                elif is_held[owner]:
                    gaps[s] = np.inf
    is_held[:] = False
