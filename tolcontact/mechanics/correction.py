"""Increments dq = (dt, w) of the free parts, and the poses that they cause. Paper (6), (7), (12)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from tolcontact.mechanics.pose import Number, Pose, Vector, constant, rotation

FREEDOMS = 6


@dataclass(frozen=True, eq=False)
class Mobility:
    """How a part of a group can move: by the increments of free parts.

    movers    positions, among the group's movers, of the free parts whose increments move it; parts it is located on come first
    centre    nominal centre of rotation (3,) [mm] of its increments: the centroid of its contact points
    is_reference  whether other parts rest on it
    """

    movers: tuple[int, ...]
    centre: Vector
    is_reference: bool


@dataclass(frozen=True, eq=False)
class Twist:
    """Displacement x -> d + W x (x - c) of all points of a part; c and d (3, 1) [mm], W (3, 1) [rad]."""

    c: ca.SX
    d: ca.SX
    W: ca.SX

    def at(self, x: ca.SX) -> ca.SX:
        """Return the displacement of a point at x (3, 1) [mm]."""
        return self.d + ca.cross(self.W, x - self.c)

    def moving(self, X: Pose, dR: ca.SX) -> Pose:
        """Return a pose after the motion x -> c + d + dR (x - c)."""
        return Pose(dR @ X.R, dR @ (X.t - self.c) + self.c + self.d)


@dataclass(frozen=True, eq=False)
class Motion:
    """The increments of the movers of a group, about the present `poses` of its parts."""

    mobilities: Sequence[Mobility]
    poses: Sequence[Pose]
    movers: Sequence[Twist]

    def by(self, update: Callable[[Mobility, Pose, Sequence[Twist]], Pose]) -> list[Pose]:
        """Return the poses after the increments, by the rule `linear`, `rigid`, `quadratic` or `published`."""
        return [update(part, X, self.movers) for part, X in zip(self.mobilities, self.poses, strict=True)]


def increments(scaled: ca.SX, length: Number, centres: Sequence[ca.SX]) -> list[Twist]:
    """Return the increments of the movers from the QP's variables, all of them in mm: (dt, length * w) for each mover."""
    return [Twist(c, z[:3], z[3:] / length) for c, z in zip(centres, ca.vertsplit(scaled, FREEDOMS), strict=True)]


def linear(part: Mobility, X: Pose, movers: Sequence[Twist]) -> Pose:
    """Return the pose after the increments to first order, affine in them: R <- (I + [W]x) R, paper (12)."""
    twist = _total(part, X, movers)
    return twist.moving(X, ca.SX.eye(3) + ca.skew(twist.W))


def rigid(part: Mobility, X: Pose, movers: Sequence[Twist]) -> Pose:
    """Return the pose after rigid motions R <- exp([w]x) R: first of the part, then of the parts that it is located on."""
    for mover in reversed(part.movers):
        X = movers[mover].moving(X, rotation(movers[mover].W))
    return X


def quadratic(part: Mobility, X: Pose, movers: Sequence[Twist]) -> Pose:
    """Return the pose of `rigid` to second order in the increments."""
    for mover in reversed(part.movers):
        K = ca.skew(movers[mover].W)
        X = movers[mover].moving(X, ca.SX.eye(3) + K + K @ K / 2)
    return X


def published(part: Mobility, X: Pose, movers: Sequence[Twist]) -> Pose:
    """Return the pose of paper (12), which keeps the linearized gap exactly; a reference part is rotated by exp([W]x).

    Equation (12) would stretch a reference part, and its normals (4) would no longer be normal to it. To first order both
    updates agree.
    """
    if not part.is_reference:
        return linear(part, X, movers)
    twist = _total(part, X, movers)
    return twist.moving(X, rotation(twist.W))


def _total(part: Mobility, X: Pose, movers: Sequence[Twist]) -> Twist:
    """Return the sum of the twists of all movers of a part, about the part's centre."""
    c = X.apply(constant(part.centre))
    d, W = ca.SX.zeros(3), ca.SX.zeros(3)
    for mover in part.movers:
        d, W = d + movers[mover].at(c), W + movers[mover].W
    return Twist(c, d, W)
