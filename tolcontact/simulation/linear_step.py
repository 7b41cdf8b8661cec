"""One linear step: constraint generation around the compiled QP of a group.

The QP has a few slots for rows. All gaps are scanned, the deepest point of each cluster gets a slot, the QP is solved, and
realizations in which another point is still inside enter again with their carrying points kept. Each round raises the
optimum of a strictly convex problem, so the rounds end, with the solution of the QP that has every row.
"""

from collections.abc import Sequence

import numpy as np

from tolcontact.simulation.resolution import Resolution, Task
from tolcontact.simulation.scan import PairScan
from tolcontact.simulation.slots import Slots
from tolcontact.symbolic import ENTRIES, ContactGroup, Program

ROUNDS = 60
PENETRATION = 1e-10  # mm: less than this is no penetration


class LinearStep:
    """The QP of one group, ready to be solved for many realizations."""

    def __init__(self, program: Program, group: ContactGroup) -> None:
        self._solve = group.solve
        self._parts = len(group.group.parts)
        self._accuracy = program.plugin.accuracy
        self.tolerance = max(program.plugin.accuracy / 100, PENETRATION)

    def take(
        self,
        task: Task,
        result: Resolution,
        scans: Sequence[PairScan],
        moving: np.ndarray,
        *,
        firmness: float = 1.0,
        newton: bool = False,
    ) -> np.ndarray:
        """One linear step of the rows `moving`: the QP in which every point has its row.

        `newton` counts the curvature of objective and gaps, `firmness` multiplies the regularization. Returns the step's size
        (2, row) [mm]: that of the largest increment, and in the norm of the objective.
        """
        now = result.poses[moving]
        seen = _deepest(task, scans, moving, result.relative[moving])
        before = [s.take(moving) for s in result.slots]
        bend = np.zeros((len(moving), ENTRIES * len(scans)))
        if newton:
            each = zip(scans, before, strict=True)
            bend[:] = np.concatenate([_bend(scan, s, task.deviations[moving]) for scan, s in each], axis=1)
        slots = list(before)
        step = np.zeros((2, len(moving)))
        open_ = np.arange(len(moving))
        for number in range(ROUNDS):
            more = np.full(len(open_), number == 0)
            for k, (points, depth) in enumerate(seen):
                slots[k], grown = slots[k].with_deepest(points, depth, self.tolerance)
                more |= grown
            open_ = open_[more]
            slots, scans = [s.take(more) for s in slots], [scan.take(more) for scan in scans]
            if not open_.size:
                break
            reactions = [
                b.take(open_).reactions_of(s.points) if newton else np.zeros(s.points.shape)
                for b, s in zip(before, slots, strict=True)
            ]
            curved = {
                "firmness": np.full(len(open_), firmness),
                "newton": np.full(len(open_), float(newton)),
                "bend": bend[open_],
                "reactions": np.concatenate(reactions, axis=1),
            }
            seen, slots, step[:, open_] = self._solve_round(task, result, scans, moving[open_], now[open_], slots, curved)
        result.iterations[moving] += 1
        return step

    def _solve_round(
        self,
        task: Task,
        result: Resolution,
        scans: Sequence[PairScan],
        rows: np.ndarray,
        now: np.ndarray,
        slots: list[Slots],
        curved: dict[str, np.ndarray],
    ) -> tuple[list[tuple[np.ndarray, np.ndarray]], list[Slots], np.ndarray]:
        """Solve the QPs of `rows` about the poses `now`, note the answers.

        Returns for each pair the deepest points and by how much they are deeper than the slack, slots, and step sizes.
        """
        deviations = task.deviations[rows]
        held = zip(*(scan.rows(s.points, deviations) for scan, s in zip(scans, slots, strict=True)), strict=True)
        P_m, P_r, n_r = (np.concatenate(arrays, axis=1) for arrays in held)
        answer = self._answer(
            poses=now,
            raw=task.raw[rows],
            moments=task.moments[rows],
            deviations=deviations,
            **curved,
            P_m=P_m,
            P_r=P_r,
            n_r=n_r,
            filled=np.concatenate([s.filled for s in slots], axis=1),
        )
        linearized = answer["linearized"].reshape(len(rows), len(scans), ENTRIES)
        seen = _deepest(task, scans, rows, linearized)
        inside = np.stack([depth.max(axis=1) for _, depth in seen], axis=1)
        slack = np.maximum(answer["slack"], 0)
        # With the rows in conflict the points that carry stay inside by the slack; only what exceeds it is left undone.
        residual = np.maximum(_residual(answer), np.max(inside - slack, axis=1))
        solved = np.isfinite(residual)
        result.poses[rows[solved]] = answer["corrected"].reshape(len(rows), self._parts, ENTRIES)[solved]
        result.relative[rows[solved]] = answer["relative"].reshape(linearized.shape)[solved]
        result.residual[rows] = np.where(solved, residual, np.inf)
        result.slack[rows[solved]] = slack[solved]
        multipliers = np.maximum(answer["multipliers"], 0)
        result.multipliers[rows[solved]] = multipliers.reshape(len(rows), len(slots), -1)[solved]
        slots = [s.carrying(m) for s, m in zip(slots, np.split(multipliers, len(slots), axis=1), strict=True)]
        for kept, s in zip(result.slots, slots, strict=True):
            kept.put(rows, s)
        deeper = [np.where(solved[:, None], depth - slack[:, k, None], -np.inf) for k, (_, depth) in enumerate(seen)]
        seen = [(points, depth) for (points, _), depth in zip(seen, deeper, strict=True)]
        return seen, slots, np.where(solved, answer["step"].T, 0.0)

    def _answer(self, **problems: np.ndarray) -> dict[str, np.ndarray]:
        """Outputs of the QPs. One that the solver missed is tried again after a problem without rows.

        qpOASES starts each problem from the previous one, and rarely (some 1e-5 of all) loses its way from there.
        """
        answer = self._solve(**problems)
        for k in np.flatnonzero(~(_residual(answer) <= self._accuracy)):
            one = {name: values[k : k + 1] for name, values in problems.items()}
            one["newton"] = np.zeros(1)
            self._solve(**{**one, "filled": np.zeros_like(one["filled"])})
            again = self._solve(**one)
            if _residual(again)[0] < _residual(answer)[k]:
                for name, values in again.items():
                    answer[name][k] = values[0]
        return answer


