"""Contact points that follow curvature, and how far a set of them may be from the faces that it represents.

Between two contact points of a curved face the other part can sink in, by the arc's height over their chord. Along a
straight generator it cannot, however far apart they stand. So triangles of the moving face are halved across the edge whose
middle lies deepest below the line between its ends, as seen from the reference face, until no middle does any more.
"""

import numpy as np

from tolcontact.geometry.surface import Surface

CHORD = 5e-4  # of the smallest tolerance range: how far the faces may sink in between points
HALVINGS = 40
MOST = 5000  # points that curvature may ask for
SOUP = 30_000  # triangles at which halving gives up
ACROSS = 4  # pieces of the smaller face that the first triangles see
PROBES = 1500  # random displacements by which sets of points are compared
TOGETHER = 500
LEAST_STEP = 0.1  # of the smallest tolerance range: the smallest displacement that is tried


def following(own: Surface, target: Surface, *, chord: float, within: float) -> np.ndarray:
    """Points (point, 3) [mm] of the face `own`, so close that `target` cannot sink between them by more than `chord` [mm].

    Only where the faces are within `within` [mm] of each other. At most MOST points; which of more are kept is drawn, with a
    fixed seed, from those that can be the deepest.
    """
    triangles = np.asarray(own.mesh.triangles)
    coarse = np.inf if is_flat(target) else target.mesh.scale / ACROSS
    done = [np.zeros((0, 3))]
    for _ in range(HALVINGS):
        corners, middles = triangles, (triangles + np.roll(triangles, -1, axis=1)) / 2  # edge j: from corner j to j + 1
        d, n, _ = _seen(target, corners)
        d_middle, n_middle, _ = _seen(target, middles)
        sag = (d + np.roll(d, -1, axis=1)) / 2 - d_middle
        # Where both faces curve alike, the chord's error shows only once they are displaced.
        turned = (np.abs(d_middle) + chord / CHORD) * (1 - ((n + np.roll(n, -1, axis=1)) / 2 * n_middle).sum(axis=2))
        length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        near = d_middle - length < within
        error = np.where(near, np.maximum(sag, turned), 0)
        error = np.where(near & (length > coarse), np.maximum(error, length), error)  # too coarse to see anything
        split = error.max(axis=1) > chord
        done.append(triangles[~split].reshape(-1, 3))
        if not split.any() or sum(map(len, done)) / 3 + split.sum() > SOUP:
            done.append(triangles[split].reshape(-1, 3))
            break
        triangles, worst = triangles[split], error[split].argmax(axis=1)
        rows = np.arange(len(triangles))
        a, b, c = (triangles[rows, (worst + k) % 3] for k in range(3))
        middle = middles[split][rows, worst]
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    else:
        done.append(triangles.reshape(-1, 3))
    points = distinct(np.concatenate(done), 1e-9 * own.mesh.scale)
    feet, normals, over = target.project(points)
    reached = over & (np.linalg.norm(points - feet, axis=1) <= within)
    points, feet, normals = points[reached], feet[reached], normals[reached]
    if len(points) > MOST:
        kept = _ever_deepest(_rows(points, feet, normals), within, chord / CHORD)
        points = points[kept[:MOST]]
    return np.asarray(points)


def sampling_error(chosen: np.ndarray, every: np.ndarray, target: Surface, *, unit: float, within: float) -> float:
    """By how much [mm] `target` can sink in between the points `chosen` (point, 3), as the points `every` see it.

    What the deepest of `every` is deeper than the deepest of the chosen ones, after random small displacements: exceeded in
    one of twenty.
    """
    both = np.concatenate([chosen, every])
    feet, normals, over = target.project(both)
    rows = _rows(both, feet, normals)
    own = np.arange(len(both)) < len(chosen)
    deeper = []
    for moves in _moves(within, unit, seed=1):
        gaps = _gaps(rows, moves)
        depth = [np.where((over & some)[:, None], gaps, np.inf).min(axis=0) for some in (own, ~own)]
        both_see = np.isfinite(depth[0]) & np.isfinite(depth[1])
        deeper.append((depth[0] - depth[1])[both_see])
    seen = np.concatenate(deeper)
    return max(0.0, float(np.quantile(seen, 0.95))) if seen.size else 0.0


