"""Resolve contact: constraint generation around the compiled QP of a group, step by step.

The QP has a few slots for rows. All gaps are scanned, the deepest point of each cluster gets a slot, the QP is solved, and
realizations in which another point is still inside enter again with their carrying points kept. Each round raises the
optimum of a strictly convex problem, so the rounds end, with the solution of the QP that has every row: one linear step.
The linearized resolution takes one. The exact one goes on from the poses reached, with their true gaps, until they stay.
With an iterated search, contact points are then projected again, and all of this repeated until the poses stay.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tolcontact.simulation.scan import PairScan, pair_scan
from tolcontact.simulation.search import placed, search
from tolcontact.simulation.slots import Slots
from tolcontact.symbolic import ENTRIES, ContactGroup, Program

ROUNDS = 60
STEPS = 200
HEAVY = 30.0  # largest damping
FREE_STEPS = 8  # later ones count the curvature, and are damped where they grow
SEARCHES = 40
CLUSTERS = 6
PENETRATION = 1e-10  # mm: less than this is no penetration
AT_REST = 1e-9  # mm: a smaller step ends the exact resolution
NOISE = 1e-10  # mm, in the norm of the objective: a smaller step is rounding, in freedoms that next to nothing holds
SETTLED = 1e-6  # mm: poses that move less after a search have settled
CARRIES = 1e-4
ADRIFT = 10
LOST = 1e5


@dataclass(frozen=True, eq=False)
class Resolution:
    """What became of the realizations `rows` of a block, as far as one group is concerned.

    poses       (row, part of the group, 12), corrected
    relative    (row, pair of the group, 12): X_RM, corrected
    residual    (row,) [mm]: KKT residual, any penetration left undone, and the last step of the exact resolution in the norm
                of the objective
    slack       (row, pair of the group) [mm]: penetration that no increment could remove; where the steps came to no rest
                for it, the true penetration at the best poses on the way, which are kept
    iterations  (row,): linear steps taken
    slots       which points carry, and their reactions; one for each pair of the group

    and of all realizations of the block:

    gap_min     (realization, state, pair of the group) [mm]: least true gap
    active      (realization, pair of the group): number of active contact points in the raw state
    """

    rows: np.ndarray
    poses: np.ndarray
    relative: np.ndarray
    residual: np.ndarray
    slack: np.ndarray
    iterations: np.ndarray
    slots: list[Slots]
    gap_min: np.ndarray
    active: np.ndarray

    def reactions(self) -> np.ndarray:
        """Sum of the reactions of each pair, (row, pair)."""
        return np.stack([slots.reactions.sum(axis=1) for slots in self.slots], axis=1)

    def carrying(self) -> np.ndarray:
        """Number of carrying points of each pair, (row, pair); smaller reactions only oppose the regularization."""
        least = CARRIES * np.max([slots.reactions.max(axis=1) for slots in self.slots], axis=0)
        return np.stack([(slots.reactions > least[:, None]).sum(axis=1) for slots in self.slots], axis=1)


@dataclass(frozen=True, eq=False)
class Task:
    """What stays the same while the realizations `rows` are resolved; first dimension of the arrays: the row.

    raw          (row, part of the group, 12)
    deviations   (row, locator) [mm]
    moments      (row, side, moment) of the points that count in the objective
    may_carry    (row, point) for each pair of the group
    """

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
        self._surfaces = [program.nominal.pairs[pair].surface for pair in group.group.pairs]
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
        relative = relative[:, self.pairs]
        scans = self._found(relative)
        gaps = _gaps(scans, relative, deviations)
        inside = np.any([gap.min(axis=1) < -self._tolerance for gap in gaps], axis=0)
        rows = np.arange(len(poses)) if self._method.objective == "seating" else np.flatnonzero(inside)
        active = [gap < self._method.activity for gap in gaps]
        least = np.stack([gap.min(axis=1) for gap in gaps], axis=1)
        result = Resolution(
            rows=rows,
            poses=poses[rows][:, self.parts],
            relative=relative[rows],
            residual=np.full(len(rows), np.inf),
            slack=np.full((len(rows), len(scans)), np.inf),
            iterations=np.zeros(len(rows), dtype=int),
            slots=[Slots.empty(len(rows), self._slots) for _ in scans],
            gap_min=np.stack([least, least], axis=1),
            active=np.stack([on.sum(axis=1) for on in active], axis=1),
        )
        task = self._task(result.poses.copy(), deviations[rows], [on[rows] for on in active])
        scans = [scan.take(rows) for scan in scans]
        self._repeat(task, result, scans, np.arange(len(rows)))
        if self._method.search == "iterated":
            scans = self._settle(task, result)
        if self._method.objective == "seating":
            result.residual[self._drift(task, result, np.arange(len(rows))) > ADRIFT] = np.inf
        least = np.stack([g.min(axis=1) for g in _gaps(scans, result.relative, task.deviations)], axis=1)
        result.gap_min[rows, 1] = least
        if self._method.resolution == "exact" and self._method.active_set == "closed":
            # The solver's word is not enough: what is inside at the poses reached, beyond the slack, counts.
            result.residual[:] = np.maximum(result.residual, np.max(-least - result.slack, axis=1))
        return result

    def _found(self, relative: np.ndarray) -> list[PairScan]:
        """The scans for X_RM (realization, pair, 12), their contact points projected again if the method says so."""
        if self._method.search == "fixed":
            return self._scans
        return [search(*both, relative[:, k]) for k, both in enumerate(zip(self._scans, self._surfaces, strict=True))]

    def _task(self, raw: np.ndarray, deviations: np.ndarray, active: list[np.ndarray]) -> Task:
        counts = [self._counts(scan, on) for scan, on in zip(self._scans, active, strict=True)]
        return Task(
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

    def _settle(self, task: Task, result: Resolution) -> list[PairScan]:
        """Search and resolve again until the poses stay; returns the scans of the last search."""
        searching = np.arange(len(task.raw))
        for _ in range(SEARCHES):
            before = result.poses[searching]
            self._repeat(task, result, self._found(result.relative[searching]), searching)
            moved = self._displacements(before, result.poses[searching])
            searching, moved = searching[moved > SETTLED], moved[moved > SETTLED]
            if not searching.size:
                break
        else:
            result.residual[searching] = np.maximum(result.residual[searching], moved)
        return self._found(result.relative)

    def _repeat(self, task: Task, result: Resolution, scans: Sequence[PairScan], moving: np.ndarray) -> None:
        """Linear steps of the rows `moving` (`scans` are theirs) until they are at rest; in the linearized resolution one."""
        damping = np.zeros(len(moving))
        if self._method.resolution == "linearized":
            self._step(task, result, scans, moving, damping)
            return
        last = np.full(len(moving), np.inf)
        best = result.poses.copy(), result.relative.copy(), np.full(result.slack.shape, np.inf)
        for number in range(STEPS):
            free = number < FREE_STEPS
            step, scaled = self._step(task, result, scans, moving, damping, newton=not free) * (1 + damping)
            on = (step > self._at_rest) & (free | (scaled > NOISE))
            result.residual[moving[~on]] = np.maximum(result.residual[moving[~on]], scaled[~on])
            on[on] = self._drift(task, result, moving[on]) < LOST
            moving, scans = moving[on], [scan.take(on) for scan in scans]
            if not moving.size:
                return
            scaled, damping, last = scaled[on], damping[on], last[on]
            if not free:
                damping = np.where(scaled > last, np.clip(2 * damping, 1, HEAVY), damping / 2)
                self._keep_best(best, task, result, scans, moving)
            last = scaled
        in_conflict = (result.slack[moving] > self._tolerance).any(axis=1)
        stuck = moving[in_conflict]
        result.poses[stuck], result.relative[stuck], result.slack[stuck] = (kept[stuck] for kept in best)
        result.residual[moving] = np.maximum(result.residual[moving], np.where(in_conflict, 0, scaled))

    def _keep_best(
        self, best: tuple[np.ndarray, ...], task: Task, result: Resolution, scans: Sequence[PairScan], rows: np.ndarray
    ) -> None:
        """Put into `best` (poses, relative, true penetration of each pair) what is better than it."""
        gaps = _gaps(scans, result.relative[rows], task.deviations[rows])
        inside = np.stack([np.maximum(-gap.min(axis=1), 0) for gap in gaps], axis=1)
        better = inside.max(axis=1) < best[-1][rows].max(axis=1)
        for kept, new in zip(best, (result.poses[rows], result.relative[rows], inside), strict=True):
            kept[rows[better]] = new[better]

    def _step(
        self,
        task: Task,
        result: Resolution,
        scans: Sequence[PairScan],
        moving: np.ndarray,
        damping: np.ndarray,
        newton: bool = False,
    ) -> np.ndarray:
        """One linear step of the rows `moving`: the QP in which every point has its row.

        Returns its size (2, row) [mm]: that of the largest increment, and in the norm of the objective.
        """
        now = result.poses[moving]
        gaps = _gaps(scans, result.relative[moving], task.deviations[moving])
        slots = before = [s.take(moving) for s in result.slots]
        bend = np.concatenate([_bend(scan, s, task.deviations[moving]) for scan, s in zip(scans, slots, strict=True)], axis=1)
        step = np.zeros((2, len(moving)))
        open_ = np.arange(len(moving))
        for number in range(ROUNDS):
            more = np.full(len(open_), number == 0)
            for k, scan in enumerate(scans):
                candidates = np.where(task.may_carry[k][moving[open_]], gaps[k], np.inf)
                slots[k], grown = slots[k].with_deepest(*scan.deepest(candidates), self._tolerance)
                more |= grown
            open_, gaps = open_[more], [gap[more] for gap in gaps]
            slots, scans = [s.take(more) for s in slots], [scan.take(more) for scan in scans]
            if not open_.size:
                break
            firm = [b.take(open_).reactions_of(s.points) for b, s in zip(before, slots, strict=True)]
            curved = {
                "newton": np.full(len(open_), float(newton)),
                "bend": bend[open_],
                "firm": np.concatenate(firm, axis=1),
                "damping": damping[open_],
            }
            gaps, slots, step[:, open_] = self._solve_round(task, result, scans, moving[open_], now[open_], slots, curved)
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
    ) -> tuple[list[np.ndarray], list[Slots], np.ndarray]:
        """Solve the QPs of `rows` about the poses `now`, note the answers, return linearized gaps, slots and step sizes."""
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
        gaps = _gaps(scans, linearized, deviations)
        inside = [np.where(task.may_carry[k][rows], -gap, -np.inf).max(axis=1) for k, gap in enumerate(gaps)]
        slack = np.maximum(answer["slack"], 0)
        # With the rows in conflict the points that carry stay inside by the slack; only what exceeds it is left undone.
        residual = np.maximum(_residual(answer), np.max(np.transpose(inside) - slack, axis=1))
        solved = np.isfinite(residual)
        result.poses[rows[solved]] = answer["corrected"].reshape(len(rows), len(self.parts), ENTRIES)[solved]
        result.relative[rows[solved]] = answer["relative"].reshape(linearized.shape)[solved]
        result.residual[rows] = np.where(solved, residual, np.inf)
        result.slack[rows[solved]] = slack[solved]
        slots = [s.carrying(m) for s, m in zip(slots, np.split(answer["multipliers"], len(slots), axis=1), strict=True)]
        for kept, s in zip(result.slots, slots, strict=True):
            kept.put(rows, s)
        gaps = [np.where(solved[:, None], gap + slack[:, k, None], np.inf) for k, gap in enumerate(gaps)]
        return gaps, slots, np.where(solved, answer["step"].T, 0.0)

    def _answer(self, **problems: np.ndarray) -> dict[str, np.ndarray]:
        """Outputs of the QPs. One that the solver missed is tried again after a problem without rows.

        qpOASES starts each problem from the previous one, and rarely (some 1e-5 of all) loses its way from there.
        """
        answer, _ = self._solve(**problems)
        for k in np.flatnonzero(~(_residual(answer) <= self._accuracy)):
            one = {name: values[k : k + 1] for name, values in problems.items()}
            one["newton"] = np.zeros(1)
            self._solve(**{**one, "filled": np.zeros_like(one["filled"])})
            again, _ = self._solve(**one)
            if _residual(again)[0] < _residual(answer)[k]:
                for name, values in again.items():
                    answer[name][k] = values[0]
        return answer

    def _drift(self, task: Task, result: Resolution, rows: np.ndarray) -> np.ndarray:
        """How far `rows` have come from their raw pose, in lengths of the group. A force may find nothing to rest on."""
        return self._displacements(task.raw[rows], result.poses[rows]) / self._group.length

    def _displacements(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Largest displacement (row,) [mm] of a contact point between two poses (row, part, 12)."""
        apart = [
            np.linalg.norm(placed(side.points, after[:, side.part]) - placed(side.points, before[:, side.part]), axis=2)
            for side in self._group.sides
        ]
        return np.asarray(np.max([each.max(axis=1) for each in apart], axis=0))


def _gaps(scans: Sequence[PairScan], relative: np.ndarray, deviations: np.ndarray) -> list[np.ndarray]:
    """Gaps (row, point) [mm] of each pair at X_RM (row, pair, 12)."""
    return [scan.gaps(relative[:, k], deviations) for k, scan in enumerate(scans)]


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
