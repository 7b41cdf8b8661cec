"""Places at which faces that end can touch, with the heights of their forms there.

Planes that end touch at the corners of their overlap. With form they also touch between these, so that contact points over the
reference face are places, too.
"""

from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Float, Int
from tolcontact.discretization.nominal import ContactPoints
from tolcontact.geometry import region_kernel
from tolcontact.geometry.meeting import NEARNESS, Meeting, Places

FIRST_POINT = 1 << 40  # number of the first contact point among the labels of places
POINT_GROUPS = 12  # of neighbouring contact points; the lowest of each group counts


class RaisedPlaces(NamedTuple):
    """Places, and the heights (n, place) [mm] by which gaps there are smaller than those of nominal faces."""

    places: Places
    heights: Float[Array, "n p"]

    @property
    def gaps(self) -> Float[Array, "n p"]:
        """The gaps (n, place) [mm] of the faces as they are, infinite where there is no place."""
        return np.asarray(self.places.gaps - self.heights)


def raised_places(
    pair: ContactPoints,
    meeting: Meeting,
    X_RM: Float[Array, "n 12"],
    deviations: Float[Array, "n contributor"],
    retained: Int[Array, "n k"] | None = None,
    error: float = 0.0,
    nearness: float = NEARNESS,
) -> RaisedPlaces:
    """Return the places at which a pair can touch at X_RM (n, 12), see Meeting.at, for deviations (n, contributor)."""
    grown = pair.heights(deviations)[:, None]
    if not pair.has_form:
        places = meeting.at(X_RM, retained, error, nearness)
        return RaisedPlaces(places, np.broadcast_to(grown, places.gaps.shape))
    at_ends = None if retained is None else np.where(retained < FIRST_POINT, retained, -1)
    ends = meeting.at(X_RM, at_ends, error, nearness)
    row, place = np.nonzero(np.isfinite(ends.gaps))
    heights = np.zeros(ends.gaps.shape)
    heights[row, place] = pair.form(deviations).at(row, ends.P_m[row, place], ends.P_r[row, place])
    points, of_points = _points(pair, X_RM, deviations, retained)
    joined = [np.concatenate(arrays, axis=1) for arrays in zip(ends, points, strict=True)]
    return RaisedPlaces(Places(*joined), grown + np.concatenate([heights, of_points], axis=1))


class FacePoints(NamedTuple):
    """Points between the ends of two planes: contact points, and then points of the rim of the reference face.

    P_m, P_r   (n, point, 3) [mm] on both nominal faces
    gaps       (n, point) [mm] of nominal faces, along the normal of the reference face
    """

    P_m: Float[Array, "n point 3"]
    P_r: Float[Array, "n point 3"]
    gaps: Float[Array, "n point"]


def face_points(pair: ContactPoints, X_RM: Float[Array, "n 12"]) -> FacePoints:
    """Return contact points, which move with the moving face, and rim points of the reference face, at X_RM (n, 12)."""
    gaps = ((pose.apply(X_RM, pair.P_m) - pair.P_r) * pair.n_r).sum(axis=2)
    P_m, P_r = (np.broadcast_to(points, (*gaps.shape, 3)) for points in (pair.P_m, pair.P_r))
    rim, n, (m, corner) = pair.reference_rim, pair.n_r[0], pair.moving_plane
    back, along = pose.apply(pose.inverse(X_RM), rim), n @ pose.rotation(X_RM)  # (n, rim point, 3), (n, 3)
    heights = ((corner - back) @ m) / (along @ m)[:, None]
    return FacePoints(
        np.concatenate([P_m, back + heights[..., None] * along[:, None]], axis=1),
        np.concatenate([P_r, np.broadcast_to(rim, back.shape)], axis=1),
        np.concatenate([gaps, heights], axis=1),
    )


def _points(
    pair: ContactPoints, X_RM: np.ndarray, deviations: np.ndarray, retained: np.ndarray | None
) -> tuple[Places, np.ndarray]:
    """Return points between the ends of the faces as places, and the heights (n, place) [mm] of the forms there.

    These are the `retained` ones, and the lowest of each group.
    """
    points, form, count = face_points(pair, X_RM), pair.form(deviations), len(pair.P_m)
    rim = np.ascontiguousarray(points.P_m[:, count:])
    row = np.repeat(np.arange(len(X_RM)), rim.shape[1])
    at_rim = form.at(row, rim.reshape(-1, 3), points.P_r[:, count:].reshape(-1, 3)).reshape(rim.shape[:2])
    heights = np.concatenate([pair.form_heights(deviations), at_rim], axis=1)
    assert pair.reference_face is not None and pair.moving_face is not None
    regions = pair.reference_face.region, pair.moving_face.region
    poses, gaps = np.ascontiguousarray(X_RM), points.gaps - heights
    groups = np.cumsum([0, *map(len, np.array_split(np.arange(gaps.shape[1]), min(POINT_GROUPS, gaps.shape[1])))])
    numbers = np.empty((len(poses), len(groups) - 1), dtype=np.int64)
    region_kernel.lowest_over(poses, pair.P_m, rim, gaps, groups, *regions, numbers)
    if retained is not None:
        kept = np.where(retained >= FIRST_POINT, retained - FIRST_POINT, -1)
        region_kernel.keep_over(poses, pair.P_m, rim, *regions, kept)
        numbers = np.concatenate([kept, numbers], axis=1)
    for column in range(1, numbers.shape[1]):
        numbers[(numbers[:, :column] == numbers[:, column, None]).any(axis=1), column] = -1
    rows, is_point = np.arange(len(X_RM))[:, None], numbers >= 0
    labels, gaps = np.where(is_point, numbers + FIRST_POINT, -1), np.where(is_point, points.gaps[rows, numbers], np.inf)
    n_r = np.broadcast_to(pair.n_r[0], (*numbers.shape, 3))
    places = Places(labels, gaps, points.P_m[rows, numbers], points.P_r[rows, numbers], n_r)
    return places, heights[rows, numbers] * is_point