def _deepest(
    task: Task, scans: Sequence[PairScan], rows: np.ndarray, relative: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Of each pair the deepest points that may carry, (row, cluster), and their depth [mm], at X_RM (row, pair, 12)."""
    found = []
    for k, (scan, may_carry) in enumerate(zip(scans, task.may_carry, strict=True)):
        mask = None if may_carry is None else may_carry[rows]
        found.append(scan.deepest(relative[:, k], task.deviations[rows], mask))
    return found


def _bend(scan: PairScan, slots: Slots, deviations: np.ndarray) -> np.ndarray:
    """The reactions' sum of the gaps' gradients by the entries of X_RM, (row, 12)."""
    P_m, _, n_r = scan.rows(slots.points, deviations)
    weighted = slots.reactions[..., None] * n_r
    turning = (weighted[..., :, None] * P_m[..., None, :]).sum(axis=1)
    return np.concatenate([turning.reshape(len(turning), 9), weighted.sum(axis=1)], axis=1)


def _residual(answer: dict[str, np.ndarray]) -> np.ndarray:
    """KKT residual (row,) [mm]; infinite where the solver gave nothing usable."""
    residual = np.maximum(answer["stationarity"], answer["natural_residual"])[:, 0]
    usable = np.isfinite(residual) & np.isfinite(answer["corrected"]).all(axis=1)
    return np.where(usable, residual, np.inf)
