"""Rows of the contact QP: the gaps of contact points, to first order in the increments."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from tolcontact.discretization import ContactPoints
from tolcontact.mechanics.flexibility import Flexibility
from tolcontact.mechanics.gap import Point, RowPoints
from tolcontact.mechanics.group_equations import GroupEquations
from tolcontact.mechanics.pose import ENTRIES, Pose
from tolcontact.mechanics.round_gap import pair_gaps
from tolcontact.method import Method

SLOTS, MANY_SLOTS = 8, 12  # of a pair of bounded faces, and of others; at most six independent rows can be active


@dataclass(frozen=True, eq=False)
class Rows:
    """One row for each slot, and for each point that always has one; rows are ordered by pair.

    slopes      (row, z): derivatives of the gaps
    gaps        (row, 1) [mm] at z = 0
    filled      (row, 1): 0 if a slot is empty
    pairs       (row,): position of the row's pair in the group
    relative    (12 * pair, 1): X_RM of every pair, to first order in z
    bends       (12 * pair, 1): sums of previous reaction times gap gradient by the entries of X_RM
    compliance  (row, 1) [mm/N]: of compliant points; 0 for rigid rows
    flexibility of all rows, if there are elastic parts; `compliance` is then its diagonal
    bent        (row, 1) [mm]: opening of the rows by the previous reactions, if there are elastic parts
    curvature, hollow_curvature   (z, z): sums of previous reaction times second derivative of gaps that are not linear in X_RM
                (see round_gaps)
    """

    slopes: ca.SX
    gaps: ca.SX
    filled: ca.SX
    pairs: np.ndarray
    compliance: ca.SX
    relative: ca.SX
    bends: ca.SX
    curvature: ca.SX
    hollow_curvature: ca.SX
    flexibility: Flexibility | None = None
    bent: ca.SX | None = None

    def __len__(self) -> int:
        return len(self.pairs)

    @property
    def springs(self) -> list[int]:
        """The compliant rows."""
        return springs_of(self.compliance)

    def between_elastic(self, flexibility: Flexibility | None, bent: ca.SX | None) -> "Rows":
        """Return the rows between elastic parts, which previous reactions have `bent`; the same ones if there are none."""
        if flexibility is None:
            return self
        compliance = ca.SX(ca.sparsify(ca.DM(np.diag(flexibility.C))))
        return replace(self, gaps=self.gaps + flexibility.opening, compliance=compliance, flexibility=flexibility, bent=bent)

    def opened(self, reactions: ca.SX) -> ca.SX:
        """Return the gaps (row, 1) [mm] under reactions (row, 1) [N], at z = 0."""
        return self.gaps + (self.compliance * reactions if self.bent is None else self.bent)


def springs_of(compliance: ca.SX) -> list[int]:
    """Return the rows with a nonzero compliance (row, 1)."""
    return [k for k in range(compliance.numel()) if not compliance[k].is_zero()]


def standing_points(pair: ContactPoints, gaps: Any, method: Method) -> np.ndarray | int:
    """Return the points of a pair that always have a row, or the number of its slots for changing points.

    Points that follow from every pose always have a row. The same holds for points that can be the deepest, if they are few and
    fixed.
    """
    if not pair.samples_faces or pair.is_springy:
        return np.arange(len(pair.P_m))
    are_few = method.is_closed and len(gaps.corners) <= MANY_SLOTS and pair.minima is None
    return gaps.corners if are_few else MANY_SLOTS


def contact_rows(
    system: GroupEquations,
    points_of_pairs: Sequence[RowPoints],
    start_poses: Sequence[Pose],
    end_poses: Sequence[Pose],
    reactions: ca.SX,
) -> Rows:
    """Return the rows about `start_poses`, which the increments change to `end_poses`.

    `reactions` (row, 1) are the reactions of the points in the previous step, see contact_qp.
    """
    pairs = list[int]()
    slopes, gaps, filled, compliance, relative, bends = ([] for _ in range(6))
    curvature, hollow_curvature = (ca.SX(system.z.numel(), system.z.numel()) for _ in range(2))
    for k, (start, by_z) in enumerate(relative_poses(system, start_poses, end_poses)):
        points, count = points_of_pairs[k], points_of_pairs[k].compliance.numel()
        of_pair = reactions[len(pairs) : len(pairs) + count]
        rows = pair_gaps(system.pair(k)).rows(start, by_z, system.heights[k], points, of_pair)
        pairs += [k] * count
        relative.append(start.vector() + by_z @ system.z)
        compliance.append(points.compliance)
        slopes.append(rows.slopes)
        gaps.append(rows.gaps)
        filled.append(ca.vertcat(*(is_filled for *_, is_filled in points.points)) if points.points else ca.SX.ones(count))
        bends.append(rows.bends)
        curvature += rows.curvature
        hollow_curvature += rows.hollow_curvature
    return Rows(
        slopes=ca.vertcat(ca.SX(0, system.z.numel()), *slopes),
        gaps=ca.vertcat(ca.SX(0, 1), *gaps),
        filled=ca.vertcat(ca.SX(0, 1), *filled),
        pairs=np.array(pairs),
        compliance=ca.vertcat(ca.SX(0, 1), *compliance),
        relative=ca.vertcat(ca.SX(0, 1), *relative),
        bends=ca.vertcat(ca.SX(0, 1), *bends),
        curvature=curvature,
        hollow_curvature=hollow_curvature,
    )


def relative_poses(
    system: GroupEquations, start_poses: Sequence[Pose], end_poses: Sequence[Pose]
) -> Iterator[tuple[Pose, ca.SX]]:
    """Yield X_RM of each pair at `start_poses`, and its derivatives (12, z); the increments lead to `end_poses`."""
    for start, end in zip(system.relative(start_poses), system.relative(end_poses), strict=True):
        yield start, system.slope(end.vector())


def spring_energy(system: GroupEquations, points_of_pairs: Sequence[RowPoints], poses: Sequence[Pose]) -> ca.SX:
    """Return the energy [N mm] of the compressed springs at `poses`; 0 without points."""
    energy = ca.SX(0)
    for k, (X_RM, points) in enumerate(zip(system.relative(poses), points_of_pairs, strict=bool(points_of_pairs))):
        springs = springs_of(points.compliance)
        gaps = pair_gaps(system.pair(k)).values(X_RM, system.heights[k], points) if springs else []
        energy += sum((ca.fmin(gaps[row], 0) ** 2 / (2 * points.compliance[row]) for row in springs), ca.SX(0))
    return energy


def compliance_of(pair: ContactPoints) -> np.ndarray:
    """Return the compliance (point,) [mm/N] of the points of a pair."""
    return np.zeros(len(pair.P_m)) if pair.stiffness is None else 1 / pair.stiffness


def row_points(system: GroupEquations, standing: Sequence[np.ndarray | int], inputs: Mapping[str, ca.SX]) -> list[RowPoints]:
    """Return the points of the group's pairs that have rows, see contact_qp for `standing` and `inputs`."""
    slots, bends = slot_points(inputs), iter(ca.vertsplit(inputs["bend"], ENTRIES) if inputs["bend"].numel() else [])
    points_of_pairs = []
    for index, points in zip(system.group.pairs, standing, strict=True):
        pair = system.nominal.pairs[index]
        if isinstance(points, int):
            points_of_pairs.append(RowPoints(list(itertools.islice(slots, points)), ca.SX.zeros(points), next(bends)))
        else:
            rows = pair_gaps(pair).points(points, system.deviations)
            points_of_pairs.append(RowPoints(rows, ca.SX(ca.DM(compliance_of(pair)[points]))))
    return points_of_pairs


def slot_points(inputs: Mapping[str, ca.SX]) -> Iterator[Point]:
    """Return the points in the slots."""
    columns = (ca.horzsplit(values) for values in (inputs["P_m"], inputs["P_r"], inputs["n_r"], inputs["filled"].T))
    return iter(zip(*columns, strict=True))
