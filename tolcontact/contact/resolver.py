"""Resolve contact, step by step.

The linearized resolution takes one linear step. The exact one goes on from the poses reached, with their true gaps, until
they stay: a sequence of QPs. The first steps are like the paper's. What has not come to rest by then has freedoms that next to
nothing holds, while the curvature of gaps and objective counts: it goes on with Newton steps, and holds those freedoms
firmly first. With an iterated search, contact points are projected again before every linear step, until the poses stay.

Where that ends in a conflict, without an answer, or far from the raw pose, it is tried again from other starts.
"""

import copy
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose
from tolcontact.compilation import ACCURACY, SLOTS, ContactGroup, Program
from tolcontact.contact.doubt import Doubt
from tolcontact.contact.linear_step import PENETRATION, LinearStep
from tolcontact.contact.projection import reach, search
from tolcontact.contact.scan import PairScan, least_gaps, pair_scan
from tolcontact.contact.slots import Slots
from tolcontact.contact.state import CARRIES, Resolution, State, Task
from tolcontact.mechanics import round_pairs

LINEAR = (1.0,) * 8  # firmness of the first steps, which do not count curvature
CURVED = (1e4,) * 6 + (1e2,) * 6 + (1.0,) * 80  # firmness of the steps after those
STRIDE, CAREFUL = 0.5, 0.05  # rad: what a step may turn a part by; linear rows are wrong long before
SEARCHES = 100
SHRINKS, CAUTION = 0.7, 10.0  # of the step before, or of the foreseen gain: what good steps reach; what others cost
UNWORTHY = 1e-6  # mm, in the norm of the objective: its square is what a step gains
CLUSTERS = 6
AT_REST = 1e-9  # mm: a smaller step ends the exact resolution
NOISE = 1e-10  # mm, in the norm of the objective: a smaller step is rounding, in freedoms that next to nothing holds
SETTLED = 1e-8  # mm: a smaller step after a search ends it
PRICE = 1e3  # of a locator that does not hold, beside penetration
ADRIFT = 10  # sizes of the parts: one that came so far has found nothing to rest on
LOST = 1e5  # sizes of the parts: no step will bring it back
BETTER = 1e-6  # of the objective, or mm of penetration: what another start must gain to be preferred


class Start(NamedTuple):
    """Where and how an answer is looked for.

    at_nominal   from the nominal instead of the raw place
    anew         with contact points that are projected again, before every step, onto curved faces
    stride       what a step may turn a part by [rad]
    """

    at_nominal: bool = False
    anew: bool = False
    stride: float = STRIDE


FLAT = (Start(at_nominal=True), Start(stride=CAREFUL))  # where it is tried again, if no face is curved, and
ROUND = (Start(anew=True), Start(anew=True, at_nominal=True))  # if one is


