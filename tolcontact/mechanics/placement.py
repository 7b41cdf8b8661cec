"""Locator deviations to raw poses: q = M d (see Locators) of each part, on the ground or on another part."""

import casadi as ca

from tolcontact.discretization import Nominal, NominalPart
from tolcontact.mechanics.pose import Pose, rotation


def raw_poses(nominal: Nominal, deviations: ca.SX) -> list[Pose]:
    """Return the raw pose of every part for deviations (contributor, 1) [mm] in the order of `nominal.contributors`."""
    local = [_on_its_locators(part, held(nominal, index, deviations)) for index, part in enumerate(nominal.parts)]

    def follow(index: int) -> Pose:
        parent = nominal.parts[index].parent
        return local[index] if parent is None else follow(parent) @ local[index]

    return [follow(index) for index in range(len(local))]


def held(nominal: Nominal, part: int, deviations: ca.SX) -> ca.SX:
    """How far each locator of a part moves it (locator, 1) [mm]: its deviation, and what its face comes out of the part."""
    local, locators = deviations[nominal.columns(part).tolist()], nominal.parts[part].locators
    for number in range(len(locators)):
        columns, factors = locators.pushes(number)
        if columns.size:
            local[number] += ca.dot(ca.DM(factors), deviations[columns.tolist()])
    return local


def _on_its_locators(part: NominalPart, d: ca.SX) -> Pose:
    """R = exp([theta]x) about the centroid c of the locators, which moves by delta; (delta, theta) = J^-1 d.

    Turning about c, not about the origin, makes the pose the same wherever the assembly stands: the two differ by
    terms of order theta^2 times the distance of the origin.
    """
    if not len(part.locators):
        return Pose(ca.SX.eye(3), ca.SX.zeros(3))
    M, c = part.locators.placing_matrix
    q = ca.DM(M) @ d
    R = rotation(q[3:])
    return Pose(R, q[:3] + c - R @ ca.DM(c))
