"""What objectives count of a contact pair: contact points, but of round faces their centres. Nominal assembly frame, mm."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tolcontact.discretization.nominal import ContactPoints
from tolcontact.discretization.round_points import Ball


class CountedPoints(NamedTuple):
    """Points (point, 3) whose displacement an objective counts, each as that of a sphere with a radius (point,) [mm]."""

    points: np.ndarray
    radii: np.ndarray


def counted_points(pair: ContactPoints) -> tuple[CountedPoints, CountedPoints]:
    """Return the points of the moving and of the reference part.

    A point on a round face would leave its part free to roll: it could move aside at no cost until it is clear. Where a wall is
    around a ball or shaft, its tangent planes have contact points on all sides, which is as good.
    """
    if pair.round is None or not pair.round.are_beside:
        return CountedPoints(pair.P_m, np.zeros(len(pair.P_m))), CountedPoints(pair.P_r, np.zeros(len(pair.P_r)))
    moving, reference = zip(*(point.centres() for point in pair.round), strict=True)
    return _spheres(moving), _spheres(reference)


def _spheres(balls: Sequence[Ball]) -> CountedPoints:
    return CountedPoints(np.array([ball.centre for ball in balls]), np.array([ball.radius for ball in balls]))
