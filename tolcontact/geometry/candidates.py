"""Candidate contact points of two bodies: planes that face each other, their outlines and holes, and the order of a search."""

import numpy as np
import trimesh

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.geometry.kernel import CORNER_ON_FACET, EDGE_ON_EDGE, FACET_ON_CORNER
from tolcontact.geometry.places_kernel import Candidates
from tolcontact.geometry.polyhedron import Polyhedron
from tolcontact.geometry.triangle_mesh import edges

WIDE_SHARE = 1 / 8  # of the whole range: wider intervals come first
CLEARANCE_SHARE = 0.5  # of the distance of a hole from other outlines: bodies move by less, with room for their tilt
BANDS_PER_SEGMENT = 2  # of an outline
MAX_BANDS = 1024
ROUNDING = 1e-9  # bands: segments that end this close to a band are in it
MAX_COMPARISONS = 1_000_000  # of segments of two loops: finer ones count as if they met
FACING = -0.99  # cosine of the angle between the normals of planes that face each other
STRAIGHT = 1e-6  # rad: a larger interior angle than a straight one is reflex


def sorted_candidates(
    A: Polyhedron, B: Polyhedron, table: Int[Array, "c 4"], facing: Int[Array, "p 2"], *, has_form: bool
) -> Candidates:
    """Return candidates (kind, first, second, plane), grouped by corner or edge and plane."""
    kinds, firsts, seconds, planes = table.T
    frames = np.array([[across(body.normals[k]) for body, k in zip((A, B), facets, strict=True)] for facets in facing])
    frames = frames.reshape(-1, 2, 2, 3)
    in_space = [outline(body, k) for facets in facing for body, k in zip((A, B), facets, strict=True)]
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
    beyond = np.full(_plane_count(body), -1)
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
    for plane, facets in enumerate(facing):
        normals = A.normals[facets[0]], B.normals[facets[1]]
        frame = across(normals[1])
        loops, are_holes = [], list[bool]()
        for segments, normal in zip(outlines[2 * plane : 2 * plane + 2], normals, strict=True):
            of_body = _loops(segments)
            loops += of_body
            are_holes += [_is_hole(loop, normal) for loop in of_body]
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


def facing_planes(A: Polyhedron, B: Polyhedron, passed: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of facing planes in a table (plane of A + 1, plane of B + 1), -1 for others, and their facets (n, 2).

    The last row and column mean no plane. Only planes count that are nominally near each other and through which the bodies
    may have penetrated each other: the planes at the ends of a short overlap are already beyond each other.

    passed, height   [mm]: the largest depth and the largest gap of planes that face each other
    """
    table, facets = np.full((_plane_count(A) + 1, _plane_count(B) + 1), -1), list[tuple[int, int]]()
    planes_A, firsts_A = np.unique(A.facet_planes, return_index=True)
    planes_B, firsts_B = np.unique(B.facet_planes, return_index=True)
    cosines = A.normals[firsts_A] @ B.normals[firsts_B].T
    for i, j in np.argwhere(cosines < FACING):
        heights = (A.facets[A.facet_planes == planes_A[i]] - B.facets[firsts_B[j], 0]) @ B.normals[firsts_B[j]]
        if heights.max() >= -passed and heights.min() <= height:
            table[planes_A[i], planes_B[j]] = len(facets)
            facets.append((int(firsts_A[i]), int(firsts_B[j])))
    return table, np.array(facets, dtype=np.int64).reshape(-1, 2)


def _plane_count(body: Polyhedron) -> int:
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
        for plane, facet in enumerate(facets[:, side]):
            of_plane = np.flatnonzero((planes == plane) & (kinds == kind))
            moot[of_plane] = (_reflex_corners(body, facet) & ~is_engaged)[numbers[of_plane]]
    return moot


def _reflex_corners(body: Polyhedron, facet: int) -> Bool[Array, " v"]:
    """Return at which corners the plane of a facet has a single interior angle, of more than 180 degrees (v,)."""
    corners, numbers, rim = plane_of(body, facet)
    angles = np.bincount(numbers.ravel(), weights=trimesh.triangles.angles(corners[numbers]).ravel())
    on_rim = np.bincount(rim.ravel(), minlength=len(corners))
    reflex = corners[(angles > np.pi + STRAIGHT) & (on_rim == 2)]
    _, same = np.unique(np.concatenate([reflex, body.vertices]), axis=0, return_inverse=True)
    return np.isin(same.ravel()[len(reflex) :], same.ravel()[: len(reflex)])
