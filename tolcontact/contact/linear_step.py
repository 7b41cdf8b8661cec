"""One linear step: constraint generation around the compiled QP of a group.

The QP has a few slots for rows. All gaps are scanned, the deepest point of each cluster gets a slot, the QP is solved, and
realizations in which another point is still inside enter again with their carrying points kept. Each round raises the
optimum of a strictly convex problem, so the rounds end, with the solution of the QP that has every row.
"""

import copy
from collections.abc import Sequence

import numpy as np

from tolcontact.compilation import ContactGroup, Program
from tolcontact.contact.scan import PairScan
from tolcontact.contact.slots import CARRIES, Slots
from tolcontact.contact.state import State, Task
from tolcontact.mechanics import ENTRIES

ROUNDS = 60
PENETRATION = 1e-10  # mm: less than this is no penetration
USABLE = 1e-3  # of the group's length: a larger KKT residual [mm] is no answer


class LinearStep:
    """The QP of one group, ready to be solved for many realizations."""

    def __init__(self, program: Program, group: ContactGroup) -> None:
        self._solve = group.solve
        self._parts = len(group.group.parts)
        self._remembers = program.plugin.remembers
        self._usable = USABLE * group.group.length
        self.spans = group.program.spans
        self.varying = [k for k, points in enumerate(group.program.standing) if points is None]

    def twin(self) -> "LinearStep":
        """The same for another thread."""
        other = copy.copy(self)
        other._solve = self._solve.twin()
        return other

    def start_over(self) -> None:
        """Forget all problems solved before, where the solver starts from the last one."""
        if self._remembers:
            self._solve.start_over()

    def take(
        self,
        task: Task,
        state: State,
        scans: Sequence[PairScan],
        moving: np.ndarray,
        *,
        stride: float,
        caution: np.ndarray | float = 0.0,
        firmness: float = 1.0,
        newton: bool = False,
    ) -> np.ndarray:
        """One linear step of the rows `moving`: the QP in which every point has its row.

        `newton` counts the curvature of objective and gaps, `firmness` multiplies the regularization, of the step no more is
        taken than turns a part by `stride` [rad], and `caution` (row,) makes steps smaller, but not their end. Returns the
        step's size (2, row) [mm]: that of the largest increment, and in the norm of the objective.
        """
        now = state.poses[moving]
        scans = [scans[k] for k in self.varying]
        seen = self._deepest(task, scans, moving, state.relative[moving])
        before = [slots.take(moving) for slots in state.slots]
        reactions = state.multipliers[moving]
        bend = np.zeros((len(moving), ENTRIES * len(scans)))
        if newton:
            reactions = _carried(reactions, self.spans)
            for k, (scan, s) in enumerate(zip(scans, before, strict=True)):
                bend[:, ENTRIES * k : ENTRIES * (k + 1)] = _bend(scan, s, task.deviations[moving])
        slots = list(before)
        step = np.zeros((2, len(moving)))
        open_ = np.arange(len(moving))
        for number in range(ROUNDS):
            more = np.full(len(open_), number == 0)
            for k, (points, depth) in enumerate(seen):
                slots[k], grown = slots[k].with_deepest(points, depth, PENETRATION)
                more |= grown
            open_ = open_[more]
            slots, scans = [s.take(more) for s in slots], [scan.take(more) for scan in scans]
            if not open_.size:
                break
            curved = {
                "firmness": np.full(len(open_), firmness),
                "newton": np.full(len(open_), float(newton)),
                "stride": np.full(len(open_), stride),
                "caution": np.broadcast_to(caution, len(moving))[open_],
                "reactions": reactions[open_],
                "bend": bend[open_],
            }
            if newton:
                for k, b, s in zip(self.varying, before, slots, strict=True):
                    curved["reactions"][:, self.spans[k]] = b.take(open_).reactions_of(s.points)
            seen, slots, step[:, open_] = self._solve_round(task, state, scans, moving[open_], now[open_], slots, curved)
        state.iterations[moving] += 1
        return step

    def _solve_round(
        self,
        task: Task,
        state: State,
        scans: Sequence[PairScan],
        rows: np.ndarray,
        now: np.ndarray,
        slots: list[Slots],
        curved: dict[str, np.ndarray],
    ) -> tuple[list[tuple[np.ndarray, np.ndarray]], list[Slots], np.ndarray]:
        """Solve the QPs of `rows` about the poses `now`, note the answers.

        Returns, of varying pairs, the deepest points and by how much they are deeper than the slack, and slots; and step sizes.
        """
        deviations = task.deviations[rows]
        held = [scan.rows(s.points, deviations) for scan, s in zip(scans, slots, strict=True)]
        nothing = np.zeros((len(rows), 0, 3))
        P_m, P_r, n_r = (np.concatenate([nothing, *(each[i] for each in held)], axis=1) for i in range(3))
        answer = self._solve(
            poses=now,
            raw=task.raw[rows],
            moments=task.moments[rows],
            deviations=deviations,
            **curved,
            P_m=P_m,
            P_r=P_r,
            n_r=n_r,
            filled=np.concatenate([np.zeros((len(rows), 0)), *(s.filled for s in slots)], axis=1),
        )
        relative = state.relative.shape[1:]
        slack = np.maximum(answer["slack"], 0)
        residual = answer["residual"][:, 0]
        solved = residual <= self._usable  # what no solver could solve moves nothing
        seen = self._deepest(task, scans, rows, answer["linearized"].reshape(len(rows), *relative))
        # With the rows in conflict the points that carry stay inside by the slack; only what exceeds it is left undone.
        seen = [(points, depth - slack[:, k, None]) for k, (points, depth) in zip(self.varying, seen, strict=True)]
        for _, deeper in seen:
            residual = np.maximum(residual, deeper.max(axis=1))
        state.poses[rows[solved]] = answer["corrected"].reshape(len(rows), self._parts, ENTRIES)[solved]
        state.relative[rows[solved]] = answer["relative"].reshape(len(rows), *relative)[solved]
        state.residual[rows] = np.where(solved, residual, np.inf)
        state.slack[rows[solved]] = slack[solved]
        state.astray[rows[solved]] = answer["astray"][solved, 0]
        state.second_answers[rows] += answer["second"][:, 0].astype(int)
        multipliers = np.maximum(answer["multipliers"], 0)
        state.multipliers[rows[solved]] = multipliers[solved]
        slots = [s.carrying(multipliers[:, self.spans[k]]) for k, s in zip(self.varying, slots, strict=True)]
        for kept, s in zip(state.slots, slots, strict=True):
            kept.put(rows, s)
        seen = [(points, np.where(solved[:, None], deeper, -np.inf)) for points, deeper in seen]
        return seen, slots, np.where(solved, answer["step"].T, 0.0)

    def _deepest(
        self, task: Task, scans: Sequence[PairScan], rows: np.ndarray, relative: np.ndarray
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Of varying pairs the deepest points that may carry, (row, cluster), and their depth [mm], at X_RM (row, pair, 12)."""
        found = []
        for k, scan in zip(self.varying, scans, strict=True):
            may_carry = task.may_carry[k]
            found.append(scan.deepest(relative[:, k], task.deviations[rows], None if may_carry is None else may_carry[rows]))
        return found


def _carried(multipliers: np.ndarray, spans: Sequence[slice]) -> np.ndarray:
    """Multipliers (row, row of the QP), zero where they are nothing beside the largest of their pair."""
    of_pairs = (multipliers[:, span] for span in spans)
    return np.concatenate([np.where(m > CARRIES * m.max(axis=1, keepdims=True), m, 0.0) for m in of_pairs], axis=1)


def _bend(scan: PairScan, slots: Slots, deviations: np.ndarray) -> np.ndarray:
    """The reactions' sum of the gaps' gradients by the entries of X_RM, (row, 12)."""
    P_m, _, n_r = scan.rows(slots.points, deviations)
    weighted = slots.reactions[..., None] * n_r
    turning = (weighted[..., :, None] * P_m[..., None, :]).sum(axis=1)
    return np.concatenate([turning.reshape(len(turning), 9), weighted.sum(axis=1)], axis=1)
