"""Resolve contact: constraint generation around the compiled QP of a group.

The QP has a few slots for rows. All gaps are scanned, the deepest point of each cluster gets a slot, the QP is solved, and
realizations in which another point is still inside enter again with their carrying points kept. Each round raises the
optimum of a strictly convex problem, so the rounds end, with the solution of the QP that has every row.
"""

from dataclasses import dataclass

import numpy as np

from tolcontact.simulation.scan import pair_scan
from tolcontact.symbolic import ENTRIES, ContactGroup, Program

ROUNDS = 60
CLUSTERS = 6
PENETRATION = 1e-10
KEPT = 8


@dataclass(frozen=True, eq=False)
class Resolution:
    """Corrections of the realizations `rows` of a block.

    poses       (row, part of the group, 12)
    residual    (row,) [mm]: KKT residual, and any linearized penetration left
    slack       (row,) [mm]: penetration that no increment could remove
    """

    rows: np.ndarray
    poses: np.ndarray
    residual: np.ndarray
    slack: np.ndarray


class ContactResolver:
    """One group of coupled parts, ready to be resolved for blocks of realizations."""

    def __init__(self, program: Program, group: ContactGroup) -> None:
        self.parts = np.array(group.group.parts)
        self.pairs = np.array(group.group.pairs)
        self._slots = group.slots
        self._solve = group.solve
        self._accuracy = program.plugin.accuracy
        self._tolerance = max(program.plugin.accuracy / 100, PENETRATION)
        self._activity = program.method.activity
        self._closed = program.method.active_set == "closed"
        self._scans = [
            pair_scan(
                program.nominal.pairs[pair],
                program.gaps[pair],
                [side.table for side in group.group.sides if side.pair == position],
                CLUSTERS,
            )
            for position, pair in enumerate(group.group.pairs)
        ]

    def resolve(self, poses: np.ndarray, relative: np.ndarray) -> Resolution:
        """Correct the realizations of a block in which a point of this group is inside.

        poses (realization, part, 12), raw; relative (realization, pair, 12), X_RM of the pairs, raw.
        """
        gaps = [scan.gaps(relative[:, pair]) for scan, pair in zip(self._scans, self.pairs, strict=True)]
        rows = np.flatnonzero(np.any([gap.min(axis=1) < -self._tolerance for gap in gaps], axis=0))
        gaps = [gap[rows] for gap in gaps]
        active = [gap < self._activity for gap in gaps]
        moments = np.concatenate([scan.moments(on) for scan, on in zip(self._scans, active, strict=True)], axis=1)
        may_carry = [np.ones_like(on) if self._closed else on for on in active]
        result = Resolution(rows, poses[rows][:, self.parts].copy(), np.full(len(rows), np.inf), np.full(len(rows), np.inf))
        slots = [Slots.empty(len(rows), self._slots) for _ in self._scans]
        open_ = np.arange(len(rows))
        raw = poses[rows][:, self.parts]
        for _ in range(ROUNDS):
            more = np.zeros(len(open_), dtype=bool)
            for k, scan in enumerate(self._scans):
                inside = np.where(may_carry[k][open_], gaps[k], np.inf)
                slots[k], grown = slots[k].with_deepest(*scan.deepest(inside), self._tolerance)
                more |= grown
            open_, gaps, slots = open_[more], [g[more] for g in gaps], [s.take(more) for s in slots]
            if not open_.size:
                break
            gaps, slots = self._solve_round(result, open_, raw, moments, may_carry, slots)
        return result

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

    def _solve_round(
        self,
        result: Resolution,
        open_: np.ndarray,
        raw: np.ndarray,
        moments: np.ndarray,
        may_carry: list[np.ndarray],
        slots: "list[Slots]",
    ) -> "tuple[list[np.ndarray], list[Slots]]":
        """Solve the QPs of the open realizations, note the answers, and return linearized gaps and slots after it."""
        held = [(scan, s.points) for scan, s in zip(self._scans, slots, strict=True)]
        answer = self._answer(
            poses=raw[open_],
            moments=moments[open_],
            P_m=np.concatenate([scan.P_m[points] for scan, points in held], axis=1),
            P_r=np.concatenate([scan.P_r[points] for scan, points in held], axis=1),
            n_r=np.concatenate([scan.n_r[points] for scan, points in held], axis=1),
            filled=np.concatenate([s.filled for s in slots], axis=1),
        )
        linearized = answer["linearized"].reshape(len(open_), len(self._scans), ENTRIES)
        gaps = [scan.gaps(linearized[:, k]) for k, scan in enumerate(self._scans)]
        inside = [np.where(may_carry[k][open_], -gap, -np.inf).max(axis=1) for k, gap in enumerate(gaps)]
        slack = answer["slack"][:, 0]
        # With the rows in conflict every carrying point stays inside by the slack; only what exceeds it is left undone.
        left = np.maximum(np.max(inside, axis=0) - np.maximum(slack, 0), 0)
        residual = np.maximum(_residual(answer), left)
        solved = np.isfinite(residual)
        result.poses[open_[solved]] = answer["corrected"].reshape(len(open_), len(self.parts), ENTRIES)[solved]
        result.residual[open_] = np.where(solved, residual, np.inf)
        result.slack[open_] = slack
        multipliers = np.split(answer["multipliers"], len(self._scans), axis=1)
        gaps = [np.where(solved[:, None], gap + np.maximum(slack, 0)[:, None], np.inf) for gap in gaps]
        return gaps, [s.carrying(m) for s, m in zip(slots, multipliers, strict=True)]


