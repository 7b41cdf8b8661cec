"""Exact placing: faces slide over locators that stand still in space.

To first order a locator pushes a point of its part along its direction. Exactly, the face of the part, a plane through that
point, has to pass through the tip of the locator, wherever on the face this is. Six locators give six equations for the pose.
More give a best fit: the least sum of squared heights of the tips over the faces, as a measuring machine aligns a part.
"""

from collections.abc import Sequence

import casadi as ca

from tolcontact.discretization.locators import Locators
from tolcontact.mechanics.pose import Pose, rotation

STEPS = 5  # of Newton's method from the pose to first order: an error of a tenth is rounding after four
FREEDOMS = 6


def exact_pose(locators: Locators, steps: ca.SX, start: Pose, within: Sequence[Pose | None], centre: ca.DM) -> Pose:
    """Return the pose in which the faces pass through the tips of the locators, or are nearest to them.

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
