"""Poses from locators: q = M d (see Locators) of each part, on the ground or on another part; locator elongations.

A part of a joint keeps the pose, relative to the carrier of the joint, that it had in the station that joined them.
"""

from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from tolcontact.declaration.locator import FIRST_ORDER
from tolcontact.discretization import Nominal, NominalPart
from tolcontact.discretization.locators import Locators
from tolcontact.mechanics.correction import FREEDOMS
from tolcontact.mechanics.group_equations import GroupEquations
from tolcontact.mechanics.groups import BilateralLocators
from tolcontact.mechanics.pose import Pose, constant, relative, rotation

STEPS = 5  # of Newton's method, from the first-order pose: after four, an initial error of 0.1 is down to rounding


def raw_poses(nominal: Nominal, deviations: ca.SX) -> list[Pose]:
    """Return the raw pose of every part for deviations (contributor, 1) [mm] in the order of `nominal.contributors`."""
    poses: dict[int, Pose] = {}
    for station in dict.fromkeys(part.station for part in nominal.parts):  # a station depends on raw poses of earlier ones
        placed = placed_poses(nominal, station, deviations, poses)
        poses |= zip(range(len(poses), len(poses) + len(placed)), placed, strict=True)
    return list(poses.values())


def placed_poses(nominal: Nominal, station: str, deviations: ca.SX, earlier: Mapping[int, Pose]) -> list[Pose]:
    """Return the raw pose of each part of a station, given poses of parts of earlier stations by their indices."""
    indices = [index for index, part in enumerate(nominal.parts) if part.station == station]
    first = indices[0]
    joint_poses = [
        None if part.carried is None else relative(earlier[part.carried[1]], earlier[part.carried[0]])
        for part in nominal.parts[first : indices[-1] + 1]
    ]
    local = [
        _located_pose(nominal, index, deviations, joint_poses) if pose is None else pose
        for index, pose in zip(indices, joint_poses, strict=True)
    ]

    def placed_pose(index: int) -> Pose:
        parent = nominal.parts[index].parent
        return local[index - first] if parent is None else placed_pose(parent) @ local[index - first]

    return [placed_pose(index) for index in indices]


def _located_pose(nominal: Nominal, index: int, deviations: ca.SX, joint_poses: Sequence[Pose | None]) -> Pose:
    """Return the pose that its locators give to a part, or to the joint whose carrier it is.

    joint_poses   pose of each part of the station relative to its carrier; None for a part that has no carrier
    """
    steps, part = locator_steps(nominal, index, deviations), nominal.parts[index]
    first = next(k for k, other in enumerate(nominal.parts) if other.station == part.station)
    within = [joint_poses[owner - first] for owner in part.owners] or [None] * len(part.locators)
    to_first_order = ca.SX(steps)
    for locator, X in enumerate(within):
        if X is not None:  # the point has moved within the joint
            p, n = ca.DM(part.locators.points[locator]), ca.DM(part.locators.directions[locator])
            to_first_order[locator] -= ca.dot(n, X.apply(p) - p)
    pose = _locator_pose(part, to_first_order)
    if part.locators.placing == FIRST_ORDER or not len(part.locators):
        return pose
    return exact_pose(part.locators, steps, pose, within, ca.DM(part.locators.placing_matrix[1]))


def locator_steps(nominal: Nominal, part: int, deviations: ca.SX) -> ca.SX:
    """Return the step (locator, 1) [mm] of a part at each locator: its deviation and the growth of its face."""
    local, locators = deviations[nominal.columns(part).tolist()], nominal.parts[part].locators
    for locator in range(len(locators)):
        columns, factors = locators.pushes(locator)
        if columns.size:
            local[locator] += ca.dot(ca.DM(factors), deviations[columns.tolist()])
    return local


