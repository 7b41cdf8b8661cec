"""Resolve contact: constraint generation around the compiled QP of a group, step by step.

The QP has a few slots for rows. All gaps are scanned, the deepest point of each cluster gets a slot, the QP is solved, and
realizations in which another point is still inside enter again with their carrying points kept. Each round raises the
optimum of a strictly convex problem, so the rounds end, with the solution of the QP that has every row: one linear step.
The linearized resolution takes one. The exact one goes on from the poses reached, with their true gaps, until they stay.
"""

from dataclasses import dataclass

import numpy as np

from tolcontact.simulation.scan import PairScan, pair_scan
from tolcontact.simulation.slots import Slots
from tolcontact.symbolic import ENTRIES, ContactGroup, Program

ROUNDS = 60
STEPS = 60
CLUSTERS = 6
PENETRATION = 1e-10
AT_REST = 1e-9
CARRIES = 1e-4
ADRIFT = 10


@dataclass(frozen=True, eq=False)
class Resolution:
    """What became of the realizations `rows` of a block, as far as one group is concerned.

    poses       (row, part of the group, 12), corrected
    relative    (row, pair of the group, 12): X_RM, corrected
    residual    (row,) [mm]: KKT residual, any penetration left undone, and in the exact resolution the last step
    slack       (row,) [mm]: penetration that no increment could remove
    iterations  (row,): linear steps taken
    slots       which points carry, and their reactions; one for each pair of the group
    """

    rows: np.ndarray
    poses: np.ndarray
    relative: np.ndarray
    residual: np.ndarray
    slack: np.ndarray
    iterations: np.ndarray
    slots: list[Slots]

    def reactions(self) -> np.ndarray:
        """Sum of the reactions of each pair, (row, pair)."""
        return np.stack([slots.reactions.sum(axis=1) for slots in self.slots], axis=1)

    def carrying(self) -> np.ndarray:
        """Number of carrying points of each pair, (row, pair); smaller reactions only oppose the regularization."""
        least = CARRIES * np.max([slots.reactions.max(axis=1) for slots in self.slots], axis=0)
        return np.stack([(slots.reactions > least[:, None]).sum(axis=1) for slots in self.slots], axis=1)


@dataclass(frozen=True, eq=False)
class Task:
    """What stays the same while the realizations `rows` are resolved; first dimension: the row.

    raw          (row, part of the group, 12)
    deviations   (row, locator) [mm]
    moments      (row, side, moment) of the points that count in the objective
    may_carry    (row, point) for each pair of the group
    """

    rows: np.ndarray
    raw: np.ndarray
    deviations: np.ndarray
    moments: np.ndarray
    may_carry: list[np.ndarray]


