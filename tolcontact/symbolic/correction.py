"""Increments dq = (dt, w) of the free parts, and the poses and displacements that they cause. Paper (6), (7), (12)."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from tolcontact.symbolic.pose import Pose, rotation

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


def increments(scaled: ca.SX, length: float, centres: Sequence[ca.SX]) -> list[Twist]:
    """The increments of the movers from the QP's variables, all of them in mm: (dt, length * w) for each mover."""
    return [Twist(c, z[:3], z[3:] / length) for c, z in zip(centres, ca.vertsplit(scaled, FREEDOMS), strict=True)]


def total(part: Carried, raw: Pose, movers: Sequence[Twist]) -> Twist:
    """What all its movers together do to a part, about its own centre."""
    c = raw.place(ca.DM(part.centre))
    d, W = ca.SX.zeros(3), ca.SX.zeros(3)
    for mover in part.movers:
        d, W = d + movers[mover].at(c), W + movers[mover].W
    return Twist(c, d, W)


def corrected(part: Carried, raw: Pose, twist: Twist) -> Pose:
    """The updated pose: R <- (I + [W]x) R, paper (12), which keeps the linearized gap exactly.

    A part that others rest on turns by exp([W]x) instead: stretched by (12), its normals (4) would no longer be
    normal to it. To first order the two agree.
    """
    turn = rotation(twist.W) if part.is_reference else ca.SX.eye(3) + ca.skew(twist.W)
    return Pose(turn @ raw.R, turn @ (raw.t - twist.c) + twist.c + twist.d)
