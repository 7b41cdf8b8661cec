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
    around a ball or shaft, its tangent planes have contact points on all sides, which is as good. An end of a shaft's axis has
    no radius, since the other end holds the shaft.
    """
    if pair.round is None or not pair.round.are_beside:
        return CountedPoints(pair.P_m, np.zeros(len(pair.P_m))), CountedPoints(pair.P_r, np.zeros(len(pair.P_r)))
    moving, reference = zip(*(point.centres() for point in pair.round), strict=True)
    is_end, on_moving = pair.round.points["axis"].any(axis=1), pair.round.points["on_moving"]
    return _spheres(moving, is_end & on_moving), _spheres(reference, is_end & ~on_moving)


def _spheres(balls: Sequence[Ball], is_end: np.ndarray) -> CountedPoints:
    radii = np.where(is_end, 0.0, [ball.radius for ball in balls])
    return CountedPoints(np.array([ball.centre for ball in balls]), radii)
