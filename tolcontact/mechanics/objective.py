"""The objectives that the corrected pose minimizes, and their regularization. Paper (9), (11).

All of them are quadratic in the poses. A linear step about any pose therefore has the same quadratic term as one from the raw
state. In the exact resolution (repeated steps) the linear term holds the residuals from the raw state.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from tolcontact.mechanics.displacement import MOMENTS, displacement_energy, moments_about
from tolcontact.mechanics.groups import Group, Side
from tolcontact.mechanics.placement import elongation
from tolcontact.mechanics.pose import Pose, Vector, constant, relative
from tolcontact.mechanics.setting import Setting
from tolcontact.method import Method

# Seating: the share of the forces that the quadratic term carries when all points have moved by the group's length. It is small
# enough for the contacts to carry nearly the whole load, and large enough for the solvers.
SEATING_SHARE = 1e-3


class Energy(NamedTuple):
    """An objective divided by `scale`, so that it does not depend on the number of points, springs or newtons.

    value      [mm^2], or [mm] for seating
    scale      multipliers times this are reactions: [1] for points, [N/mm] for springs, [N] for forces
    """

    value: ca.SX
    scale: ca.SX


def energy(setting: Setting, poses: Sequence[Pose]) -> Energy:
    """Return the objective at `poses`, which are affine in the increments."""
    scale = objective_scale(setting.group, setting.method, setting.moments) if setting.scale is None else setting.scale
    return Energy(_VALUES[setting.method.objective](setting, poses, scale), scale)


def objective_scale(group: Group, method: Method, moments: ca.SX) -> ca.SX:
    """Return the scale of the objective: of points their number, by the moments (10, side) of those that count, at least 1.

    Of springs it is the sum of their stiffness [N/mm], of forces that of their sizes [N]; 1 without any.
    """
    if method.minimizes.counts_points:
        return ca.fmax(ca.sum2(moments[0, :]), 1)
    if method.minimizes.presses:
        return ca.SX(sum(float(np.linalg.norm(load.vector)) for load in group.loads) or 1.0)
    return ca.SX(sum(float(k) for hold in group.holds for k in hold.stiffness) or 1.0)


def proximity(setting: Setting, start: Sequence[Pose], end: Sequence[Pose]) -> ca.SX:
    """Return half the mean squared displacement of all contact points [mm^2] between two poses."""
    energies = (_displaced(setting, points, start, end) for points in _points_of_parts(setting.group))
    return sum(energies, ca.SX(0)) / setting.group.count


def _points(setting: Setting, poses: Sequence[Pose], scale: ca.SX) -> ca.SX:
    """Return the mean displacement energy of the points that count."""
    value = setting.firmness * _regularization(setting, poses)
    for k, side in enumerate(setting.group.sides):
        value += displacement_energy(setting.moments[:, k], side.centre, setting.raw[side.part], poses[side.part])
    return value / scale


def _springs(setting: Setting, poses: Sequence[Pose], scale: ca.SX) -> ca.SX:
    """Return the energy 1/2 sum k e^2 [N mm] of the movers' two-sided locators, divided by the sum of the k [N/mm]."""
    regularization = setting.firmness * _regularization(setting, poses)
    value = ca.SX(0)
    for hold in setting.group.holds:
        start_elongation, end_elongation = (elongation(setting, hold, poses, linear=True) for poses in (setting.raw, poses))
        for k, e in zip(hold.stiffness, ca.vertsplit(end_elongation - start_elongation), strict=True):
            value += k * e**2 / 2
    return value / scale + regularization / setting.group.count


def _forces(setting: Setting, poses: Sequence[Pose], scale: ca.SX) -> ca.SX:
    """Return the negative work of the declared forces [N mm], divided by the sum of their sizes [N]."""
    work = ca.SX(0)
    for load in setting.group.loads:
        p = constant(load.point)
        work += ca.dot(constant(load.vector), poses[load.part].apply(p) - setting.raw[load.part].apply(p))
    quadratic = setting.firmness * SEATING_SHARE * proximity(setting, setting.raw, poses) / setting.group.length
    return quadratic - work / scale


_VALUES: dict[str, Callable[[Setting, Sequence[Pose], ca.SX], ca.SX]] = {
    "active points": _points,
    "all points": _points,
    "locator stiffness": _springs,
    "seating": _forces,
}


def _regularization(setting: Setting, poses: Sequence[Pose]) -> ca.SX:
    return sum(
        (setting.method.eta * term for term in _REGULARIZATIONS[setting.method.regularization](setting, poses)), ca.SX(0)
    )


def _point_energies(setting: Setting, poses: Sequence[Pose]) -> list[ca.SX]:
    """Return the displacement energy of all contact points of each side."""
    return [_displaced(setting, _points_of_side(side), setting.raw, poses) for side in setting.group.sides]


def _identity_energies(setting: Setting, poses: Sequence[Pose]) -> list[ca.SX]:
    """Return the energies of the paper's eta I: translations [mm] and rotations [rad] of the movers."""
    energies = []
    for part in map(setting.group.position, setting.group.free):
        dt, D = poses[part].t - setting.raw[part].t, poses[part].R - setting.raw[part].R
        energies.append((ca.dot(dt, dt) + ca.sumsqr(D) / 2) / 2)  # |[w]x|^2 = 2 |w|^2
    return energies


_REGULARIZATIONS = {"points": _point_energies, "identity": _identity_energies}


class _PartPoints(NamedTuple):
    """Contact points of a part of the group, by their moments (10,) about a nominal centre (3,) [mm]."""

    part: int
    centre: Vector
    moments: Vector


def _points_of_parts(group: Group) -> list[_PartPoints]:
    """Return all contact points, together those of each part, or those of each side where moments are symbols."""
    sides = [_points_of_side(side) for side in group.sides]
    together: dict[int, _PartPoints] = {}
    for points in sides:
        if isinstance(points.centre, ca.SX) or isinstance(points.moments, ca.SX):
            return sides
        first = together.get(points.part, points._replace(moments=np.zeros(MOMENTS)))
        moments = first.moments + moments_about(np.asarray(first.centre), points.moments, points.centre)
        together[points.part] = first._replace(moments=moments)
    return list(together.values())


def _points_of_side(side: Side) -> _PartPoints:
    return _PartPoints(side.part, side.centre, side.all_moments)


def _displaced(setting: Setting, points: _PartPoints, start: Sequence[Pose], end: Sequence[Pose]) -> ca.SX:
    """Return the displacement energy of points, relative to the free part that theirs is located on, if any."""
    group, (part, centre, moments) = setting.group, points
    supporting = group.mobilities[part].movers[:-1]
    if not supporting:
        return displacement_energy(ca.SX(moments), centre, start[part], end[part])
    support = group.position(group.free[supporting[-1]])
    end_relative = setting.linear(relative(end[part], end[support]))
    return displacement_energy(ca.SX(moments), centre, relative(start[part], start[support]), end_relative)