class ContactResolver:
    """One group of coupled parts, ready to be resolved for blocks of realizations."""

    def __init__(self, program: Program, group: ContactGroup) -> None:
        self.parts = np.array(group.group.parts)
        self.pairs = np.array(group.group.pairs)
        self._group = group.group
        self._energy = group.solve.energy
        self._size = max(float(program.nominal.parts[part].mesh.scale) for part in group.group.parts)
        self._step = LinearStep(program, group)
        self._method = program.method
        self._pairs = [program.nominal.pairs[pair] for pair in group.group.pairs]
        self._standing = group.program.standing
        self._scans, self._candidates = [], []
        for position, index in enumerate(group.group.pairs):
            pair, gaps = program.nominal.pairs[index], program.gaps[index]
            tables = [side.table for side in group.group.sides if side.pair == position]
            self._scans.append(pair_scan(pair, gaps, tables, CLUSTERS))
            # Where the paper's set of points may carry, those between the corners count, too.
            some = self._method.search == "fixed" and self._method.active_set == "closed"
            self._candidates.append(pair_scan(pair, gaps, (), CLUSTERS, gaps.corners) if some else self._scans[-1])
        exact_fixed = self._method.resolution == "exact" and self._method.search == "fixed"
        self._round = round_pairs(program.nominal, group.group) if exact_fixed else []
        searched = self._round if self._method.search == "fixed" else range(len(self._pairs))
        self._reaches = {k: reach(self._scans[k]) for k in searched}
        self._doubt = Doubt(program.nominal, group.group, self._method, self._size)

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
        inside = (least < -PENETRATION).any(axis=1)
        rows = np.arange(len(poses)) if self._method.objective == "seating" else np.flatnonzero(inside)
        scans = [scan.take(rows) for scan in scans]
        task = Task(
            raw=poses[rows][:, self.parts],
            relative=relative[rows],
            deviations=deviations[rows],
            moments=np.concatenate([self._moments(k, moments[rows]) for k, (_, moments) in enumerate(surveys)], axis=1),
            may_carry=[self._may_carry(k, scan, relative[rows, k], deviations[rows]) for k, scan in enumerate(scans)],
        )
        state = self._state(task.raw, task.relative)
        self._attempt(task, state, scans, Start())
        starts = np.ones(len(rows), dtype=int)
        if self._method.resolution == "exact":
            self._start_elsewhere(task, state, starts)
        gap_min = np.stack([least, least], axis=1)
        gap_min[rows, 1] = state.gap_min
        return Resolution(
            rows=rows,
            state=state,
            starts=starts,
            gap_min=gap_min,
            active=np.stack([active for active, _ in surveys], axis=1),
        )

    def _state(self, poses: np.ndarray, relative: np.ndarray) -> State:
        return State.start(poses, relative, self._step.spans[-1].stop, len(self._step.varying))

    def _attempt(self, task: Task, state: State, scans: Sequence[PairScan], start: Start) -> None:
        """Go from where `state` is to an answer; `scans` are of the contact points there."""
        every = np.arange(len(task.raw))
        anew = start.anew or self._method.search == "iterated"
        if anew:
            self._settle(task, state, scans, start.stride)
        else:
            self._repeat(task, state, scans, every, start.stride)
        state.searched[:] = anew
        if self._method.objective == "seating":
            # Nothing holds them: they are left where they were.
            adrift = self._drift(task, state, every) > ADRIFT
            state.residual[adrift], state.slack[adrift], state.multipliers[adrift] = np.inf, 0, 0
            state.poses[adrift], state.relative[adrift] = task.raw[adrift], task.relative[adrift]
        scans = self._found(state.relative, anew=anew)
        state.gap_min[:] = least_gaps(scans, state.relative, task.deviations)
        if self._method.resolution == "exact":
            self._recheck(task, state, scans)
        state.doubtful[:] = self._doubt.remains(task, state, lambda rows, pair: self._carriers(state, rows, pair))
        if not anew:
            self._look_round(task, state)

    def _look_round(self, task: Task, state: State) -> None:
        """Doubt answers in which contact points have slid into a curved face, along planes that are not its own there."""
        for k in self._round:
            rows = np.flatnonzero(self._doubt.rolled(k, state))
            if rows.size:
                found = search(self._candidates[k], self._pairs[k].surface, state.relative[rows, k], self._reaches[k])
                inside = -found.least(state.relative[rows, k], task.deviations[rows])
                state.doubtful[rows] |= inside > self._doubt.allowed(k)

    def _recheck(self, task: Task, state: State, scans: Sequence[PairScan]) -> None:
        """The solver's word is not enough: what is inside at the poses reached, beyond the slack, counts."""
        for k, (scan, may_carry) in enumerate(zip(scans, task.may_carry, strict=True)):
            inside = -state.gap_min[:, k]
            if may_carry is not None:
                inside = scan.deepest(state.relative[:, k], task.deviations, may_carry)[1].max(axis=1)
            state.residual[:] = np.maximum(state.residual, inside - state.slack[:, k])
        # Nor does penetration excuse locators that do not hold.
        excused = np.where(state.astray > ACCURACY, state.slack.max(axis=1), 0)
        state.residual[:] = np.maximum(state.residual, state.astray + excused)

    def _start_elsewhere(self, task: Task, state: State, starts: np.ndarray) -> None:
        """Try again what is not certified, or far, from other starts. Keep what is better."""
        left = np.flatnonzero((state.rank > 0) | ~self._doubt.is_near(task, state))
        for start in ROUND if self._round else FLAT:
            if not left.size:
                return
            part = task.take(left)
            poses, relative = self._at_nominal(part) if start.at_nominal else (part.raw, part.relative)
            other = self._state(poses, relative)
            self._attempt(part, other, self._found(relative, anew=start.anew), start)
            starts[left] += 1
            for all_told, more in ((state.iterations, other.iterations), (state.second_answers, other.second_answers)):
                all_told[left] += more
                more[:] = all_told[left]
            better = self._is_better(part, other, state.take(left))
            state.put(left[better], other.take(better))
            left = left[state.rank[left] > 0]

    def _is_better(self, task: Task, state: State, than: State) -> np.ndarray:
        """(row,): whether an answer has a lower rank than another one, or the same and a better objective."""
        energy, before = (self._energy_of(task, each) for each in (state, than))
        inside, before_inside = (each.slack.max(axis=1) for each in (state, than))
        lower = energy < before - BETTER * np.abs(before)
        gains = np.where(state.rank == 0, lower, (state.rank == 1) & (inside < before_inside - BETTER))
        return np.asarray((state.rank < than.rank) | ((state.rank == than.rank) & gains))

    def _energy_of(self, task: Task, state: State) -> np.ndarray:
        return self._energy(poses=state.poses, raw=task.raw, moments=task.moments, deviations=task.deviations)

    def _carriers(self, state: State, rows: np.ndarray, pair: int) -> tuple[np.ndarray, np.ndarray, float]:
        """Of the points of a pair that carry in some rows which row each belongs to, its nominal place (point, 3), and the
        usual distance of the pair's points [mm].
        """
        multipliers = state.multipliers[rows]
        carries = multipliers[:, self.spans[pair]] > CARRIES * multipliers.max(axis=1, initial=0)[:, None]
        standing = self._standing[pair]
        if standing is None:
            slots = state.slots[self._step.varying.index(pair)].take(rows)
            row, column = np.nonzero(carries & slots.filled)
            points = self._candidates[pair].P_m[slots.points[row, column]]
        else:
            row, column = np.nonzero(carries)
            points = self._pairs[pair].P_m[standing[column]]
        return row, points, 2 * reach(self._scans[pair])

    def _at_nominal(self, task: Task) -> tuple[np.ndarray, np.ndarray]:
        """Poses and X_RM with the free parts in their nominal places, and on them what stands on them."""
        poses = task.raw.copy()
        for k, carried in enumerate(self._group.carried):
            if carried.movers:
                lowest = self._group.position(self._group.free[carried.movers[0]])
                poses[:, k] = pose.compose(pose.inverse(task.raw[:, lowest]), task.raw[:, k])
        return poses, self._relative(poses)

    def _relative(self, poses: np.ndarray) -> np.ndarray:
        """X_RM (row, pair, 12) at poses (row, part of the group, 12)."""
        found = []
        for pair in self._pairs:
            moving = poses[:, self._group.position(pair.moving)]
            if pair.reference is not None:
                moving = pose.compose(pose.inverse(poses[:, self._group.position(pair.reference)]), moving)
            found.append(moving)
        return np.stack(found, axis=1)

    def _found(self, relative: np.ndarray, *, anew: bool = False) -> list[PairScan]:
        """Scans of the points that may carry, for X_RM (realization, pair, 12); projected again if the method says so.

        `anew`: those against curved faces are projected again in any case.
        """
        scans = self._candidates
        if anew or self._method.search == "iterated":
            scans = list(scans)
            for k, margin in self._reaches.items():
                scans[k] = search(scans[k], self._pairs[k].surface, relative[:, k], margin)
        return scans

    def _moments(self, pair: int, active: np.ndarray) -> np.ndarray:
        """Moments (realization, side, moment) of the points that count in the objective, given those of active points."""
        scan = self._scans[pair]
        if self._pairs[pair].is_supports:  # they are not among the paper's contact points
            return np.zeros_like(active)
        if self._method.objective != "all points":
            return active
        every = np.array([table.sum(axis=1) for table in scan.tables]).reshape(active.shape[1:])
        return np.broadcast_to(every, active.shape)

    def _may_carry(self, pair: int, scan: PairScan, relative: np.ndarray, deviations: np.ndarray) -> np.ndarray | None:
        """Which points (row, point) may carry: in the paper's set those that are active in the raw state, X_RM (row, 12)."""
        if self._method.is_closed or self._pairs[pair].is_supports:
            return None
        return np.asarray(scan.gaps(relative, deviations) < self._method.activity)

    def _settle(self, task: Task, state: State, scans: Sequence[PairScan], stride: float) -> None:
        """Linear steps, each about points that were projected anew, until they stay.

        More than one step about the same points would let a round part roll on the planes that stand for its counterpart.
        Linear rows do not know how the surfaces curve: steps that neither shrink nor gain are taken with more caution.
        """
        moving = np.arange(len(task.raw))
        first = 1.0 if self._method.objective == "seating" else 0.0  # forces pull far where nothing holds
        caution, before = np.full(len(moving), first), np.full(len(moving), np.inf)
        energy = self._energy_of(task, state)
        for _ in range(SEARCHES):
            for slots in state.slots:  # what carried before may now be beyond the rim
                slots.put(moving, Slots.empty(len(moving), SLOTS))
            step, scaled = self._step.take(task, state, scans, moving, stride=stride, caution=caution)
            now = self._energy_of(task.take(moving), state.take(moving))
            share = (energy - now) / np.maximum(scaled**2 / 2, 1e-300)  # of the gain that the QP foresaw
            idle = (step > SHRINKS * before) & (share < 1 - SHRINKS)
            caution = np.where(idle, np.maximum(CAUTION * caution, 1), np.where(share > SHRINKS, caution / CAUTION, caution))
            on = (step > SETTLED) & ~(idle & (scaled < UNWORTHY))
            if self._method.objective == "seating":
                lost = on & (self._drift(task, state, moving) > LOST)
                state.residual[moving[lost]] = np.inf
                on &= ~lost
            moving, caution, before, energy = moving[on], caution[on], step[on], now[on]
            if not moving.size:
                return
            scans = self._found(state.relative[moving], anew=True)
        state.residual[moving] = np.maximum(state.residual[moving], before)

    def _repeat(self, task: Task, state: State, scans: Sequence[PairScan], moving: np.ndarray, stride: float) -> None:
        """Linear steps of the rows `moving` (`scans` are theirs) until they are at rest; in the linearized resolution one."""
        if self._method.resolution == "linearized":
            self._step.take(task, state, scans, moving, stride=stride)
            return
        kept = state.poses, state.relative, state.multipliers, state.astray, state.slack
        best = [values.copy() for values in kept]
        best[-1][:] = np.inf
        for number, firmness in enumerate(LINEAR + CURVED):
            curved = number >= len(LINEAR)
            step, scaled = self._step.take(task, state, scans, moving, stride=stride, firmness=firmness, newton=curved)
            on = (firmness > 1) | ((step > AT_REST) & ((scaled > NOISE) | (not curved)))
            # The smaller one tells: steps are large in freedoms that nothing holds, and in the norm of the objective where
            # Newton's curvature is stiff.
            unrest = np.minimum(step, scaled)
            state.residual[moving[~on]] = np.maximum(state.residual[moving[~on]], unrest[~on])
            if self._method.objective == "seating":
                lost = on & (self._drift(task, state, moving) > LOST)
                state.residual[moving[lost]] = np.inf
                on &= ~lost
            moving, scans = moving[on], [scan.take(on) for scan in scans]
            if not moving.size:
                return
            if curved:
                self._keep_best(best, task, state, scans, moving)
        stuck = moving[(state.slack[moving] > PENETRATION).any(axis=1)]
        for values, better in zip(kept, best, strict=True):
            values[stuck] = better[stuck]
        # Without rest there is an answer only where penetration is: where the parts contradict each other.
        in_conflict = (state.slack[moving] > ACCURACY).any(axis=1)
        state.residual[moving] = np.maximum(state.residual[moving], np.where(in_conflict, 0, unrest[on]))

    def _keep_best(self, best: list[np.ndarray], task: Task, state: State, scans: Sequence[PairScan], rows: np.ndarray) -> None:
        """Put into `best` (poses, relative, multipliers, astray, true penetration of each pair) what is better than it."""
        inside = np.maximum(-least_gaps(scans, state.relative[rows], task.deviations[rows]), 0)
        wrong = inside.max(axis=1) + PRICE * state.astray[rows]
        is_better = wrong < best[-1][rows].max(axis=1) + PRICE * best[-2][rows]
        better = rows[is_better]
        for values, new in zip(best[:-1], (state.poses, state.relative, state.multipliers, state.astray), strict=True):
            values[better] = new[better]
        best[-1][better] = inside[is_better]

    def _drift(self, task: Task, state: State, rows: np.ndarray) -> np.ndarray:
        """How far `rows` have come from their raw pose, in sizes of the parts. A force may find nothing to rest on."""
        return self._doubt.displacement(task.raw[rows], state.poses[rows]) / self._size