def _locator_pose(part: NominalPart, d: ca.SX) -> Pose:
    """Return the pose that locators give to a part: R = exp([theta]x) about their centroid c, which moves by delta.

    (delta, theta) = J^-1 d. A rotation about c makes the pose independent of the origin. A rotation about the origin would
    differ by terms of order theta^2 times the distance of the origin.
    """
    if not len(part.locators):
        return Pose(ca.SX.eye(3), ca.SX.zeros(3))
    M, c = part.locators.placing_matrix
    q = ca.DM(M) @ d
    R = rotation(q[3:])
    return Pose(R, q[:3] + c - R @ ca.DM(c))


def bilateral_steps(nominal: Nominal, part: int, deviations: ca.SX) -> ca.SX:
    """Return the steps (locator, 1) [mm] of a part at its rigid two-sided locators."""
    return locator_steps(nominal, part, deviations)[np.flatnonzero(nominal.parts[part].locators.exact).tolist()]


def elongation(system: GroupEquations, locators: BilateralLocators, poses: Sequence[Pose], *, linear: bool = False) -> ca.SX:
    """Return the distance (locator, 1) [mm] of each two-sided locator from its nominal position, along its direction.

    The distance is measured in the frame of the part that the mover is located on, to first order in the increments if
    `linear`.
    """

    def pose(owner: int) -> Pose:
        if locators.parent is None:
            return poses[owner]
        X_PM = relative(poses[owner], poses[locators.parent])
        return system.linear(X_PM) if linear else X_PM

    X_PM = {owner: pose(owner) for owner in dict.fromkeys(locators.owners)}
    entries = zip(locators.owners, map(constant, locators.points), map(constant, locators.directions), strict=True)
    return ca.vertcat(*(ca.dot(n, X_PM[owner].apply(p) - p) for owner, p, n in entries))


def misfit(system: GroupEquations, poses: Sequence[Pose], *, linear: bool = False) -> ca.SX:
    """Return the elongations of the movers' two-sided locators less their deviations (locator, 1) [mm].

    Locators whose faces slide over them, or that a best fit averages, fix their part in its raw pose.
    """
    errors = [
        elongation(system, locators, poses, linear=linear)
        - (elongation(system, locators, system.raw) if locators.is_placed else steps)
        for locators, steps in zip(system.group.bilateral, system.steps, strict=True)
    ]
    return ca.vertcat(ca.SX(0, 1), *errors)


def exact_pose(locators: Locators, steps: ca.SX, start: Pose, within: Sequence[Pose | None], centre: ca.DM) -> Pose:
    """Return the pose that makes the faces pass through the tips of the locators, or fit them best.

    To first order a locator pushes a point of its part along its direction. Exactly, the face of the part, a plane through that
    point, has to pass through the tip of the locator, at any point of the face. Six locators give six equations for the pose.
    More locators give a best fit: the least-squares fit of the faces to the tips, as on a coordinate measuring machine.

    steps    step (locator, 1) [mm] of each locator along its direction
    start    first-order pose
    within   pose of the part that each locator is on, relative to the carrier of the joint; None for the carrier
    centre   centre of rotation (3, 1) [mm] of the iteration steps
    """
    X = start
    for _ in range(STEPS):
        rows, heights = [], []
        for k, X_member in enumerate(within):
            p, n = ca.DM(locators.points[k]), ca.SX(ca.DM(locators.directions[k]))
            tip = X.R.T @ (p + steps[k] * n - X.t)
            local_tip = tip if X_member is None else X_member.R.T @ (tip - X_member.t)
            heights.append(ca.dot(n, local_tip - p))
            normal = n if X_member is None else X_member.R @ n
            rows.append(ca.vertcat(normal, ca.cross(tip - centre, normal)).T)
        A, height = ca.vertcat(*rows), ca.vertcat(*heights)
        q = ca.solve(A, height) if len(within) == FREEDOMS else ca.solve(A.T @ A, A.T @ height)
        R = rotation(q[3:])
        X = X @ Pose(R, q[:3] + centre - R @ centre)
    return X
