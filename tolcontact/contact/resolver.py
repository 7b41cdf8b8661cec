"""Resolve contact: move a group of parts from raw poses to poses without penetration, and rate the certainty of the answer.

The linearized resolution takes one linear step. The exact one repeats them (see repeated_steps), from some starts about
contact points that are projected again (see iterated_search). Realizations that end in a conflict, without an answer, or
far from the raw pose are tried again from other starts (see starts).
"""

import copy
from dataclasses import replace

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation import ACCURACY, ContactGroup, Program
from tolcontact.contact.acceptance import ADRIFT_SIZES, MAX_TURN, AcceptanceLimits
from tolcontact.contact.candidates import Candidates
from tolcontact.contact.fixed_search import Search
from tolcontact.contact.free_steps import FreeSteps
from tolcontact.contact.iterated_search import search
from tolcontact.contact.linear_step import MAX_ROUNDS, LinearStep
from tolcontact.contact.record import accumulate_starts
from tolcontact.contact.repeated_steps import repeat
from tolcontact.contact.scan import PENETRATION, min_gaps, undone
from tolcontact.contact.starts import FIRST, RESCUES, Start
from tolcontact.contact.state import Outcome, Resolved, State, Task
from tolcontact.interference import ordered

SAME_CONFLICT = 1e-3  # conflicts whose penetration differs by less than this share count as the same
UNMOVED = 1e-9  # mm: contact moves bodies by more
MIN_GAIN = 1e-6  # mm of penetration: the gain for which another start is preferred
MIN_SLANT = 0.02  # rims whose gap has a smaller slant lose less than a thousandth of the objective, in experience


