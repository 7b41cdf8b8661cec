"""The objectives that the corrected pose minimizes, and their regularization. Paper (9), (11).

All of them are quadratic in the poses. A linear step about any pose therefore has the same quadratic term as one from the raw
state. In the exact resolution (repeated steps) the linear term contains the residuals from the raw state.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import casadi as ca
import numpy as np

from tolcontact.mechanics.displacement import MOMENTS, displacement_energy, moments_about
from tolcontact.mechanics.group_equations import GroupEquations
from tolcontact.mechanics.groups import Group, Side
from tolcontact.mechanics.placement import elongation
from tolcontact.mechanics.pose import Pose, constant, relative
from tolcontact.method import Method

# The paper's eta of (11), the weight of the regularization: small enough not to move what the objective fixes, and large enough
# to solve for the rest. With "points" it is dimensionless; with "identity", mm^2 per rad^2 and 1 per mm^2.
ETA = 1e-6
# Seating: the share of the forces that the quadratic term balances when all points have moved by the group's length. It is
# small enough for the contacts to take nearly the whole load, and large enough for the solvers.
SEATING_SHARE = 1e-3


class Energy(NamedTuple):
    """An objective divided by `scale`, so that it does not depend on the number of points, springs or newtons.

    value      [mm^2], or [mm] for seating
    scale      multipliers times this are reactions: [1] for points, [N/mm] for springs, [N] for forces
    """

    value: ca.SX
    scale: ca.SX


def energy(system: GroupEquations, poses: Sequence[Pose]) -> Energy:
    """Return the objective at `poses`, which are affine in the increments."""
    scale = objective_scale(system.group, system.method, system.moments) if system.scale is None else system.scale
    return Energy(_VALUES[system.method.objective](system, poses, scale), scale)


def objective_scale(group: Group, method: Method, moments: ca.SX) -> ca.SX:
    """Return the scale of the objective.

    For points, it is the weighted number of points that count, from their moments (10, side), and at least 1. For springs, it
    is the sum of their stiffness [N/mm]; for forces, the sum of their magnitudes [N]. It is 1 if there are none.
    """
    if method.minimizes.counts_points:
        return ca.fmax(ca.sum2(moments[0, :]), 1)
    if method.minimizes.presses:
        return ca.SX(sum(float(np.linalg.norm(load.vector)) for load in group.loads) or 1.0)
    return ca.SX(sum(float(k) for locators in group.bilateral for k in locators.stiffness) or 1.0)


def proximity(system: GroupEquations, start: Sequence[Pose], end: Sequence[Pose]) -> ca.SX:
    """Return half the mean squared displacement of all contact points [mm^2] between two poses."""
    energies = (_displaced(system, side, start, end) for side in _sides_of_parts(system.group))
    return sum(energies, ca.SX(0)) / system.group.count


def _points(system: GroupEquations, poses: Sequence[Pose], scale: ca.SX) -> ca.SX:
    """Return the mean displacement energy of the weighted points."""
    value = system.regularization_factor * _regularization(system, poses)
    for k, side in enumerate(system.group.sides):
        value += displacement_energy(system.moments[:, k], side.centre, system.raw[side.part], poses[side.part])
    return value / scale


def _springs(system: GroupEquations, poses: Sequence[Pose], scale: ca.SX) -> ca.SX:
    """Return the energy 1/2 sum k e^2 [N mm] of the movers' two-sided locators, divided by the sum of the k [N/mm]."""
    regularization = system.regularization_factor * _regularization(system, poses)
    value = ca.SX(0)
    for locators in system.group.bilateral:
        start_elongation, end_elongation = (elongation(system, locators, poses, linear=True) for poses in (system.raw, poses))
        for k, e in zip(locators.stiffness, ca.vertsplit(end_elongation - start_elongation), strict=True):
            value += k * e**2 / 2
    return value / scale + regularization / system.group.count


def _forces(system: GroupEquations, poses: Sequence[Pose], scale: ca.SX) -> ca.SX:
    """Return the negative work of the declared forces [N mm], divided by the sum of their magnitudes [N]."""
    work = ca.SX(0)
    for load in system.group.loads:
        p, vector = constant(load.point), constant(load.vector)
        if load.columns:
            added = ca.dot(ca.DM(load.factors), system.deviations[list(load.columns)])
            vector = vector * (1 + added / float(np.linalg.norm(load.vector)))
        work += ca.dot(vector, poses[load.part].apply(p) - system.raw[load.part].apply(p))
    quadratic = system.regularization_factor * SEATING_SHARE * proximity(system, system.raw, poses) / system.group.length
    return quadratic - work / scale


_VALUES: dict[str, Callable[[GroupEquations, Sequence[Pose], ca.SX], ca.SX]] = {
    "active points": _points,
    "all points": _points,
    "locator stiffness": _springs,
    "seating": _forces,
}


def _regularization(system: GroupEquations, poses: Sequence[Pose]) -> ca.SX:
    return sum((ETA * term for term in _REGULARIZATIONS[system.method.regularization](system, poses)), ca.SX(0))


def _point_energies(system: GroupEquations, poses: Sequence[Pose]) -> list[ca.SX]:
    """Return the displacement energy of all contact points of each side."""
    return [_displaced(system, side, system.raw, poses) for side in system.group.sides]


def _identity_energies(system: GroupEquations, poses: Sequence[Pose]) -> list[ca.SX]:
    """Return the energies of the paper's eta I: translations [mm] and rotations [rad] of the movers."""
    energies = []
    for part in map(system.group.position, system.group.free):
        dt, D = poses[part].t - system.raw[part].t, poses[part].R - system.raw[part].R
        energies.append((ca.dot(dt, dt) + ca.sumsqr(D) / 2) / 2)  # |[w]x|^2 = 2 |w|^2
    return energies


_REGULARIZATIONS = {"points": _point_energies, "identity": _identity_energies}


def _sides_of_parts(group: Group) -> Sequence[Side]:
    """Return a side for each part, with the moments of all contact points of the part; all sides if moments are symbols."""
    sides: dict[int, Side] = {}
    for side in group.sides:
        if isinstance(side.centre, ca.SX) or isinstance(side.all_moments, ca.SX):
            return group.sides
        total = sides.get(side.part, replace(side, all_moments=np.zeros(MOMENTS)))
        moments = total.all_moments + moments_about(np.asarray(total.centre), side.all_moments, side.centre)
        sides[side.part] = replace(total, all_moments=moments)
    return list(sides.values())


def _displaced(system: GroupEquations, side: Side, start: Sequence[Pose], end: Sequence[Pose]) -> ca.SX:
    """Return the displacement energy of all points, relative to the free part that their part is located on, if any."""
    group, part, centre, moments = system.group, side.part, side.centre, ca.SX(side.all_moments)
    supporting = group.mobilities[part].movers[:-1]
    if not supporting:
        return displacement_energy(moments, centre, start[part], end[part])
    support = group.position(group.free[supporting[-1]])
    end_relative = system.linear(relative(end[part], end[support]))
    return displacement_energy(moments, centre, relative(start[part], start[support]), end_relative)
