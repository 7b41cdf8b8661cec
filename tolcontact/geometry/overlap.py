"""Where the rim of one face lies under or over the other face: there they touch first, whatever the tilt."""

import numpy as np

from tolcontact.geometry.edges import edges, rim
from tolcontact.geometry.surface import Surface

MOST = 2000  # edges of a rim; beyond that its corners are everywhere, and points spread evenly meet them
STRAIGHT = np.radians(1.0)
INWARD = 1e-5  # of the face's size: points of a rim are taken so far inside of it
DROPS = 8  # turns after which a point that drops onto a curved face has arrived


def overlap_corners(own: Surface, target: Surface) -> np.ndarray:
    """Points (corner, 3) [mm] of the face `own`: below or above corners of the rim of `target`, and where both rims cross.

    Corners of its own rim are not among them.
    """
    own_rim, target_rim = (rim(np.asarray(face.mesh.faces)) for face in (own, target))
    nothing = np.zeros((0, 3))
    if not (0 < len(own_rim) <= MOST and 0 < len(target_rim) <= MOST):
        return nothing
    n = target.corner_normals.reshape(-1, 3).mean(axis=0)
    n /= np.linalg.norm(n)
    along = np.linalg.svd(n[None])[2][1:]
    # Both rims seen along the normal.
    (a, b), (c, d) = (
        np.asarray(face.mesh.vertices)[ends].swapaxes(0, 1) for face, ends in ((own, own_rim), (target, target_rim))
    )
    p, r = a @ along.T, (b - a) @ along.T
    q, s = c @ along.T, (d - c) @ along.T
    cross = r[:, None, 0] * s[None, :, 1] - r[:, None, 1] * s[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = q[None] - p[:, None]
        on_own = (apart[..., 0] * s[None, :, 1] - apart[..., 1] * s[None, :, 0]) / cross
        on_target = (apart[..., 0] * r[:, None, 1] - apart[..., 1] * r[:, None, 0]) / cross
    lengths = np.linalg.norm(r, axis=1)[:, None] * np.linalg.norm(s, axis=1)[None]
    crosses = (np.abs(cross) > STRAIGHT * lengths) & (on_own >= 0) & (on_own <= 1) & (on_target >= 0) & (on_target <= 1)
    first, second = np.nonzero(crosses)
    crossings = a[first] + on_own[first, second, None] * (b - a)[first]
    # Corners of the other rim, moved along its normal into this face.
    normal = own.corner_normals.reshape(-1, 3).mean(axis=0)
    corners = np.asarray(target.mesh.vertices)[np.unique(target_rim)]
    if abs(n @ normal) < STRAIGHT:
        return np.asarray(crossings)
    height = (np.asarray(own.mesh.vertices)[0] - corners) @ normal / (n @ normal)
    below = corners + height[:, None] * n
    _, _, over = own.project(below)
    return np.asarray(np.concatenate([crossings, below[over]]))


def rim_points(own: Surface, target: Surface, step: float, within: float) -> np.ndarray:
    """Points (point, 3) [mm] of the curved face `own` over the rim of the flat face `target`, some `step` [mm] apart.

    Only where the faces are within `within` [mm] of each other.
    """
    faces, vertices = np.asarray(target.mesh.faces), np.asarray(target.mesh.vertices)
    ends, edge, triangles = edges(faces)
    outer = np.flatnonzero(triangles[edge] == 1)
    n = target.corner_normals.reshape(-1, 3).mean(axis=0)
    n /= np.linalg.norm(n)
    places = []
    length = np.linalg.norm(vertices[ends[outer, 1]] - vertices[ends[outer, 0]], axis=1)
    step = max(step, float(length.sum()) / MOST)
    for number, size in zip(outer, length, strict=True):
        a, b = vertices[ends[number]]
        inward = np.cross(n, b - a) / max(size, 1e-300)
        inward *= np.sign(inward @ (vertices[faces[number // 3]].mean(axis=0) - a))
        share = np.linspace(0, 1, max(int(np.ceil(size / step)), 1) + 1)[:, None]
        places.append(a + share * (b - a) + INWARD * target.mesh.scale * inward)
    start = np.concatenate(places)
    over = start
    for _ in range(DROPS):
        _, feet = own.nearest(over)
        over = start + ((feet - start) @ n)[:, None] * n
    arrived = np.linalg.norm(over - feet, axis=1) < 0.1 * INWARD * target.mesh.scale
    near = np.linalg.norm(over - start, axis=1) <= within
    return np.asarray(feet[arrived & near])