def facet_error(own: Surface, target: Surface, within: float) -> float:
    """How far [mm] the flat triangles of two faces may lie off the round surfaces that they approximate, near each other.

    The height of an arc over a chord of length l whose ends turn by an angle is l times the angle / 8. What stands for a known
    surface is as far off as that was fitted.
    """
    total = 0.0
    for face, other in ((own, target), (target, own)):
        total += max((surface.residual for surface in face.surfaces), default=0.0)
        rest = face.unknown
        if len(rest.mesh.faces):
            height, length = _chords(rest)
            _, nearest = other.nearest(rest.mesh.triangles_center)
            reach = np.linalg.norm(rest.mesh.triangles_center - nearest, axis=1) - length
            total += float(height.max(where=reach < within, initial=0.0))
    return total


def chord_height(face: Surface) -> float:
    """How far [mm] the triangles of a face may lie off the round surface that they approximate."""
    return float(_chords(face)[0].max(initial=0.0))


def _chords(face: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Heights of the arcs over the longest edges of triangles (face,) [mm], and the lengths of those (face,) [mm]."""
    corners, normals = np.asarray(face.mesh.triangles), face.corner_normals
    along, turn = (np.roll(values, -1, axis=1) - values for values in (corners, normals))
    return np.abs((along * turn).sum(axis=2)).max(axis=1) / 8, np.linalg.norm(along, axis=2).max(axis=1)


def is_flat(surface: Surface) -> bool:
    """Whether all of it lies in one plane."""
    normals = surface.corner_normals.reshape(-1, 3)
    n = normals.mean(axis=0)
    size = np.linalg.norm(n)
    if size == 0:  # it looks all ways, as much to one as to the other
        return False
    heights = np.asarray(surface.mesh.vertices) @ (n / size)
    return bool(np.ptp(heights) < 1e-6 * surface.mesh.scale and (normals @ n).min() > 0)


def _seen(target: Surface, places: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gaps (triangle, 3) [mm], normals (triangle, 3, 3) and whether places (triangle, 3, 3) lie over the target."""
    flat = places.reshape(-1, 3)
    feet, normals, over = target.project(flat)
    gaps = ((flat - feet) * normals).sum(axis=1)
    return gaps.reshape(-1, 3), normals.reshape(-1, 3, 3), over.reshape(-1, 3)


def distinct(points: np.ndarray, apart: float) -> np.ndarray:
    """The points (point, 3) of which no earlier one is the same, but for `apart` [mm]; in their order."""
    # Counted from one of them: far from the origin their numbers would be too large.
    cells = np.round((points - points[:1]) / apart).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    return np.asarray(points[np.sort(first)])


def _rows(points: np.ndarray, feet: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Gaps as functions of small displacements (t, r): rows (point, 7) of n, lever, and the gap at rest [mm]."""
    centre = points.mean(axis=0)
    length = max(float(np.linalg.norm(points - centre, axis=1).max()), 1e-300)
    lever = np.cross(points - centre, normals) / length
    return np.column_stack([normals, lever, ((points - feet) * normals).sum(axis=1)])


def _moves(within: float, unit: float, seed: int) -> list[np.ndarray]:
    """Random displacements (7, move), the last entry 1, of all sizes from a part of the tolerance to the reach of contact."""
    rng = np.random.default_rng(seed)
    least = min(LEAST_STEP * unit, within)
    found = []
    for _ in range(PROBES // TOGETHER):
        direction = rng.normal(size=(6, TOGETHER))
        direction /= np.linalg.norm(direction, axis=0)
        size = np.exp(rng.uniform(np.log(least), np.log(within), TOGETHER))
        found.append(np.vstack([size * direction, np.ones(TOGETHER)]))
    return found


def _gaps(rows: np.ndarray, moves: np.ndarray) -> np.ndarray:
    return np.asarray(rows @ moves)


def _ever_deepest(rows: np.ndarray, within: float, unit: float) -> np.ndarray:
    """Numbers of the points that are the deepest after some displacement, most often first."""
    times = np.zeros(len(rows), dtype=int)
    for seed in (2, 3):
        for moves in _moves(within, unit, seed):
            times += np.bincount(_gaps(rows, moves).argmin(axis=0), minlength=len(rows))
    order = np.argsort(-times, kind="stable")
    return np.asarray(order[times[order] > 0])
