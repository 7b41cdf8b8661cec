"""Places at which faces that end can touch, with the heights of their forms there.

Planes that end touch at the corners of their overlap. With form they also touch between these, so that contact points over the
reference face are places, too.
"""

from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Float, Int
from tolcontact.discretization.nominal import ContactPoints
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


def _points(
    pair: ContactPoints, X_RM: np.ndarray, deviations: np.ndarray, retained: np.ndarray | None
) -> tuple[Places, np.ndarray]:
    """Return contact points over the reference face as places, and the heights (n, place) [mm] of the forms there.

    These are the `retained` ones, and the lowest of each group.
    """
    gaps = ((pose.apply(X_RM, pair.P_m) - pair.P_r) * pair.n_r).sum(axis=2)
    heights = pair.form(deviations).at_all(pair.P_m, pair.P_r)
    numbers = _lowest_over(pair, X_RM, gaps - heights)
    if retained is not None:
        kept = np.where(retained >= FIRST_POINT, retained - FIRST_POINT, -1)
        numbers = np.concatenate([np.where(_is_over(pair, X_RM, kept), kept, -1), numbers], axis=1)
    for column in range(1, numbers.shape[1]):
        numbers[(numbers[:, :column] == numbers[:, column, None]).any(axis=1), column] = -1
    row, is_point = np.arange(len(X_RM))[:, None], numbers >= 0
    P_m, P_r, n_r = (values[numbers] for values in (pair.P_m, pair.P_r, pair.n_r))
    labels = np.where(is_point, numbers + FIRST_POINT, -1)
    return Places(labels, np.where(is_point, gaps[row, numbers], np.inf), P_m, P_r, n_r), heights[row, numbers] * is_point


def _lowest_over(pair: ContactPoints, X_RM: np.ndarray, gaps: np.ndarray) -> np.ndarray:
    """Return the point of each group (n, group) with the least of the gaps (n, point) over the reference face; -1 for none."""
    groups = np.array_split(np.arange(len(pair.P_m)), min(POINT_GROUPS, len(pair.P_m)))
    numbers = np.full((len(X_RM), len(groups)), -1)
    for place, group in enumerate(groups):
        remaining, left = np.arange(len(X_RM)), gaps[:, group].copy()
        while remaining.size:
            lowest = left[remaining].argmin(axis=1)
            remaining = remaining[left[remaining, lowest] < np.inf]
            lowest = left[remaining].argmin(axis=1)
            is_over = _is_over(pair, X_RM[remaining], group[lowest][:, None])[:, 0]
            numbers[remaining[is_over], place] = group[lowest[is_over]]
            left[remaining[~is_over], lowest[~is_over]] = np.inf
            remaining = remaining[~is_over]
    return numbers


def _is_over(pair: ContactPoints, X_RM: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Return whether points with numbers (n, place), -1 for none, stand over the reference face at X_RM (n, 12)."""
    is_over = numbers >= 0
    row, place = np.nonzero(is_over)
    if row.size and pair.reference_face is not None:
        points = np.einsum("kij,kj->ki", pose.rotation(X_RM)[row], pair.P_m[numbers[row, place]])
        is_over[row, place] = pair.reference_face.project(points + pose.translation(X_RM)[row])[2]
    return is_over