class ContactResolver:
    """One group of coupled parts, ready to be resolved for blocks of realizations."""

    def __init__(
        self, program: Program, group: ContactGroup, *, max_rounds: int = MAX_ROUNDS, max_turn: float = MAX_TURN
    ) -> None:
        self.parts = np.array(group.group.parts)
        self.pairs = np.array(group.group.pairs)
        self._group = group.group
        self._energy, self._relate = group.solve.energy, group.solve.relative
        self._step = LinearStep(program, group, max_rounds)
        self._method = program.method
        self._candidates = Candidates(program, group)
        self.flexibility = group.qp.flexibility
        self._force = sum(float(np.linalg.norm(load.vector)) for load in group.group.loads) or 1.0
        self.contact_points = [program.nominal.pairs[index] for index in group.group.pairs]
        self._springy = [k for k, pair in enumerate(self.contact_points) if pair.is_springy]
        self._limits = AcceptanceLimits(program, group.group, self._candidates, max_turn)
        self._free_steps = FreeSteps(group.group, self._candidates, self._limits, self._relate, self._energy_of)

    def twin(self) -> "ContactResolver":
        """Return the same resolver for another thread."""
        twin = copy.copy(self)
        twin._step = self._step.twin()
        return twin

    def start_over(self) -> None:
        """Forget all problems solved before, so that the next ones do not depend on them."""
        self._step.start_over()

    @property
    def spans(self) -> list[slice]:
        """The rows of each pair in the QP."""
        return self._step.spans

    @property
    def watched(self) -> list[tuple[int, int]]:
        """Pairs of bodies that interfere in no certified answer, whatever deviates: they are tested here."""
        return [
            ordered(pair.moving, pair.reference)
            for k, pair in enumerate(self.contact_points)
            if k in self._candidates.guards
            and pair.reference is not None
            and not any(pair.deviating)
            and not self._candidates.guards[k].neighbours.varies
        ]

    def raw_contact(
        self, relative: Float[Array, "realization pair 12"], deviations: Float[Array, "realization contributor"]
    ) -> tuple[Float[Array, "realization pair_of_group"], Int[Array, "realization pair_of_group"]]:
        """Return the smallest gap [mm] and the number of active points of each pair of the group at raw X_RM."""
        relative = relative[:, self.pairs]
        scans = self._candidates.scans(relative, deviations)
        return min_gaps(scans, relative, deviations), self._candidates.survey(relative, deviations)[0]

    def resolve(
        self,
        poses: Float[Array, "realization part 12"],
        relative: Float[Array, "realization pair 12"],
        deviations: Float[Array, "realization contributor"],
    ) -> Resolved:
        """Correct the realizations of a block that contact in this group changes.

        Forces move every realization; without forces, contact moves only realizations with a point inside.

        poses        (realization, part, 12), raw
        relative     (realization, pair, 12): X_RM of the pairs, raw
        deviations   (realization, contributor)
        """
        relative = relative[:, self.pairs]
        scans = self._candidates.scans(relative, deviations)
        active, moments = self._candidates.survey(relative, deviations)
        raw_gap = min_gaps(scans, relative, deviations)
        depth_between = np.stack([scan.depth_between(relative[:, k]) for k, scan in enumerate(scans)]).max(axis=0)
        moves = np.any(raw_gap < -PENETRATION, axis=1) | (depth_between > 0) | self._method.minimizes.presses
        unseen = np.flatnonzero(~moves)
        moves[unseen] = self._candidates.interfere(relative[unseen], deviations[unseen])
        touched = np.flatnonzero(moves)
        task = Task(
            raw=poses[touched][:, self.parts],
            relative=relative[touched],
            deviations=deviations[touched],
            moments=moments[touched],
            may_carry=self._candidates.may_carry(relative[touched], deviations[touched]),
            scans=[scan.take(touched) for scan in scans],
        )
        state = self._step.start(task.raw, task.relative)
        self._attempt(task, state, FIRST)
        if self._method.is_exact:
            self._rescue(task, state, raw_gap[touched])
        gap_min = np.stack([raw_gap, raw_gap], axis=1)
        gap_min[touched, 1] = state.gap_min
        is_loaded = (state.multipliers > 0).any(axis=1) | self._method.minimizes.presses
        # The raw poses are the answer, without contact.
        stays = state.certified & ~is_loaded & (self._limits.displacement(task.raw, state.poses) <= UNMOVED)
        gap_min[touched[stays], 0] = state.gap_min[stays]
        return Resolved(touched[~stays], state.take(np.flatnonzero(~stays)), gap_min, active)

    def _attempt(self, task: Task, state: State, start: Start) -> None:
        """Take steps from the poses of `state` to an answer, and judge it."""
        if start.projected:
            caution = 1.0 if self._method.minimizes.presses else 0.0  # forces pull parts far if nothing holds them
            search(self._step, self._limits, self._candidates, self._energy_of, task, state, start, caution)
        elif self._method.is_exact:
            repeat(self._step, self._limits, self._candidates, self._free_steps, task, state, start)
        else:
            self._step.take(task, state, stride=start.stride)
        state.searched[:] = start.projected
        adrift = self._limits.have_drifted(task, state, ADRIFT_SIZES)  # nothing holds a part against its forces
        state.kkt_residual[adrift], state.slack[adrift], state.multipliers[adrift] = np.inf, 0, 0
        state.poses[adrift], state.relative[adrift] = task.raw[adrift], task.relative[adrift]
        at_rest = Search(start, ceilings=None if start.free else np.full(len(state), self._candidates.ceiling))
        scans = self._candidates.scans(state.relative, task.deviations, at_rest, slots=state.slots, earlier=task.scans)
        task = replace(task, scans=scans)
        state.gap_min[:] = min_gaps(task.scans, state.relative, task.deviations)
        if self._method.is_exact:
            depth = undone(task.scans, state.gap_min, state.relative, task.deviations, task.may_carry, state.slack)
            self._check_springs(task, state, depth)
            state.kkt_residual[:] = checked_residual(state, depth.max(axis=1))
        state.doubtful[:] = self._limits.is_doubtful(task, state)
        certified = np.flatnonzero(state.certified)
        state.doubtful[certified] = self._candidates.interfere(state.relative[certified], task.deviations[certified])
        state.doubtful[:] |= self._candidates.are_apart(state) & state.certified
        state.doubtful[:] |= self._candidates.bulge(task.scans, state.relative) & state.certified
        state.doubtful[:] |= self._limits.lie_in_form(task, state)
        if not start.projected:
            state.doubtful[:] |= self._limits.have_rolled(task, state)

    def _check_springs(self, task: Task, state: State, depth: Float[Array, "n pair"]) -> None:
        """Write into `depth` [mm] how far compliant pairs miss their law, and the gaps between bent parts into the state.

        Springs push with their stiffness times their compression, and do not pull; a rigid support among them may not be
        inside. Between bent parts a two-sided locator has no gap. Other points are open without a reaction, or closed: they do
        not penetrate, and the compression that their own reaction alone would cause is not negative.
        """
        flexibility = self.flexibility
        openings = None if flexibility is None else flexibility.openings(state.multipliers)
        for k in self._springy:
            pair, span = self.contact_points[k], self.spans[k]
            gaps = self._candidates.pairs[k].gaps(state.relative[:, k], task.deviations)
            reactions = state.multipliers[:, span]
            if flexibility is None or openings is None:
                assert pair.stiffness is not None
                compression = reactions / pair.stiffness
                misfits = np.minimum(gaps + compression, compression)
            else:
                gaps += openings[:, span]
                gaps = -np.abs(gaps) if pair.holds else gaps  # it has no gap, either way
                state.gap_min[:, k] = gaps.min(axis=1)
                misfits = gaps if pair.holds else np.minimum(gaps, reactions * np.diag(flexibility.C)[span])
            depth[:, k] = np.abs(misfits).max(axis=1) - state.slack[:, k]

    def _rescue(self, task: Task, state: State, raw_gap: Float[Array, "n pair"]) -> None:
        """Try realizations again from other starts (see RESCUES), and keep the better answers.

        raw_gap   the smallest raw gaps (n, pair) [mm]
        """
        for rescue in RESCUES:
            rows = self._rows(rescue.rows, task, state, raw_gap)
            if rows.size and self._has(rescue.surfaces):
                for start in rescue.starts:
                    rows = self._try_again(task, state, rows, start)

    def _has(self, surfaces: str) -> bool:
        """Return whether the group has the surfaces of a rescue. Partings take long to compute, and are only asked for here."""
        candidates = self._candidates
        if surfaces in ("curved", "flat"):
            return bool(candidates.curved) == (surfaces == "curved")
        return surfaces == "any" or (bool(candidates.partings) if surfaces == "convex" else candidates.are_guarded)

    def _rows(self, which: str, task: Task, state: State, raw_gap: Float[Array, "n pair"]) -> Int[Array, " k"]:
        """Return the realizations (k,) of a rescue (see Rescue)."""
        interfere = self._candidates.interfere
        if which == "apart":
            is_tested = self._candidates.are_guarded and not self._method.minimizes.presses
            rows = np.flatnonzero((raw_gap < -self._candidates.free_depth).any(axis=1) & is_tested)
            return rows[~interfere(task.relative[rows], task.deviations[rows])]
        if which == "interfere":
            rows = np.flatnonzero(state.doubtful)
            return rows[interfere(state.relative[rows], task.deviations[rows])]
        if which == "not separated":
            rows = np.flatnonzero(state.outcome >= Outcome.DOUBTFUL)
            return rows[~state.solved[rows] | interfere(state.relative[rows], task.deviations[rows])]
        if which == "slanted":
            return np.flatnonzero(state.certified & (self._candidates.slants(state) > MIN_SLANT))
        is_uncertain = state.outcome >= (Outcome.DOUBTFUL if which == "no answer" else Outcome.IN_CONFLICT)
        return np.flatnonzero(is_uncertain | (~self._limits.is_near(task, state) if which == "uncertain or far" else False))

    def _try_again(self, task: Task, state: State, rows: Int[Array, " n"], start: Start) -> Int[Array, " left"]:
        """Try some realizations (n,) again and keep the better answer. Return which need further starts (left,)."""
        if not rows.size:
            return rows
        part = task.take(rows)
        poses, relative = self._at_nominal(part) if start.at_nominal else (part.raw, part.relative)
        if start.at_answer:
            poses, relative = state.poses[rows], state.relative[rows]
        if start.free:
            poses, relative = self._free_steps.lift(poses, relative, part.deviations)
        part = replace(part, scans=self._candidates.scans(relative, part.deviations, Search(start)))
        attempt = self._step.start(poses, relative)
        self._attempt(part, attempt, start)
        accumulate_starts(state, rows, attempt)
        best = state.take(rows)
        better = is_better(attempt, self._energy_of(part, attempt), best, self._energy_of(part, best), start.gain)
        state.put(rows[better], attempt.take(better))
        depth, best_depth = attempt.slack.max(axis=1), best.slack.max(axis=1)
        is_same = np.abs(depth - best_depth) <= SAME_CONFLICT * np.maximum(depth, best_depth)
        is_same &= (attempt.outcome == Outcome.IN_CONFLICT) & (best.outcome == Outcome.IN_CONFLICT)
        return rows[~state.certified[rows] & ~is_same]

    def _energy_of(self, task: Task, state: State) -> Float[Array, " n"]:
        energy = self._energy(poses=state.poses, raw=task.raw, moments=task.moments, deviations=task.deviations)
        if self.flexibility is None:
            return energy
        bent = self.flexibility.bent(state.multipliers)
        return np.asarray(energy + (state.multipliers * bent).sum(axis=1) / 2 / self._force)

    def _at_nominal(self, task: Task) -> tuple[np.ndarray, np.ndarray]:
        """Return poses and X_RM with the free parts, and the parts located on them, in their nominal places."""
        poses = task.raw.copy()
        for k, mobility in enumerate(self._group.mobilities):
            if mobility.movers:
                lowest = self._group.position(self._group.free[mobility.movers[0]])
                poses[:, k] = pose.relative(task.raw[:, k], task.raw[:, lowest])
        return poses, self._relate(poses=poses, deviations=task.deviations)


