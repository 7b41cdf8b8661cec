"""Increments dq = (dt, w) of the free parts, and the poses that they cause. Paper (6), (7), (12)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from tolcontact.mechanics.pose import Pose, rotation

FREEDOMS = 6


@dataclass(frozen=True, eq=False)
class Carried:
    """A part of a group and what may move it.

    movers    the free parts whose increments move it, those that it is located on first; positions in the group's movers
    centre    the point (3,) [mm], nominal, about which its increments turn: the centroid of its contact points
    is_reference  whether other parts rest on it
    """

    movers: tuple[int, ...]
    centre: np.ndarray
    is_reference: bool


@dataclass(frozen=True, eq=False)
class Twist:
    """Displacement x -> d + W x (x - c) of all points of a part; c and d (3, 1) [mm], W (3, 1) [rad]."""

    c: ca.SX
    d: ca.SX
    W: ca.SX

    def at(self, x: ca.SX) -> ca.SX:
        """Displacement of a point at x (3, 1) [mm]."""
        return self.d + ca.cross(self.W, x - self.c)

    def moving(self, X: Pose, turn: ca.SX) -> Pose:
        """Return a pose after the motion x -> c + d + turn (x - c)."""
        return Pose(turn @ X.R, turn @ (X.t - self.c) + self.c + self.d)


@dataclass(frozen=True, eq=False)
class Motion:
    """The increments of the movers of a group, about the poses `now` of its parts."""

    carried: Sequence[Carried]
    poses: Sequence[Pose]
    movers: Sequence[Twist]

    def by(self, update: Callable[[Carried, Pose, Sequence[Twist]], Pose]) -> list[Pose]:
        """Return the poses that the increments cause, as `linear`, `rigid`, `quadratic` or `published` has it."""
        return [update(part, X, self.movers) for part, X in zip(self.carried, self.poses, strict=True)]


def increments(scaled: ca.SX, length: float, centres: Sequence[ca.SX]) -> list[Twist]:
    """Return the increments of the movers from the QP's variables, all of them in mm: (dt, length * w) for each mover."""
    return [Twist(c, z[:3], z[3:] / length) for c, z in zip(centres, ca.vertsplit(scaled, FREEDOMS), strict=True)]


def linear(part: Carried, X: Pose, movers: Sequence[Twist]) -> Pose:
    """Return the pose after the increments to first order, affine in them: R <- (I + [W]x) R, paper (12)."""
    twist = _total(part, X, movers)
    return twist.moving(X, ca.SX.eye(3) + ca.skew(twist.W))


def rigid(part: Carried, X: Pose, movers: Sequence[Twist]) -> Pose:
    """Return the pose after the increments as rigid motions: R <- exp([w]x) R for its own, then for those that carry it."""
    for mover in reversed(part.movers):
        X = movers[mover].moving(X, rotation(movers[mover].W))
    return X


def quadratic(part: Carried, X: Pose, movers: Sequence[Twist]) -> Pose:
    """What `rigid` gives, to second order in the increments."""
    for mover in reversed(part.movers):
        K = ca.skew(movers[mover].W)
        X = movers[mover].moving(X, ca.SX.eye(3) + K + K @ K / 2)
    return X


def published(part: Carried, X: Pose, movers: Sequence[Twist]) -> Pose:
    """Paper (12), which keeps the linearized gap exactly; but a part that others rest on turns by exp([W]x).

    Stretched by (12), the normals (4) of a reference part would no longer be normal to it. To first order the two agree.
    """
    if not part.is_reference:
        return linear(part, X, movers)
    twist = _total(part, X, movers)
    return twist.moving(X, rotation(twist.W))


def _total(part: Carried, X: Pose, movers: Sequence[Twist]) -> Twist:
    """What all its movers together do to a part, about its own centre."""
    c = X.apply(ca.DM(part.centre))
    d, W = ca.SX.zeros(3), ca.SX.zeros(3)
    for mover in part.movers:
        d, W = d + movers[mover].at(c), W + movers[mover].W
    return Twist(c, d, W)