def _residual(answer: dict[str, np.ndarray]) -> np.ndarray:
    """KKT residual (row,) [mm]; infinite where the solver gave nothing usable."""
    residual = np.maximum(answer["stationarity"], answer["natural_residual"])[:, 0]
    usable = np.isfinite(residual) & np.isfinite(answer["corrected"]).all(axis=1)
    return np.where(usable, residual, np.inf)


@dataclass(frozen=True, eq=False)
class Slots:
    """Which contact points of a pair have a row: points (row, slot), and which slots are in use (row, slot)."""

    points: np.ndarray
    filled: np.ndarray

    @classmethod
    def empty(cls, rows: int, slots: int) -> "Slots":
        return cls(np.zeros((rows, slots), dtype=int), np.zeros((rows, slots), dtype=bool))

    def take(self, rows: np.ndarray) -> "Slots":
        return Slots(self.points[rows], self.filled[rows])

    def carrying(self, multipliers: np.ndarray) -> "Slots":
        """Only the slots whose rows carry, at most KEPT of them, largest multipliers first."""
        largest = np.where(self.filled, multipliers, 0.0)
        order = np.argsort(-largest, axis=1, kind="stable")
        sorted_ = np.take_along_axis(largest, order, axis=1)
        carries = sorted_ > 1e-9 * np.maximum(sorted_[:, :1], 1e-9)
        carries[:, KEPT:] = False
        return Slots(np.take_along_axis(self.points, order, axis=1), carries)

    def with_deepest(self, points: np.ndarray, depth: np.ndarray, tolerance: float) -> "tuple[Slots, np.ndarray]":
        """Fill the free slots with the deepest of the candidate `points` (row, cluster) that are inside.

        Returns the new slots, and (row,) whether any candidate was new.
        """
        known = ((points[:, :, None] == self.points[:, None, :]) & self.filled[:, None, :]).any(axis=2)
        new = (depth > tolerance) & ~known
        urgency = np.hstack([np.where(self.filled, np.inf, -np.inf), np.where(new, depth, -np.inf)])
        order = np.argsort(-urgency, axis=1, kind="stable")[:, : self.points.shape[1]]
        every = np.hstack([self.points, points])
        filled = np.take_along_axis(urgency, order, axis=1) > -np.inf
        return Slots(np.take_along_axis(every, order, axis=1), filled), new.any(axis=1)
