"""Poses from locators: q = M d (see Locators) of each part, on the ground or on another part; elongations of two-sided ones."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from tolcontact.discretization import Nominal, NominalPart
from tolcontact.mechanics.pose import Pose, relative, rotation
from tolcontact.mechanics.setting import Setting


def raw_poses(nominal: Nominal, deviations: ca.SX) -> list[Pose]:
    """Return the raw pose of every part for deviations (contributor, 1) [mm] in the order of `nominal.contributors`."""
    local = [_locator_pose(part, locator_steps(nominal, index, deviations)) for index, part in enumerate(nominal.parts)]

    def raw_pose(index: int) -> Pose:
        parent = nominal.parts[index].parent
        return local[index] if parent is None else raw_pose(parent) @ local[index]

    return [raw_pose(index) for index in range(len(local))]


def locator_steps(nominal: Nominal, part: int, deviations: ca.SX) -> ca.SX:
    """Return the step (locator, 1) [mm] of a part at each locator: its deviation and the growth of its face."""
    local, locators = deviations[nominal.columns(part).tolist()], nominal.parts[part].locators
    for number in range(len(locators)):
        columns, factors = locators.pushes(number)
        if columns.size:
            local[number] += ca.dot(ca.DM(factors), deviations[columns.tolist()])
    return local


def _locator_pose(part: NominalPart, d: ca.SX) -> Pose:
    """Return the pose that locators give a part: R = exp([theta]x) about their centroid c, which moves by delta.

    (delta, theta) = J^-1 d. A rotation about c gives the same pose wherever the assembly stands. A rotation about the origin
    would differ by terms of order theta^2 times the distance of the origin.
    """
    if not len(part.locators):
        return Pose(ca.SX.eye(3), ca.SX.zeros(3))
    M, c = part.locators.placing_matrix
    q = ca.DM(M) @ d
    R = rotation(q[3:])
    return Pose(R, q[:3] + c - R @ ca.DM(c))


def elongation(setting: Setting, part: int, poses: Sequence[Pose], *, linear: bool = False) -> ca.SX:
    """Return the distance (locator, 1) [mm] of each two-sided locator of a part from its nominal place, along its direction.

    It is measured in the frame that the part is located on, and to first order in the increments if `linear`.
    """
    group, entry = setting.group, setting.nominal.parts[part]
    X = poses[group.position(part)]
    X_PM = X if entry.parent is None else relative(X, poses[group.position(entry.parent)])
    if entry.parent is not None and linear:
        X_PM = setting.linear(X_PM)
    exact = ~entry.locators.one_sided
    P, n = entry.locators.points[exact], entry.locators.directions[exact]
    return ca.vertcat(*(ca.dot(ca.DM(b), X_PM.apply(ca.DM(a)) - ca.DM(a)) for a, b in zip(P, n, strict=True)))


def misfit(setting: Setting, poses: Sequence[Pose], *, linear: bool = False) -> ca.SX:
    """Return the elongations of the movers' two-sided locators less their deviations (locator, 1) [mm]."""
    errors = []
    for part in setting.group.free:
        exact = ~setting.nominal.parts[part].locators.one_sided
        if exact.any():
            expected = locator_steps(setting.nominal, part, setting.deviations)[np.flatnonzero(exact).tolist()]
            errors.append(elongation(setting, part, poses, linear=linear) - expected)
    return ca.vertcat(*errors) if errors else ca.SX(0, 1)
