"""Resolve contact, step by step.

The linearized resolution takes one linear step. The exact one goes on from the poses reached, with their true gaps, until
they stay: a sequence of QPs. The first steps are like the paper's. What has not come to rest by then has freedoms that next to
nothing holds, while the curvature of gaps and objective counts: it goes on with Newton steps, and holds those freedoms
firmly first. With an iterated search, contact points are then projected again, and all of this repeated until the poses stay.
"""

import copy
from collections.abc import Sequence

import numpy as np

from tolcontact.simulation.linear_step import LinearStep
from tolcontact.simulation.resolution import Resolution, Task
from tolcontact.simulation.scan import PairScan, least_gaps, pair_scan
from tolcontact.simulation.search import placed, reach, search
from tolcontact.simulation.slots import Slots
from tolcontact.symbolic import SLOTS, ContactGroup, Program

LINEAR = (1.0,) * 8  # firmness of the first steps, which do not count curvature
CURVED = (1e4,) * 6 + (1e2,) * 6 + (1.0,) * 80  # firmness of the steps after those
SEARCHES = 40
CLUSTERS = 6
AT_REST = 1e-9  # mm: a smaller step ends the exact resolution
NOISE = 1e-10  # mm, in the norm of the objective: a smaller step is rounding, in freedoms that next to nothing holds
SETTLED = 1e-6  # mm: poses that move less after a search have settled
PRICE = 1e3  # of a locator that does not hold, beside penetration
ADRIFT = 10  # sizes of the parts: one that came so far has found nothing to rest on
LOST = 1e5  # sizes of the parts: no step will bring it back


