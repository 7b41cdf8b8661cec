"""Poses from locators: q = M d (see Locators) of each part, on the ground or on another part; elongations of two-sided ones.

A part that a joint carries keeps the pose relative to its carrier that it had in the station that joined them.
"""

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from tolcontact.declaration.locator import FIRST_ORDER
from tolcontact.discretization import Nominal, NominalPart
from tolcontact.discretization.locators import Locators
from tolcontact.mechanics.correction import FREEDOMS
from tolcontact.mechanics.groups import Hold
from tolcontact.mechanics.pose import Pose, constant, relative, rotation
from tolcontact.mechanics.setting import Setting

STEPS = 5  # of Newton's method from the pose to first order: an error of a tenth is rounding after four


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


def hold_steps(nominal: Nominal, part: int, deviations: ca.SX) -> ca.SX:
    """Return the steps (locator, 1) [mm] of a part at its two-sided locators that do not give way."""
    return locator_steps(nominal, part, deviations)[np.flatnonzero(nominal.parts[part].locators.exact).tolist()]


def elongation(setting: Setting, hold: Hold, poses: Sequence[Pose], *, linear: bool = False) -> ca.SX:
    """Return the distance (locator, 1) [mm] of each two-sided locator from its nominal place, along its direction.

    The distance is measured in the frame that the mover is located on, and to first order in the increments if `linear`.
    """

    def pose(owner: int) -> Pose:
        if hold.parent is None:
            return poses[owner]
        X_PM = relative(poses[owner], poses[hold.parent])
        return setting.linear(X_PM) if linear else X_PM

    X_PM = {owner: pose(owner) for owner in dict.fromkeys(hold.owners)}
    places = zip(hold.owners, map(constant, hold.points), map(constant, hold.directions), strict=True)
    return ca.vertcat(*(ca.dot(n, X_PM[owner].apply(p) - p) for owner, p, n in places))


def misfit(setting: Setting, poses: Sequence[Pose], *, linear: bool = False) -> ca.SX:
    """Return the elongations of the movers' two-sided locators less their deviations (locator, 1) [mm].

    Locators whose faces slide over them, or that a best fit averages, hold their part where they have placed it.
    """
    errors = [
        elongation(setting, hold, poses, linear=linear) - (elongation(setting, hold, setting.raw) if hold.is_placed else steps)
        for hold, steps in zip(setting.group.holds, setting.steps, strict=True)
    ]
    return ca.vertcat(ca.SX(0, 1), *errors)


def exact_pose(locators: Locators, steps: ca.SX, start: Pose, within: Sequence[Pose | None], centre: ca.DM) -> Pose:
    """Return the pose in which the faces pass through the tips of the locators, or are nearest to them.

    To first order a locator pushes a point of its part along its direction. Exactly, the face of the part, a plane through that
    point, has to pass through the tip of the locator, wherever on the face this is. Six locators give six equations for the
    pose. More give a best fit: the least sum of squared heights of the tips over the faces, as a measuring machine does.

    steps    (locator, 1) [mm] of each locator along its direction
    start    pose to first order
    within   pose of the part at whose point each locator is, relative to the part that carries it; None for that part itself
    centre   (3, 1) [mm] about which steps of the iteration turn
    """
    X = start
    for _ in range(STEPS):
        rows, heights = [], []
        for k, X_member in enumerate(within):
            p, n = ca.DM(locators.points[k]), ca.SX(ca.DM(locators.directions[k]))
            tip = X.R.T @ (p + steps[k] * n - X.t)
            place = tip if X_member is None else X_member.R.T @ (tip - X_member.t)
            heights.append(ca.dot(n, place - p))
            normal = n if X_member is None else X_member.R @ n
            rows.append(ca.vertcat(normal, ca.cross(tip - centre, normal)).T)
        A, height = ca.vertcat(*rows), ca.vertcat(*heights)
        q = ca.solve(A, height) if len(within) == FREEDOMS else ca.solve(A.T @ A, A.T @ height)
        R = rotation(q[3:])
        X = X @ Pose(R, q[:3] + centre - R @ centre)
    return X
