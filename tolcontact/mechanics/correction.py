"""Increments dq = (dt, w) of the free parts, the poses that they cause, and energies of displacements. Paper (6), (7), (12).

The displacement energy of a set of points follows from its ten moments. The moments of points P about a nominal centre c are N,
sum (P - c) and the six distinct entries of sum (P - c)(P - c)'. They suffice for every weighting and any number of points.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from tolcontact.mechanics.pose import Number, Pose, Vector, constant, rotation

FREEDOMS = 6
MOMENTS = 10
_UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


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


def moment_table(P: np.ndarray, centre: np.ndarray, radii: np.ndarray | float = 0.0) -> np.ndarray:
    """Return the moments (moment, point) of each of the points P (point, 3) [mm] about `centre`.

    A point represents all points of a sphere around it, with a radius from `radii` (point,) [mm].
    """
    p, mean_square = (P - centre).T, np.asarray(radii) ** 2 / 3  # of a coordinate on a sphere
    return np.vstack([np.ones(len(P)), p, *(p[i] * p[j] + (mean_square if i == j else 0.0) for i, j in _UPPER)])


def moments_about(centre: np.ndarray, moments: np.ndarray, other_centre: np.ndarray) -> np.ndarray:
    """Return the moments (10,) of points about a centre (3,) [mm] from their `moments` (10,) about another centre (3,)."""
    count, first_moment, offset = moments[0], moments[1:4], other_centre - centre
    change = np.outer(offset, first_moment) + np.outer(first_moment, offset) + count * np.outer(offset, offset)
    return np.concatenate([[count], first_moment + count * offset, moments[4:] + [change[i, j] for i, j in _UPPER]])


def central_moments(centre: np.ndarray, moments: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the centre (3,) [mm] of points with given `moments` (10,) about another one, and their mean products (3, 3)."""
    offset, products = moments[1:4] / moments[0], np.zeros((3, 3))
    for value, (i, j) in zip(moments[4:], _UPPER, strict=True):
        products[i, j] = products[j, i] = value
    return centre + offset, products / moments[0] - np.outer(offset, offset)


def displacement_energy(moments: ca.SX, centre: Vector, start: Pose, end: Pose) -> ca.SX:
    """Return 1/2 sum |x_end - x_start|^2 [mm^2] over the points with the given `moments` (10, 1); it is quadratic in `end`.

    The displacement is x_end - x_start = a + D (P - c), with the displacement a of the centre and the difference D of the
    rotations.
    """
    count, first_moment = moments[0], moments[1:4]
    second_moment = ca.SX.zeros(3, 3)
    for k, (i, j) in enumerate(_UPPER):
        second_moment[i, j] = second_moment[j, i] = moments[4 + k]
    a = end.apply(constant(centre)) - start.apply(constant(centre))
    D = end.R - start.R
    return count * ca.dot(a, a) / 2 + ca.dot(a, D @ first_moment) + ca.trace(D @ second_moment @ D.T) / 2
