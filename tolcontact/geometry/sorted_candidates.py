"""Candidates for places of contact, with what lets a search pass over most of them."""

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.geometry.edges import edges
from tolcontact.geometry.kernel import CORNER_ON_FACET, EDGE_ON_EDGE, FACET_ON_CORNER
from tolcontact.geometry.places_kernel import Candidates
from tolcontact.geometry.polyhedron import Polyhedron


def sorted_candidates(A: Polyhedron, B: Polyhedron, table: Int[Array, "c 4"], facing: Int[Array, "p 2"]) -> Candidates:
    """Return candidates (kind, first, second, plane), those of one corner or edge and plane together."""
    kinds, firsts, seconds, planes = table.T
    frames = np.array([[_across(body.normals[k]) for body, k in zip((A, B), facets, strict=True)] for facets in facing])
    frames = frames.reshape(-1, 2, 2, 3)
    outlines = [_outline(body, k) @ frame.T for facets, of in zip(facing, frames, strict=True)
                for body, k, frame in zip((A, B), facets, of, strict=True)]  # fmt: skip
    boxes = np.tile([-np.inf, -np.inf, np.inf, np.inf], (len(table), 1))
    for plane in range(len(facing)):
        for kind, coordinates in (
            (CORNER_ON_FACET, outlines[2 * plane + 1].reshape(1, -1, 2)),
            (FACET_ON_CORNER, outlines[2 * plane].reshape(1, -1, 2)),
            (EDGE_ON_EDGE, B.edges[seconds[(planes == plane) & (kinds == EDGE_ON_EDGE)]] @ frames[plane, 1].T),
        ):
            boxes[(planes == plane) & (kinds == kind)] = np.concatenate(
                [coordinates.min(axis=1), coordinates.max(axis=1)], axis=1
            )
    owners = np.where(kinds == FACET_ON_CORNER, seconds, firsts)
    order = np.lexsort((boxes[:, 0], planes, owners, kinds))
    keys, boxes = np.column_stack([kinds, owners, planes])[order], boxes[order]
    runs = np.flatnonzero(np.concatenate([[True], (np.diff(keys, axis=0) != 0).any(axis=1), [True]])) if len(keys) else [0]
    widths = np.maximum.reduceat(boxes[:, 2] - boxes[:, 0], runs[:-1]) if len(keys) else np.zeros(0)
    kinds, firsts, seconds, planes = (np.ascontiguousarray(column) for column in table[order].T)
    lengths = np.cumsum([0, *(len(outline) for outline in outlines)])
    segments = np.concatenate([np.zeros((0, 4)), *(outline.reshape(-1, 4) for outline in outlines)])
    return Candidates(kinds, firsts, seconds, planes, facing, np.array(runs), widths, boxes, frames, segments, lengths)


def _outline(body: Polyhedron, facet: int) -> Float[Array, "segment 2 3"]:
    """Return the outline of the facets of the face that lie in the plane of a facet: the edges that only one of them has."""
    triangles = body.facets[body.facet_planes == body.facet_planes[facet]]
    corners, numbers = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    ends, edge, count = edges(numbers.reshape(-1, 3))
    return np.asarray(corners[ends[count[edge] == 1]])


def _across(normal: Float[Array, "3"]) -> Float[Array, "2 3"]:
    """Return two unit vectors across a normal."""
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])
