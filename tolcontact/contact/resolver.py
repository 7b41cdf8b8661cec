"""Resolve contact: from the raw poses of a group of parts to those in which nothing penetrates, and how sure that is.

The linearized resolution takes one linear step. The exact one repeats them (see repeated_steps), with an iterated search
about contact points that are projected again (see iterated_search). Where that ends in a conflict, without an answer, or far
from the raw pose, it is tried again from other starts.
"""

import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float
from tolcontact.compilation import ACCURACY, ContactGroup, Program
from tolcontact.contact.acceptance import Doubt
from tolcontact.contact.candidates import Candidates
from tolcontact.contact.iterated_search import search
from tolcontact.contact.linear_step import PENETRATION, LinearStep
from tolcontact.contact.repeated_steps import repeat
from tolcontact.contact.scan import least_gaps, undone
from tolcontact.contact.state import Resolved, State, Task

STRIDE, CAREFUL = 0.5, 0.05  # rad: what a step may turn a part by; linear rows are wrong long before
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


FLAT = (Start(at_nominal=True), Start(stride=CAREFUL))  # how it is tried again, if no face is curved, and
ROUND = (Start(anew=True), Start(anew=True, at_nominal=True))  # if one is


class ContactResolver:
    """One group of coupled parts, ready to be resolved for blocks of realizations."""

    def __init__(self, program: Program, group: ContactGroup) -> None:
        self.parts = np.array(group.group.parts)
        self.pairs = np.array(group.group.pairs)
        self._group = group.group
        self._energy, self._relate = group.solve.energy, group.solve.relative
        self._step = LinearStep(program, group)
        self._method = program.method
        self._candidates = Candidates(program, group)
        size = max(float(program.nominal.parts[part].mesh.scale) for part in group.group.parts)
        self._doubt = Doubt(program.nominal, group.group, self._method, size)

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

    def resolve(
        self,
        poses: Float[Array, "realization part 12"],
        relative: Float[Array, "realization pair 12"],
        deviations: Float[Array, "realization contributor"],
    ) -> Resolved:
        """Correct the realizations of a block that this group does not leave as they are.

        poses (realization, part, 12), raw; relative (realization, pair, 12), X_RM of the pairs, raw; deviations
        (realization, contributor). Forces move every realization, else contact those in which a point is inside.
        """
        relative = relative[:, self.pairs]
        seen = self._candidates.survey(relative, deviations)
        moves = (seen.least < -PENETRATION).any(axis=1) | self._method.minimizes.presses
        touched = np.flatnonzero(moves)
        scans = [scan.take(touched) for scan in seen.scans]
        task = Task(
            raw=poses[touched][:, self.parts],
            relative=relative[touched],
            deviations=deviations[touched],
            moments=seen.moments[touched],
            may_carry=self._candidates.may_carry(scans, relative[touched], deviations[touched]),
            scans=scans,
        )
        state = self._step.start(task.raw, task.relative)
        self._attempt(task, state, Start())
        starts = np.ones(len(task), dtype=int)
        if self._method.is_exact:
            self._start_elsewhere(task, state, starts)
        gap_min = np.stack([seen.least, seen.least], axis=1)
        gap_min[touched, 1] = state.gap_min
        return Resolved(touched, state, starts, gap_min, seen.active)

    def _attempt(self, task: Task, state: State, start: Start) -> None:
        """Go from where `state` is to an answer, and say what it is worth."""
        anew = start.anew or self._method.is_iterated
        if anew:
            caution = 1.0 if self._method.minimizes.presses else 0.0  # forces pull far if nothing holds
            search(self._step, self._doubt, self._candidates, self._energy_of, task, state, start.stride, caution)
        elif self._method.is_exact:
            repeat(self._step, self._doubt, task, state, start.stride)
        else:
            self._step.take(task, state, stride=start.stride)
        state.searched[:] = anew
        self._leave_adrift(task, state)
        task = replace(task, scans=self._candidates.scans(state.relative, anew=anew))
        state.gap_min[:] = least_gaps(task.scans, state.relative, task.deviations)
        if self._method.is_exact:
            self._recheck(task, state)
        state.doubtful[:] = self._doubt.remains(task, state, self._candidates)
        if not anew:
            self._look_round(task, state)

    def _leave_adrift(self, task: Task, state: State) -> None:
        """Leave what nothing holds against its forces where it was."""
        adrift = self._doubt.is_adrift(task, state)
        state.residual[adrift], state.slack[adrift], state.multipliers[adrift] = np.inf, 0, 0
        state.poses[adrift], state.relative[adrift] = task.raw[adrift], task.relative[adrift]

    def _look_round(self, task: Task, state: State) -> None:
        """Doubt answers in which contact points have slid into a curved face, along planes that are not its own there."""
        for k in self._candidates.curved:
            rolled = np.flatnonzero(self._doubt.rolled(k, state))
            if rolled.size:
                relative = state.relative[rolled, k]
                inside = -self._candidates.projected(k, relative).least(relative, task.deviations[rolled])
                state.doubtful[rolled] |= inside > self._doubt.allowed(k)

    def _recheck(self, task: Task, state: State) -> None:
        """The solver's word is not enough: what is inside at the poses reached, beyond the slack, counts."""
        inside = undone(task.scans, state.gap_min, state.relative, task.deviations, task.may_carry, state.slack)
        state.residual[:] = np.maximum(state.residual, inside.max(axis=1))
        # Nor does penetration excuse locators that do not hold.
        excused = np.where(state.astray > ACCURACY, state.slack.max(axis=1), 0)
        state.residual[:] = np.maximum(state.residual, state.astray + excused)

    def _start_elsewhere(self, task: Task, state: State, starts: np.ndarray) -> None:
        """Try again what is not certified, or far, from other starts. Keep what is better."""
        left = np.flatnonzero((state.rank > 0) | ~self._doubt.is_near(task, state))
        for start in ROUND if self._candidates.curved else FLAT:
            if not left.size:
                return
            part = task.take(left)
            poses, relative = self._at_nominal(part) if start.at_nominal else (part.raw, part.relative)
            part = replace(part, scans=self._candidates.scans(relative, anew=start.anew))
            other = self._step.start(poses, relative)
            self._attempt(part, other, start)
            starts[left] += 1
            for all_told, more in ((state.iterations, other.iterations), (state.second_answers, other.second_answers)):
                all_told[left] += more
                more[:] = all_told[left]
            better = self._is_better(part, other, state.take(left))
            state.put(left[better], other.take(better))
            left = left[state.rank[left] > 0]

    def _is_better(self, task: Task, state: State, than: State) -> Bool[Array, " n"]:
        """(n,): whether an answer has a lower rank than another one, or the same and a better objective."""
        energy, before = (self._energy_of(task, each) for each in (state, than))
        inside, before_inside = (each.slack.max(axis=1) for each in (state, than))
        lower = energy < before - BETTER * np.abs(before)
        gains = np.where(state.rank == 0, lower, (state.rank == 1) & (inside < before_inside - BETTER))
        return np.asarray((state.rank < than.rank) | ((state.rank == than.rank) & gains))

    def _energy_of(self, task: Task, state: State) -> Float[Array, " n"]:
        return self._energy(poses=state.poses, raw=task.raw, moments=task.moments, deviations=task.deviations)

    def _at_nominal(self, task: Task) -> tuple[np.ndarray, np.ndarray]:
        """Poses and X_RM with the free parts in their nominal places, and on them what stands on them."""
        poses = task.raw.copy()
        for k, carried in enumerate(self._group.carried):
            if carried.movers:
                lowest = self._group.position(self._group.free[carried.movers[0]])
                poses[:, k] = pose.relative(task.raw[:, k], task.raw[:, lowest])
        relative = self._relate(poses=poses, deviations=task.deviations)
        return poses, relative.reshape(len(task), len(self.pairs), -1)
