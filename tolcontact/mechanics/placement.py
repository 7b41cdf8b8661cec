"""Poses from locators: q = M d (see Locators) of each part, on the ground or on another part; elongations of two-sided ones.

A part that a joint carries keeps the pose relative to its carrier that it had in the station that joined them.
"""

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from tolcontact.declaration.locator import FIRST_ORDER
from tolcontact.discretization import Nominal, NominalPart
from tolcontact.mechanics.exact_placing import exact_pose
from tolcontact.mechanics.pose import Pose, relative, rotation
from tolcontact.mechanics.setting import Setting


def raw_poses(nominal: Nominal, deviations: ca.SX) -> list[Pose]:
    """Return the raw pose of every part for deviations (contributor, 1) [mm] in the order of `nominal.contributors`."""
    poses: dict[int, Pose] = {}
    for station in dict.fromkeys(part.station for part in nominal.parts):  # a station follows from the raw poses before it
        placed = placed_poses(nominal, station, deviations, poses)
        poses |= zip(range(len(poses), len(poses) + len(placed)), placed, strict=True)
    return list(poses.values())


def placed_poses(nominal: Nominal, station: str, deviations: ca.SX, earlier: Mapping[int, Pose]) -> list[Pose]:
    """Return the pose of each part of a station before contact, for poses of parts of earlier stations by their indices."""
    indices = [index for index, part in enumerate(nominal.parts) if part.station == station]
    first = indices[0]
    carried = [
        None if part.carried is None else relative(earlier[part.carried[1]], earlier[part.carried[0]])
        for part in nominal.parts[first : indices[-1] + 1]
    ]
    local = [
        _located_pose(nominal, index, deviations, carried) if pose is None else pose
        for index, pose in zip(indices, carried, strict=True)
    ]

    def placed_pose(index: int) -> Pose:
        parent = nominal.parts[index].parent
        return local[index - first] if parent is None else placed_pose(parent) @ local[index - first]

    return [placed_pose(index) for index in indices]


def _located_pose(nominal: Nominal, index: int, deviations: ca.SX, carried: Sequence[Pose | None]) -> Pose:
    """Return the pose that the locators of a part give it, or the joint that it carries.

    carried   pose relative to its carrier of each part of the station; None for a part that is not carried
    """
    steps, part = locator_steps(nominal, index, deviations), nominal.parts[index]
    first = next(k for k, other in enumerate(nominal.parts) if other.station == part.station)
    within = [carried[owner - first] for owner in part.owners] or [None] * len(part.locators)
    to_first_order = ca.SX(steps)
    for number, X in enumerate(within):
        if X is not None:  # the point has moved within the joint
            p, n = ca.DM(part.locators.points[number]), ca.DM(part.locators.directions[number])
            to_first_order[number] -= ca.dot(n, X.apply(p) - p)
    pose = _locator_pose(part, to_first_order)
    if part.locators.placing == FIRST_ORDER or not len(part.locators):
        return pose
    return exact_pose(part.locators, steps, pose, within, ca.DM(part.locators.placing_matrix[1]))


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

    Locators that give way are left out. The distance is measured in the frame that the part is located on, and to first order
    in the increments if `linear`.
    """
    group, entry = setting.group, setting.nominal.parts[part]
    owners = entry.owners or (part,) * len(entry.locators)

    def pose(owner: int) -> Pose:
        X = poses[group.position(owner)]
        X_PM = X if entry.parent is None else relative(X, poses[group.position(entry.parent)])
        return setting.linear(X_PM) if entry.parent is not None and linear else X_PM

    X_PM = {owner: pose(owner) for owner in dict.fromkeys(owners)}
    exact = np.flatnonzero(entry.locators.exact)
    P, n = entry.locators.points, entry.locators.directions
    return ca.vertcat(*(ca.dot(ca.DM(n[k]), X_PM[owners[k]].apply(ca.DM(P[k])) - ca.DM(P[k])) for k in exact))


def misfit(setting: Setting, poses: Sequence[Pose], *, linear: bool = False) -> ca.SX:
    """Return the elongations of the movers' two-sided locators less their deviations (locator, 1) [mm].

    Locators whose faces slide over them, or that a best fit averages, hold their part where they have placed it.
    """
    errors = []
    for part in setting.group.free:
        locators = setting.nominal.parts[part].locators
        if locators.exact.any():
            steps = locator_steps(setting.nominal, part, setting.deviations)[np.flatnonzero(locators.exact).tolist()]
            expected = steps if locators.placing == FIRST_ORDER else elongation(setting, part, setting.raw)
            errors.append(elongation(setting, part, poses, linear=linear) - expected)
    return ca.vertcat(*errors) if errors else ca.SX(0, 1)
