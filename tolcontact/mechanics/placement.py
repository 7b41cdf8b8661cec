"""Locator deviations to raw poses: q = M d (see Locators) of each part, on the ground or on another part."""

import casadi as ca

from tolcontact.discretization import Nominal, NominalPart
from tolcontact.mechanics.pose import Pose, rotation


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