class ContactResolver:
    """One group of coupled parts, ready to be resolved for blocks of realizations."""

    def __init__(self, program: Program, group: ContactGroup) -> None:
        self.parts = np.array(group.group.parts)
        self.pairs = np.array(group.group.pairs)
        self._group = group.group
        self._slots = group.slots
        self._solve = group.solve
        self._accuracy = program.plugin.accuracy
        self._tolerance = max(program.plugin.accuracy / 100, PENETRATION)
        self._at_rest = max(program.plugin.accuracy / 10, AT_REST)
        self._method = program.method
        self._scans = [
            pair_scan(
                program.nominal.pairs[pair],
                program.gaps[pair],
                [side.table for side in group.group.sides if side.pair == position],
                CLUSTERS,
            )
            for position, pair in enumerate(group.group.pairs)
        ]

    def resolve(self, poses: np.ndarray, relative: np.ndarray, deviations: np.ndarray) -> Resolution:
        """Correct the realizations of a block that this group does not leave as they are.

        poses (realization, part, 12), raw; relative (realization, pair, 12), X_RM of the pairs, raw; deviations
        (realization, locator) [mm]. Forces move every realization, else contact those in which a point is inside.
        """
        gaps = [scan.gaps(relative[:, pair], deviations) for scan, pair in zip(self._scans, self.pairs, strict=True)]
        inside = np.any([gap.min(axis=1) < -self._tolerance for gap in gaps], axis=0)
        rows = np.arange(len(poses)) if self._method.objective == "seating" else np.flatnonzero(inside)
        task = self._task(rows, poses[rows][:, self.parts], deviations[rows], [gap[rows] for gap in gaps])
        result = Resolution(
            rows=rows,
            poses=task.raw.copy(),
            relative=relative[rows][:, self.pairs],
            residual=np.full(len(rows), np.inf),
            slack=np.full(len(rows), np.inf),
            iterations=np.zeros(len(rows), dtype=int),
            slots=[Slots.empty(len(rows), self._slots) for _ in self._scans],
        )
        moving = np.arange(len(rows))
        for _ in range(STEPS if self._method.resolution == "exact" else 1):
            if not moving.size:
                break
            step = self._step(task, result, moving)
            if self._method.resolution == "exact":
                result.residual[moving] = np.maximum(result.residual[moving], step)
            moving = moving[step > self._at_rest]
        if self._method.objective == "seating":
            result.residual[self._adrift(task, result)] = np.inf
        return result

    def _adrift(self, task: Task, result: Resolution) -> np.ndarray:
        """Rows (row,) in which a force finds nothing to rest on, and only the small quadratic term stops its part."""
        apart = [
            displacement(before, after, part.centre)
            for before, after, part in zip(
                task.raw.swapaxes(0, 1), result.poses.swapaxes(0, 1), self._group.carried, strict=True
            )
        ]
        return np.max(apart, axis=0) > ADRIFT * self._group.length

    def _task(self, rows: np.ndarray, raw: np.ndarray, deviations: np.ndarray, gaps: list[np.ndarray]) -> Task:
        active = [gap < self._method.activity for gap in gaps]
        counts = [self._counts(scan, on) for scan, on in zip(self._scans, active, strict=True)]
        return Task(
            rows=rows,
            raw=raw,
            deviations=deviations,
            moments=np.concatenate([scan.moments(on) for scan, on in zip(self._scans, counts, strict=True)], axis=1),
            may_carry=[
                np.ones_like(on) if self._method.active_set == "closed" or scan.locators is not None else on
                for scan, on in zip(self._scans, active, strict=True)
            ],
        )

    def _counts(self, scan: PairScan, active: np.ndarray) -> np.ndarray:
        """Which points (row, point) count in the objective. Supports are not among the paper's contact points."""
        if scan.locators is not None:
            return np.zeros_like(active)
        return np.ones_like(active) if self._method.objective == "all points" else active

    def _step(self, task: Task, result: Resolution, moving: np.ndarray) -> np.ndarray:
        """One linear step of the rows `moving`, and (row,) its size [mm]: the QP in which every point has its row."""
        now = result.poses[moving]
        gaps = [scan.gaps(result.relative[moving, k], task.deviations[moving]) for k, scan in enumerate(self._scans)]
        slots = [s.take(moving) for s in result.slots]
        step = np.zeros(len(moving))
        open_ = np.arange(len(moving))
        for number in range(ROUNDS):
            more = np.full(len(open_), number == 0)
            for k, scan in enumerate(self._scans):
                candidates = np.where(task.may_carry[k][moving[open_]], gaps[k], np.inf)
                slots[k], grown = slots[k].with_deepest(*scan.deepest(candidates), self._tolerance)
                more |= grown
            open_, gaps, slots = open_[more], [gap[more] for gap in gaps], [s.take(more) for s in slots]
            if not open_.size:
                break
            gaps, slots, step[open_] = self._solve_round(task, result, moving[open_], now[open_], slots)
        result.iterations[moving] += 1
        return step

    def _solve_round(
        self, task: Task, result: Resolution, rows: np.ndarray, now: np.ndarray, slots: list[Slots]
    ) -> tuple[list[np.ndarray], list[Slots], np.ndarray]:
        """Solve the QPs of `rows` about the poses `now`, note the answers, return linearized gaps, slots and step sizes."""
        held = [(scan, scan.deviated(task.deviations[rows], s.points), s) for scan, s in zip(self._scans, slots, strict=True)]
        answer = self._answer(
            poses=now,
            raw=task.raw[rows],
            moments=task.moments[rows],
            deviations=task.deviations[rows],
            damping=np.zeros(len(rows)),
            P_m=np.concatenate([scan.P_m[s.points] for scan, _, s in held], axis=1),
            P_r=np.concatenate([P_r for _, P_r, _ in held], axis=1),
            n_r=np.concatenate([scan.n_r[s.points] for scan, _, s in held], axis=1),
            filled=np.concatenate([s.filled for s in slots], axis=1),
        )
        linearized = answer["linearized"].reshape(len(rows), len(self._scans), ENTRIES)
        gaps = [scan.gaps(linearized[:, k], task.deviations[rows]) for k, scan in enumerate(self._scans)]
        inside = [np.where(task.may_carry[k][rows], -gap, -np.inf).max(axis=1) for k, gap in enumerate(gaps)]
        slack = answer["slack"][:, 0]
        # With the rows in conflict every carrying point stays inside by the slack; only what exceeds it is left undone.
        left = np.maximum(np.max(inside, axis=0) - np.maximum(slack, 0), 0)
        residual = np.maximum(_residual(answer), left)
        solved = np.isfinite(residual)
        result.poses[rows[solved]] = answer["corrected"].reshape(len(rows), len(self.parts), ENTRIES)[solved]
        result.relative[rows[solved]] = answer["relative"].reshape(linearized.shape)[solved]
        result.residual[rows] = np.where(solved, residual, np.inf)
        result.slack[rows] = slack
        slots = [s.carrying(m) for s, m in zip(slots, np.split(answer["multipliers"], len(slots), axis=1), strict=True)]
        for kept, s in zip(result.slots, slots, strict=True):
            kept.put(rows, s)
        gaps = [np.where(solved[:, None], gap + np.maximum(slack, 0)[:, None], np.inf) for gap in gaps]
        return gaps, slots, np.where(solved, answer["step"][:, 0], 0.0)

    def _answer(self, **problems: np.ndarray) -> dict[str, np.ndarray]:
        """Outputs of the QPs. One that the solver missed is tried again after a problem without rows.

        qpOASES starts each problem from the previous one, and rarely (some 1e-5 of all) loses its way from there.
        """
        answer, _ = self._solve(**problems)
        for k in np.flatnonzero(~(_residual(answer) <= self._accuracy)):
            one = {name: values[k : k + 1] for name, values in problems.items()}
            self._solve(**{**one, "filled": np.zeros_like(one["filled"])})
            again, _ = self._solve(**one)
            if _residual(again)[0] < _residual(answer)[k]:
                for name, values in again.items():
                    answer[name][k] = values[0]
        return answer


def displacement(before: np.ndarray, after: np.ndarray, p: np.ndarray) -> np.ndarray:
    """How far (row,) [mm] a point with nominal coordinates p (3,) lies apart at poses (row, 12) before and after."""
    change = after - before
    return np.asarray(np.linalg.norm(change[:, :9].reshape(-1, 3, 3) @ p + change[:, 9:], axis=1))


def _residual(answer: dict[str, np.ndarray]) -> np.ndarray:
    """KKT residual (row,) [mm]; infinite where the solver gave nothing usable."""
    residual = np.maximum(answer["stationarity"], answer["natural_residual"])[:, 0]
    usable = np.isfinite(residual) & np.isfinite(answer["corrected"]).all(axis=1)
    return np.where(usable, residual, np.inf)
