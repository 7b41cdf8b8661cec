"""Candidate contact points, sorted so that a search can skip most of them."""

from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.geometry.kernel import CORNER_ON_FACET, EDGE_ON_EDGE, FACET_ON_CORNER
from tolcontact.geometry.places_kernel import Candidates
from tolcontact.geometry.polyhedron import Polyhedron
from tolcontact.geometry.triangle_mesh import edges

WIDE_SHARE = 1 / 8  # of the whole range: wider intervals come first
BANDS_PER_SEGMENT = 2  # of an outline
MAX_BANDS = 1024
ROUNDING = 1e-9  # bands: segments that end this close to a band are in it


class Sorted(NamedTuple):
    """Runs of intervals: in each run first the wide intervals, then the narrow ones in ascending order of their start.

    order     (n,): indices of the intervals
    runs      (run + 1,): where runs begin, and the end
    middles   (run,): where their narrow intervals begin
    widths    (run,): largest width of a narrow interval
    """

    order: Int[Array, " n"]
    runs: Int[Array, " _"]
    middles: Int[Array, " run"]
    widths: Float[Array, " run"]


def sorted_candidates(A: Polyhedron, B: Polyhedron, table: Int[Array, "c 4"], facing: Int[Array, "p 2"]) -> Candidates:
    """Return candidates (kind, first, second, plane), grouped by corner or edge and plane."""
    kinds, firsts, seconds, planes = table.T
    frames = np.array([[_across(body.normals[k]) for body, k in zip((A, B), facets, strict=True)] for facets in facing])
    frames = frames.reshape(-1, 2, 2, 3)
    outlines = [_outline(body, k) @ frame.T for facets, body_frames in zip(facing, frames, strict=True)
                for body, k, frame in zip((A, B), facets, body_frames, strict=True)]  # fmt: skip
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
    by_owner = _sorted(boxes[:, 0], boxes[:, 2], np.stack([kinds, owners, planes]))
    kinds, firsts, seconds, planes = (np.ascontiguousarray(column) for column in table[by_owner.order].T)
    return Candidates(
        kinds, firsts, seconds, planes, facing, *by_owner[1:], boxes[by_owner.order], frames, *_in_bands(outlines)
    )


def _in_bands(outlines: list[Float[Array, "segment 2 2"]]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the segments (row, 4) of outlines in bands, where bands and outlines begin, and the spans of the outlines."""
    rows, bands, numbers = [np.zeros((0, 4))], [0], [0]
    spans = np.array([[outline[..., 1].min(), outline[..., 1].max()] for outline in outlines]).reshape(-1, 2)
    for outline, (low, high) in zip(outlines, spans, strict=True):
        count = min(BANDS_PER_SEGMENT * len(outline), MAX_BANDS)
        heights = (outline[..., 1] - low) * count / (high - low)
        bottom, top = np.floor(heights.min(axis=1) - ROUNDING), np.floor(heights.max(axis=1) + ROUNDING)
        for band in range(count):
            reaching = outline[(bottom <= band) & (top >= band)].reshape(-1, 4)
            rows.append(reaching)
            bands.append(bands[-1] + len(reaching))
        numbers.append(numbers[-1] + count)
    return np.concatenate(rows), np.array(bands), np.array(numbers), spans


def _sorted(lows: Float[Array, " n"], highs: Float[Array, " n"], keys: Int[Array, "key n"]) -> Sorted:
    """Return intervals in runs of equal keys; the first key is the most significant."""
    if not len(lows):
        return Sorted(*(np.zeros(0, dtype=int), np.zeros(1, dtype=int)), np.zeros(0, dtype=int), np.zeros(0))
    codes = np.zeros(len(lows), dtype=np.int64)
    for key in keys:
        codes = codes * (np.ptp(key) + 1) + key - key.min()
    _, run = np.unique(codes, return_inverse=True)
    count = int(run.max()) + 1
    lowest, last = np.full(count, np.inf), np.full(count, -np.inf)
    np.minimum.at(lowest, run, lows)
    np.maximum.at(last, run, highs)
    is_finite = np.isfinite(last - lowest)[run]
    widths = np.where(is_finite, highs, 0.0) - np.where(is_finite, lows, 0.0)
    is_wide = ~is_finite | (widths > WIDE_SHARE * (np.where(is_finite, (last - lowest)[run], 0.0)))
    narrowest = np.zeros(count)
    np.maximum.at(narrowest, run[~is_wide], widths[~is_wide])
    lengths, wide = np.bincount(run, minlength=count), np.bincount(run[is_wide], minlength=count)
    runs = np.concatenate([[0], np.cumsum(lengths)])
    return Sorted(np.lexsort((lows, ~is_wide, run)), runs, runs[:-1] + wide, narrowest)


def _outline(body: Polyhedron, facet: int) -> Float[Array, "segment 2 3"]:
    """Return the outline of the face's facets in the plane of a facet: the edges that belong to only one of them."""
    triangles = body.facets[body.facet_planes == body.facet_planes[facet]]
    corners, numbers = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    ends, edge, count = edges(numbers.reshape(-1, 3))
    return np.asarray(corners[ends[count[edge] == 1]])


def _across(normal: Float[Array, "3"]) -> Float[Array, "2 3"]:
    """Return two unit vectors across a normal."""
    direction = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    direction /= np.linalg.norm(direction)
    return np.stack([direction, np.cross(normal, direction)])
