"""Candidate contact points, sorted so that a search can skip most of them."""

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.geometry.facing_planes import plane_count
from tolcontact.geometry.kernel import CORNER_ON_FACET, EDGE_ON_EDGE, FACET_ON_CORNER
from tolcontact.geometry.outlines import across, hole_clearances, outline
from tolcontact.geometry.places_kernel import Candidates
from tolcontact.geometry.polyhedron import Polyhedron

WIDE_SHARE = 1 / 8  # of the whole range: wider intervals come first
CLEARANCE_SHARE = 0.5  # of the distance of a hole from other outlines: bodies move by less, with room for their tilt
BANDS_PER_SEGMENT = 2  # of an outline
MAX_BANDS = 1024
ROUNDING = 1e-9  # bands: segments that end this close to a band are in it


def sorted_candidates(
    A: Polyhedron, B: Polyhedron, table: Int[Array, "c 4"], facing: Int[Array, "p 2"], *, has_form: bool
) -> Candidates:
    """Return candidates (kind, first, second, plane), grouped by corner or edge and plane."""
    kinds, firsts, seconds, planes = table.T
    frames = np.array([[across(body.normals[k]) for body, k in zip((A, B), facets, strict=True)] for facets in facing])
    frames = frames.reshape(-1, 2, 2, 3)
    known = [{k: outline(body, k) for k in set(facets.tolist())} for body, facets in zip((A, B), facing.T, strict=True)]
    in_space = [of_body[k] for facets in facing.tolist() for of_body, k in zip(known, facets, strict=True)]
    outlines = [segments @ frame.T for segments, frame in zip(in_space, frames.reshape(-1, 2, 3), strict=True)]
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
    order, runs, middles, widths = _sorted(boxes[:, 0], boxes[:, 2], np.stack([kinds, owners, planes]))
    kinds, firsts, seconds, planes = (np.ascontiguousarray(column) for column in table[order].T)
    leaders = runs[:-1]
    is_edge = (kinds[leaders] == EDGE_ON_EDGE) & (planes[leaders] >= 0) & (not has_form)
    clearances = np.zeros(len(leaders))
    clearances[is_edge] = hole_clearances(A, B, facing, in_space)[firsts[leaders[is_edge]], planes[leaders[is_edge]]]
    ridges = np.full(len(kinds), -1)
    for kind, body, facets, of_planes in (
        (CORNER_ON_FACET, B, seconds, facing[:, 1]),
        (FACET_ON_CORNER, A, firsts, facing[:, 0]),
    ):
        rows = np.flatnonzero((kinds == kind) & (planes < 0))
        ridges[rows] = _planes_beyond(body, body.facet_planes[of_planes])[body.facet_planes[facets[rows]]]
    centre = A.facets.mean(axis=(0, 1))
    ball = np.append(centre, np.linalg.norm(A.vertices - centre, axis=1).max(initial=0.0))
    return Candidates(
        kinds, firsts, seconds, planes, ridges, facing, runs, middles, widths, CLEARANCE_SHARE * clearances, ball,
        boxes[order], frames, *_in_bands(outlines),
    )  # fmt: skip


def _planes_beyond(body: Polyhedron, planes: Int[Array, " p"]) -> Int[Array, " _"]:
    """Return for each plane of a body the index in `planes` of one beyond a convex edge, -1 for none."""
    beyond = np.full(plane_count(body), -1)
    ends = body.edge_planes[body.convex.astype(bool) & (body.edge_planes >= 0).all(axis=1)]
    for sides in (ends, ends[:, ::-1]):
        for k, plane in enumerate(planes):
            beyond[sides[sides[:, 0] == plane, 1]] = k
    return beyond


def _in_bands(outlines: list[Float[Array, "segment 2 2"]]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the segments (row, 4) of outlines in bands, where bands and outlines begin, and the spans of the outlines."""
    rows, bands, numbers = [np.zeros((0, 4))], [0], [0]
    spans = np.array([[segments[..., 1].min(), segments[..., 1].max()] for segments in outlines]).reshape(-1, 2)
    for segments, (low, high) in zip(outlines, spans, strict=True):
        count = min(BANDS_PER_SEGMENT * len(segments), MAX_BANDS)
        heights = (segments[..., 1] - low) * count / (high - low)
        bottom, top = np.floor(heights.min(axis=1) - ROUNDING), np.floor(heights.max(axis=1) + ROUNDING)
        for band in range(count):
            reaching = segments[(bottom <= band) & (top >= band)].reshape(-1, 4)
            rows.append(reaching)
            bands.append(bands[-1] + len(reaching))
        numbers.append(numbers[-1] + count)
    return np.concatenate(rows), np.array(bands), np.array(numbers), spans


def _sorted(lows: Float[Array, " n"], highs: Float[Array, " n"], keys: Int[Array, "key n"]) -> tuple[np.ndarray, ...]:
    """Return intervals in runs of equal keys: first the wide ones, then the narrow ones in ascending order of their start.

    The first key is the most significant. The results are the order (n,) of the intervals, where runs begin and the end
    (run + 1,), where their narrow intervals begin (run,), and the largest width of a narrow interval (run,).
    """
    if not len(lows):
        return np.zeros(0, dtype=int), np.zeros(1, dtype=int), np.zeros(0, dtype=int), np.zeros(0)
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
    return np.lexsort((lows, ~is_wide, run)), runs, runs[:-1] + wide, narrowest
