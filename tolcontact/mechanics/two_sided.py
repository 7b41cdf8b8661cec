"""Two-sided locators as expressions of the poses: their elongations and misfits."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from tolcontact.mechanics.placement import locator_steps
from tolcontact.mechanics.pose import Pose, relative
from tolcontact.mechanics.setting import Setting


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
