"""What the corrected pose minimizes: the named objectives, and the regularization beside them. Paper (9), (11).

All of them are quadratic in the poses, so that a linear step about any pose has the same quadratic term as one from the
raw state, and the exact resolution (repeated steps) the residuals from the raw state in its linear term.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from tolcontact.discretization import Nominal
from tolcontact.mechanics.displacement import displacement_energy
from tolcontact.mechanics.groups import Group, Side
from tolcontact.mechanics.pose import Pose, affine, relative
from tolcontact.method import Method

# Seating: the share of the forces that the quadratic term holds when all points have moved by the group's length. Small enough
# to leave it to the contacts who carries, large enough for the solvers.
YIELD = 1e-3


@dataclass(frozen=True, eq=False)
class Criterion:
    """An objective divided by `scale`, so that it does not depend on the number of points, springs or newtons.

    energy     [mm^2], or [mm] for seating
    scale      multipliers times this are reactions: [1] for points, [N/mm] for springs, [N] for forces
    """

    energy: ca.SX
    scale: ca.SX


def criterion(
    nominal: Nominal,
    group: Group,
    method: Method,
    moments: ca.SX,
    firmness: ca.SX,
    raw: Sequence[Pose],
    now: Sequence[Pose],
    z: ca.SX,
) -> Criterion:
    """The objective at the poses `now`, affine in `z`, of the group's parts; `moments` are of the points that count.

    `firmness` multiplies what holds the freedoms that the objective leaves open: it is 1 in the end.
    """
    held = firmness * _regularization(group, method, raw, now, z)
    count = sum(len(side.points) for side in group.sides)
    if method.objective == "locator stiffness":
        springs, total = _springs(nominal, group, raw, now, z)
        return Criterion(springs / total + held / count, ca.SX(total))
    if method.objective == "seating":
        work, total = _work(nominal, group, raw, now)
        return Criterion(firmness * YIELD * proximity(group, raw, now, z) / group.length - work / total, ca.SX(total))
    energy = held
    for k, side in enumerate(group.sides):
        energy += displacement_energy(moments[:, k], side.centre, raw[side.part], now[side.part])
    weight = ca.fmax(ca.sum2(moments[0, :]), 1)
    return Criterion(energy / weight, weight)


def proximity(group: Group, start: Sequence[Pose], end: Sequence[Pose], z: ca.SX) -> ca.SX:
    """Mean squared displacement of all contact points [mm^2] between two poses, halved."""
    count = sum(len(side.points) for side in group.sides)
    return sum((_of_all_points(group, side, start, end, z) for side in group.sides), ca.SX(0)) / count


def _regularization(group: Group, method: Method, raw: Sequence[Pose], now: Sequence[Pose], z: ca.SX) -> ca.SX:
    energy = ca.SX(0)
    if method.regularization == "points":
        for side in group.sides:
            energy += method.eta * _of_all_points(group, side, raw, now, z)
        return energy
    for part in map(group.position, group.free):
        dt, D = now[part].t - raw[part].t, now[part].R - raw[part].R
        energy += method.eta * (ca.dot(dt, dt) + ca.sumsqr(D) / 2) / 2  # |[w]x|^2 = 2 |w|^2
    return energy


def _of_all_points(group: Group, side: Side, start: Sequence[Pose], end: Sequence[Pose], z: ca.SX) -> ca.SX:
    """Displacement energy of all points of a side, seen from the free part that carries it, if one does."""
    moments, part = ca.SX(side.candidates(group.ball)), side.part
    carriers = group.carried[part].movers[:-1]
    if not carriers:
        return displacement_energy(moments, side.centre, start[part], end[part])
    below = group.position(group.free[carriers[-1]])
    after = affine(relative(end[part], end[below]), z)
    return displacement_energy(moments, side.centre, relative(start[part], start[below]), after)


def _springs(nominal: Nominal, group: Group, raw: Sequence[Pose], now: Sequence[Pose], z: ca.SX) -> tuple[ca.SX, float]:
    """Energy of the two-sided locators of the free parts, 1/2 sum k e^2 [N mm], and the sum of the k [N/mm]."""
    energy, total = ca.SX(0), 0.0
    for part in group.free:
        own = nominal.parts[part]
        before, after = (two_sided(nominal, group, part, poses, z) for poses in (raw, now))
        for k, e in zip(own.stiffness[~own.one_sided], ca.vertsplit(after - before), strict=True):
            energy += float(k) * e**2 / 2
            total += float(k)
    return energy, total or 1.0


def two_sided(nominal: Nominal, group: Group, part: int, poses: Sequence[Pose], z: ca.SX | None = None) -> ca.SX:
    """How far each two-sided locator of a part is from its nominal place, along its direction [mm] (locator, 1).

    Seen from what the part is located on; to first order in `z`, if that is given.
    """
    own = nominal.parts[part]
    X = poses[group.position(part)]
    X_PM = X if own.parent is None else relative(X, poses[group.position(own.parent)])
    if own.parent is not None and z is not None:
        X_PM = affine(X_PM, z)
    P, n = own.locator_points[~own.one_sided], own.locator_directions[~own.one_sided]
    return ca.vertcat(*(ca.dot(ca.DM(b), X_PM.place(ca.DM(a)) - ca.DM(a)) for a, b in zip(P, n, strict=True)))


def _work(nominal: Nominal, group: Group, raw: Sequence[Pose], now: Sequence[Pose]) -> tuple[ca.SX, float]:
    """Work of the declared forces [N mm], and the sum of their sizes [N] (1 where there are none)."""
    work, total = ca.SX(0), 0.0
    for force in nominal.assembly.forces:
        part = nominal.part_index(force.at.part)
        if part in group.parts and group.carried[group.position(part)].movers:
            p, k = ca.DM(nominal.place(force.at)), group.position(part)
            work += ca.dot(ca.DM(np.array(force.vector)), now[k].place(p) - raw[k].place(p))
            total += float(np.linalg.norm(force.vector))
    return work, total or 1.0
