"""The objectives that the corrected pose minimizes, and their regularization. Paper (9), (11).

All of them are quadratic in the poses. A linear step about any pose therefore has the same quadratic term as one from the raw
state. In the exact resolution (repeated steps) the linear term holds the residuals from the raw state.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from tolcontact.mechanics.displacement import displacement_energy
from tolcontact.mechanics.groups import Side
from tolcontact.mechanics.placement import elongation
from tolcontact.mechanics.pose import Pose, relative
from tolcontact.mechanics.setting import Setting

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
    return _ENERGIES[setting.method.objective](setting, poses)


def proximity(setting: Setting, start: Sequence[Pose], end: Sequence[Pose]) -> ca.SX:
    """Return half the mean squared displacement of all contact points [mm^2] between two poses."""
    sides = setting.group.sides
    return sum((_side_energy(setting, side, start, end) for side in sides), ca.SX(0)) / setting.group.count


def points_scale(moments: ca.SX) -> ca.SX:
    """Return the number of the points that count, of their moments (10, side): at least 1."""
    return ca.fmax(ca.sum2(moments[0, :]), 1)


def _points(setting: Setting, poses: Sequence[Pose]) -> Energy:
    """Return the mean displacement energy of the points that count."""
    value = setting.firmness * _regularization(setting, poses)
    for k, side in enumerate(setting.group.sides):
        value += displacement_energy(setting.moments[:, k], side.centre, setting.raw[side.part], poses[side.part])
    scale = points_scale(setting.moments) if setting.scale is None else setting.scale
    return Energy(value / scale, scale)


def _springs(setting: Setting, poses: Sequence[Pose]) -> Energy:
    """Return the energy 1/2 sum k e^2 [N mm] of the movers' two-sided locators, divided by the sum of the k [N/mm]."""
    regularization = setting.firmness * _regularization(setting, poses)
    value, total = ca.SX(0), 0.0
    for part in setting.group.free:
        locators = setting.nominal.parts[part].locators
        start_elongation, end_elongation = (elongation(setting, part, poses, linear=True) for poses in (setting.raw, poses))
        for k, e in zip(locators.stiffness[locators.exact], ca.vertsplit(end_elongation - start_elongation), strict=True):
            value += float(k) * e**2 / 2
            total += float(k)
    total = total or 1.0
    return Energy(value / total + regularization / setting.group.count, ca.SX(total))


def _forces(setting: Setting, poses: Sequence[Pose]) -> Energy:
    """Return the negative work of the declared forces [N mm], divided by the sum of their sizes [N] (1 without forces)."""
    nominal, group = setting.nominal, setting.group
    work, total = ca.SX(0), 0.0
    for force in nominal.assembly.forces:
        part = nominal.part_index(force.at.part, force.station)
        if part in group.parts and group.mobilities[group.position(part)].movers:
            p, k = ca.DM(nominal.position(force.at)), group.position(part)
            work += ca.dot(ca.DM(np.array(force.vector)), poses[k].apply(p) - setting.raw[k].apply(p))
            total += float(np.linalg.norm(force.vector))
    total = total or 1.0
    quadratic = setting.firmness * SEATING_SHARE * proximity(setting, setting.raw, poses) / group.length
    return Energy(quadratic - work / total, ca.SX(total))


_ENERGIES: dict[str, Callable[[Setting, Sequence[Pose]], Energy]] = {
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
    return [_side_energy(setting, side, setting.raw, poses) for side in setting.group.sides]


def _identity_energies(setting: Setting, poses: Sequence[Pose]) -> list[ca.SX]:
    """Return the energies of the paper's eta I: translations [mm] and rotations [rad] of the movers."""
    energies = []
    for part in map(setting.group.position, setting.group.free):
        dt, D = poses[part].t - setting.raw[part].t, poses[part].R - setting.raw[part].R
        energies.append((ca.dot(dt, dt) + ca.sumsqr(D) / 2) / 2)  # |[w]x|^2 = 2 |w|^2
    return energies


_REGULARIZATIONS = {"points": _point_energies, "identity": _identity_energies}


def _side_energy(setting: Setting, side: Side, start: Sequence[Pose], end: Sequence[Pose]) -> ca.SX:
    """Return the displacement energy of all points of a side, relative to the free part that it is located on, if any."""
    group, part = setting.group, side.part
    moments = ca.SX(side.all_moments)
    supporting = group.mobilities[part].movers[:-1]
    if not supporting:
        return displacement_energy(moments, side.centre, start[part], end[part])
    support = group.position(group.free[supporting[-1]])
    end_relative = setting.linear(relative(end[part], end[support]))
    return displacement_energy(moments, side.centre, relative(start[part], start[support]), end_relative)
