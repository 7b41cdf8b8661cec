"""One linear step: constraint generation around the compiled QP of a group.

The QP has a few slots for rows. All gaps are scanned, the deepest point of each cluster gets a slot, the QP is solved, and
realizations with another point still inside are solved again and keep their active points. Each round raises the optimum of
a strictly convex problem, so the rounds end with the solution of the QP that has every row.
"""

import copy
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Float
from tolcontact.compilation import ContactGroup, Program
from tolcontact.contact.scan import PENETRATION, Deepest, Scan
from tolcontact.contact.slots import NEGLIGIBLE_SHARE, Slots
from tolcontact.contact.state import State, Task
from tolcontact.mechanics import ENTRIES

MAX_ROUNDS = 60
MAX_RESIDUAL = 1e-3  # of the group's length: a larger KKT residual [mm] is no answer


class Step(NamedTuple):
    """How large a step was, (n,) [mm]: its largest increment, and the same in the norm of the objective."""

    size: Float[Array, " n"]
    scaled: Float[Array, " n"]


class LinearStep:
    """The QP of one group, ready to be solved for many realizations, in at most `max_rounds` rounds."""

    def __init__(self, program: Program, group: ContactGroup, max_rounds: int = MAX_ROUNDS) -> None:
        self._max_rounds = max_rounds
        self._solve = group.solve
        self._remembers = program.solver.remembers
        self._max_residual = MAX_RESIDUAL * group.group.length
        self.spans = group.qp.spans
        # Reactions of contact push; two-sided locators at elastic parts pull, too.
        flexibility = group.qp.flexibility
        self.bends = flexibility is not None
        self._least_reaction: float | np.ndarray = 0.0 if flexibility is None else np.where(flexibility.holds, -np.inf, 0.0)
        self._slots = {k: points for k, points in enumerate(group.qp.standing) if isinstance(points, int)}
        self.varying = list(self._slots)
        # The curvature of walls around round faces counts in every step, not in Newton's alone.
        self.knows_walls = not all(program.nominal.pairs[pair].samples_faces for pair in group.group.pairs)

    def twin(self) -> "LinearStep":
        """Return the same step for another thread."""
        twin = copy.copy(self)
        twin._solve = self._solve.twin()
        return twin

    def start_over(self) -> None:
        """Forget all problems solved before, if the solver starts from the last one."""
        if self._remembers:
            self._solve.start_over()

    def start(self, poses: Float[Array, "n part 12"], relative: Float[Array, "n pair 12"]) -> State:
        """Return the state at poses (n, part, 12), with X_RM (n, pair, 12), before the first step."""
        return State.start(poses, relative, self.spans[-1].stop, list(self._slots.values()))

    def take(
        self,
        task: Task,
        state: State,
        *,
        stride: float,
        caution: Float[Array, " n"] | float = 0.0,
        firmness: float = 1.0,
        newton: bool = False,
    ) -> Step:
        """Take one linear step, the solution of the QP with a row for every point; write it into `state`.

        stride     the largest rotation of a part [rad] in the step
        caution    (n,): makes steps smaller, but does not change where they end
        firmness   multiplies the regularization
        newton     whether the curvature of objective and gaps counts
        """
        start_slots = [
            slots.only(task.scans[k].holds(slots.points)) for k, slots in zip(self.varying, state.slots, strict=True)
        ]
        inputs = self._inputs(task, state, start_slots, newton)
        weights = {"proximal_weight": caution, "regularization_factor": firmness}
        for name, value in {"stride": stride, "newton": float(newton), **weights}.items():
            inputs[name] = np.broadcast_to(value, len(task))
        size = np.zeros((2, len(task)))
        rows, part, part_inputs = np.arange(len(task)), (task, state), inputs
        slots, deepest = start_slots, self._deepest(task, state.relative)
        for number in range(self._max_rounds):
            extended = [
                old.with_deepest(*points, PENETRATION, fills=task.scans[k].fills)
                for k, old, points in zip(self.varying, slots, deepest, strict=True)
            ]
            slots = [new for new, _ in extended]
            enters = np.logical_or.reduce([np.full(len(rows), number == 0), *(grows for _, grows in extended)])
            if not enters.any():
                break
            if not enters.all():
                rows, slots = rows[enters], [new.take(enters) for new in slots]
                part = (task.take(rows), state.take(rows))
                part_inputs = {name: values[rows] for name, values in inputs.items()}
            if newton:  # the points in the slots have the reactions from the start of the step
                part_inputs["reactions"] = part_inputs["reactions"].copy()
                for k, old, new in zip(self.varying, start_slots, slots, strict=True):
                    part_inputs["reactions"][:, self.spans[k]] = old.take(rows).reactions_of(new.points)
            deepest, size[:, rows] = self._solve_round(*part, part_inputs, slots)
            slots = part[1].slots
            if part[1] is not state:
                state.put(rows, part[1])
        state.iterations[:] += 1
        return Step(*size)

    def _inputs(self, task: Task, state: State, slots: Sequence[Slots], newton: bool) -> dict[str, np.ndarray]:
        """Return the inputs that the QPs of all rounds share: the poses and reactions before the step, and its slots."""
        inputs = {name: getattr(task, name) for name in ("raw", "moments", "deviations")}
        inputs |= {"poses": state.poses.copy(), "reactions": state.multipliers.copy()}
        bends = [np.zeros((len(task), 0)), *(np.zeros((len(task), ENTRIES)) for _ in slots)]
        if newton:
            inputs["reactions"] = _cleared(inputs["reactions"], self.spans)
            bends[1:] = [_bend(task.scans[k], old, task.deviations) for k, old in zip(self.varying, slots, strict=True)]
        return inputs | {"bend": np.concatenate(bends, axis=1)}

    def _solve_round(
        self, task: Task, state: State, inputs: Mapping[str, np.ndarray], slots: Sequence[Slots]
    ) -> tuple[list[Deepest], np.ndarray]:
        """Solve the QPs with some points in their slots, and write the answers into `state`.

        Returns the deepest points of the varying pairs, with their depth beyond the slack; and step sizes (2, n).
        """
        count = len(task)
        points = [task.scans[k].rows(of_pair.points, task.deviations) for k, of_pair in zip(self.varying, slots, strict=True)]
        P_m, P_r, n_r = (
            np.concatenate([np.zeros((count, 0, 3)), *vectors], axis=1)
            for vectors in ([row[i] for row in points] for i in range(3))
        )
        filled = np.concatenate([np.zeros((count, 0)), *(slot.filled for slot in slots)], axis=1)
        guess = state.multipliers.copy()
        for k, of_pair in zip(self.varying, slots, strict=True):
            guess[:, self.spans[k]] = of_pair.reactions * of_pair.filled
        answer = self._solve(**inputs, P_m=P_m, P_r=P_r, n_r=n_r, filled=filled, guess=guess, guessed_slack=state.slack)
        slack, residual = np.maximum(answer["slack"], 0), answer["residual"][:, 0]
        solved = residual <= self._max_residual  # a problem that no solver could solve moves nothing
        deepest = self._deepest(task, answer["linearized"].reshape(state.relative.shape))
        # With conflicting rows, active points stay inside by the slack; only the excess is left undone.
        deepest = [Deepest(points, depth - slack[:, [k]]) for k, (points, depth) in zip(self.varying, deepest, strict=True)]
        for _, depth in deepest:
            residual = np.maximum(residual, depth.max(axis=1))
        state.kkt_residual[:] = np.where(solved, residual, np.inf)
        state.second_answers[:] += answer["second"][:, 0].astype(int)
        multipliers = np.maximum(answer["multipliers"], self._least_reaction)
        results = {
            "poses": answer["corrected"].reshape(state.poses.shape),
            "relative": answer["relative"].reshape(state.relative.shape),
            "slack": slack,
            "astray": answer["locator_residual"][:, 0],
            "multipliers": multipliers,
        }
        for name, values in results.items():
            getattr(state, name)[solved] = values[solved]
        state.slots[:] = [slot.carrying(multipliers[:, self.spans[k]]) for k, slot in zip(self.varying, slots, strict=True)]
        deepest = [Deepest(points, np.where(solved[:, None], depth, -np.inf)) for points, depth in deepest]
        return deepest, np.where(solved, answer["step"].T, 0.0)

    def _deepest(self, task: Task, relative: np.ndarray) -> list[Deepest]:
        """Return the deepest points of the varying pairs that may be active, at X_RM (n, pair, 12)."""
        return [task.scans[k].deepest(relative[:, k], task.deviations, task.may_carry[k]) for k in self.varying]


def _cleared(multipliers: np.ndarray, spans: Sequence[slice]) -> np.ndarray:
    """Return multipliers (n, row of the QP), zero if they are negligible compared with the largest of their pair."""
    sizes = ((multipliers[:, span], np.abs(multipliers[:, span])) for span in spans)
    return np.concatenate([np.where(a > NEGLIGIBLE_SHARE * a.max(axis=1, keepdims=True), m, 0.0) for m, a in sizes], axis=1)


def _bend(scan: Scan, slots: Slots, deviations: np.ndarray) -> np.ndarray:
    """Return the sum of reaction times the gap's gradient by the entries of X_RM, (n, 12)."""
    P_m, _, n_r = scan.rows(slots.points, deviations)
    weighted = (slots.reactions * scan.moves(slots.points))[..., None] * n_r
    turning = (weighted[..., :, None] * P_m[..., None, :]).sum(axis=1)
    return np.concatenate([turning.reshape(len(turning), 9), weighted.sum(axis=1)], axis=1)