class ContactResolver:
    """One group of coupled parts, ready to be resolved for blocks of realizations."""

    def __init__(self, program: Program, group: ContactGroup) -> None:
        self.parts = np.array(group.group.parts)
        self.pairs = np.array(group.group.pairs)
        self._group = group.group
        self._size = max(float(program.nominal.parts[part].mesh.scale) for part in group.group.parts)
        self._step = LinearStep(program, group)
        self._at_rest = max(program.plugin.accuracy / 10, AT_REST)
        self._accuracy = program.plugin.accuracy
        self._method = program.method
        self._surfaces = [program.nominal.pairs[pair].surface for pair in group.group.pairs]
        self._scans, self._candidates = [], []
        for position, index in enumerate(group.group.pairs):
            pair, gaps = program.nominal.pairs[index], program.gaps[index]
            tables = [side.table for side in group.group.sides if side.pair == position]
            self._scans.append(pair_scan(pair, gaps, tables, CLUSTERS))
            # Where the paper's set of points may carry, those between the corners count, too.
            some = self._method.search == "fixed" and self._method.active_set == "closed"
            self._candidates.append(pair_scan(pair, gaps, (), CLUSTERS, gaps.corners) if some else self._scans[-1])
        self._reaches = [reach(scan) for scan in self._scans] if self._method.search == "iterated" else []

    def twin(self) -> "ContactResolver":
        """The same for another thread."""
        other = copy.copy(self)
        other._step = self._step.twin()
        return other

    def start_over(self) -> None:
        """Forget all problems solved before, so that the next ones do not depend on them."""
        self._step.start_over()

    @property
    def spans(self) -> list[slice]:
        """The rows of each pair in the QP."""
        return self._step.spans

    def resolve(self, poses: np.ndarray, relative: np.ndarray, deviations: np.ndarray) -> Resolution:
        """Correct the realizations of a block that this group does not leave as they are.

        poses (realization, part, 12), raw; relative (realization, pair, 12), X_RM of the pairs, raw; deviations
        (realization, locator) [mm]. Forces move every realization, else contact those in which a point is inside.
        """
        relative = relative[:, self.pairs]
        scans = self._found(relative)
        surveyed = self._scans if self._method.search == "fixed" else scans
        surveys = [scan.survey(relative[:, k], deviations, self._method.activity) for k, scan in enumerate(surveyed)]
        least = least_gaps(scans, relative, deviations)
        inside = (least < -self._step.tolerance).any(axis=1)
        rows = np.arange(len(poses)) if self._method.objective == "seating" else np.flatnonzero(inside)
        result = Resolution(
            rows=rows,
            poses=poses[rows][:, self.parts],
            relative=relative[rows],
            residual=np.full(len(rows), np.inf),
            slack=np.full((len(rows), len(scans)), np.inf),
            astray=np.zeros(len(rows)),
            iterations=np.zeros(len(rows), dtype=int),
            multipliers=np.zeros((len(rows), self._step.spans[-1].stop)),
            slots=[Slots.empty(len(rows), SLOTS) for _ in self._step.varying],
            gap_min=np.stack([least, least], axis=1),
            active=np.stack([active for active, _ in surveys], axis=1),
        )
        scans = [scan.take(rows) for scan in scans]
        task = Task(
            raw=result.poses.copy(),
            deviations=deviations[rows],
            moments=np.concatenate([self._moments(k, moments[rows]) for k, (_, moments) in enumerate(surveys)], axis=1),
            may_carry=[self._may_carry(scan, relative[rows, k], deviations[rows]) for k, scan in enumerate(scans)],
        )
        self._repeat(task, result, scans, np.arange(len(rows)))
        if self._method.search == "iterated":
            scans = self._settle(task, result)
        if self._method.objective == "seating":
            # Nothing holds them: they are left where they were.
            adrift = self._drift(task, result, np.arange(len(rows))) > ADRIFT
            result.residual[adrift], result.slack[adrift], result.multipliers[adrift] = np.inf, 0, 0
            result.poses[adrift], result.relative[adrift] = task.raw[adrift], relative[rows][adrift]
            scans = self._found(result.relative) if self._method.search == "iterated" else scans
        least = least_gaps(scans, result.relative, task.deviations)
        result.gap_min[rows, 1] = least
        if self._method.resolution == "exact":
            # The solver's word is not enough: what is inside at the poses reached, beyond the slack, counts.
            for k, (scan, may_carry) in enumerate(zip(scans, task.may_carry, strict=True)):
                inside = -least[:, k]
                if may_carry is not None:
                    inside = scan.deepest(result.relative[:, k], task.deviations, may_carry)[1].max(axis=1)
                result.residual[:] = np.maximum(result.residual, inside - result.slack[:, k])
            # Nor does penetration excuse locators that do not hold.
            excused = np.where(result.astray > self._accuracy, result.slack.max(axis=1), 0)
            result.residual[:] = np.maximum(result.residual, result.astray + excused)
        return result

    def _found(self, relative: np.ndarray) -> list[PairScan]:
        """Scans of the points that may carry, for X_RM (realization, pair, 12), projected again if the method says so."""
        if self._method.search == "fixed":
            return self._candidates
        each = zip(self._scans, self._surfaces, self._reaches, strict=True)
        return [search(scan, surface, relative[:, k], margin) for k, (scan, surface, margin) in enumerate(each)]

    def _moments(self, pair: int, active: np.ndarray) -> np.ndarray:
        """Moments (realization, side, moment) of the points that count in the objective, given those of active points."""
        scan = self._scans[pair]
        if scan.locators is not None:  # supports are not among the paper's contact points
            return np.zeros_like(active)
        if self._method.objective != "all points":
            return active
        every = np.array([table.sum(axis=1) for table in scan.tables]).reshape(active.shape[1:])
        return np.broadcast_to(every, active.shape)

    def _may_carry(self, scan: PairScan, relative: np.ndarray, deviations: np.ndarray) -> np.ndarray | None:
        """Which points (row, point) may carry: in the paper's set those that are active in the raw state, X_RM (row, 12)."""
        if self._method.active_set == "closed" or scan.locators is not None:
            return None
        return np.asarray(scan.gaps(relative, deviations) < self._method.activity)

    def _settle(self, task: Task, result: Resolution) -> list[PairScan]:
        """Search and resolve again until the poses stay; returns the scans of the last search."""
        searching = np.arange(len(task.raw))
        for _ in range(SEARCHES):
            before = result.poses[searching]
            for slots in result.slots:  # what carried before may now be beyond the rim
                slots.put(searching, Slots.empty(len(searching), SLOTS))
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
        if self._method.resolution == "linearized":
            self._step.take(task, result, scans, moving)
            return
        kept = result.poses, result.relative, result.multipliers, result.astray, result.slack
        best = [values.copy() for values in kept]
        best[-1][:] = np.inf
        for number, firmness in enumerate(LINEAR + CURVED):
            curved = number >= len(LINEAR)
            step, scaled = self._step.take(task, result, scans, moving, firmness=firmness, newton=curved)
            on = (firmness > 1) | ((step > self._at_rest) & ((scaled > NOISE) | (not curved)))
            result.residual[moving[~on]] = np.maximum(result.residual[moving[~on]], scaled[~on])
            if self._method.objective == "seating":
                lost = on & (self._drift(task, result, moving) > LOST)
                result.residual[moving[lost]] = np.inf
                on &= ~lost
            moving, scans = moving[on], [scan.take(on) for scan in scans]
            if not moving.size:
                return
            if curved:
                self._keep_best(best, task, result, scans, moving)
        stuck = moving[(result.slack[moving] > self._step.tolerance).any(axis=1)]
        for values, better in zip(kept, best, strict=True):
            values[stuck] = better[stuck]
        # Without rest there is an answer only where penetration is: where the parts contradict each other.
        in_conflict = (result.slack[moving] > self._accuracy).any(axis=1)
        result.residual[moving] = np.maximum(result.residual[moving], np.where(in_conflict, 0, scaled[on]))

    def _keep_best(
        self, best: list[np.ndarray], task: Task, result: Resolution, scans: Sequence[PairScan], rows: np.ndarray
    ) -> None:
        """Put into `best` (poses, relative, multipliers, astray, true penetration of each pair) what is better than it."""
        inside = np.maximum(-least_gaps(scans, result.relative[rows], task.deviations[rows]), 0)
        wrong = inside.max(axis=1) + PRICE * result.astray[rows]
        is_better = wrong < best[-1][rows].max(axis=1) + PRICE * best[-2][rows]
        better = rows[is_better]
        for values, new in zip(best[:-1], (result.poses, result.relative, result.multipliers, result.astray), strict=True):
            values[better] = new[better]
        best[-1][better] = inside[is_better]

    def _drift(self, task: Task, result: Resolution, rows: np.ndarray) -> np.ndarray:
        """How far `rows` have come from their raw pose, in sizes of the parts. A force may find nothing to rest on."""
        return self._displacements(task.raw[rows], result.poses[rows]) / self._size

    def _displacements(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Largest displacement (row,) [mm] of a contact point between two poses (row, part, 12)."""
        apart = [
            np.linalg.norm(placed(side.points, after[:, side.part]) - placed(side.points, before[:, side.part]), axis=2)
            for side in self._group.sides
        ]
        return np.asarray(np.max([each.max(axis=1) for each in apart], axis=0))