def is_better(
    state: State, energy: Float[Array, " n"], best: State, best_energy: Float[Array, " n"], gain: float
) -> Bool[Array, " n"]:
    """Return whether answers are better than the best ones so far (n,).

    A less severe outcome is better, but a doubtful answer is as bad as none. Of two certified answers, the one with less energy
    (n,) is better, by a share `gain`; of two conflicts, the shallower.
    """
    depth, best_depth = state.slack.max(axis=1), best.slack.max(axis=1)
    is_lower = energy < best_energy - gain * np.abs(best_energy)
    outcome, best_outcome = (np.minimum(answer.outcome, Outcome.DOUBTFUL) for answer in (state, best))
    is_shallower = (outcome == Outcome.IN_CONFLICT) & (depth < best_depth - MIN_GAIN)
    gains = np.where(outcome == Outcome.RESOLVED, is_lower, is_shallower)
    return (outcome < best_outcome) | ((outcome == best_outcome) & gains)


def checked_residual(state: State, depth: Float[Array, " n"]) -> Float[Array, " n"]:
    """Return the residual (n,) [mm], including the errors that the solver does not report.

    depth   (n,) [mm]: penetration beyond the slack at the poses reached
    """
    residual = np.maximum(state.kkt_residual, depth)
    # Penetration does not excuse locators that do not hold.
    excused = np.where(state.astray > ACCURACY, state.slack.max(axis=1), 0)
    return np.maximum(residual, state.astray + excused)
