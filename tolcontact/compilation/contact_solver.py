"""The contact QP of one group for many realizations: assemble, predict the active set, solve, polish, evaluate."""

import copy

import numpy as np

from tolcontact.arrays import Array, Bool, Float
from tolcontact.compilation.active_set import Problem, active_set, band_order, solve_active
from tolcontact.compilation.contact_qp import ContactQP
from tolcontact.compilation.functions import flat
from tolcontact.compilation.solver import ACCURACY, Solver, SolverChoice
from tolcontact.compilation.solvers import SOLVERS
from tolcontact.mechanics.pose import ENTRIES

MAX_DENSE_ENTRIES = 4_000_000  # of the linear systems that are solved together
POLISHED_RESIDUAL = 1e-1 * ACCURACY  # mm: an answer with a larger KKT residual is rough
SMALL_STEP, SMALL_STEP_RESIDUAL = 1e-3, 1e-2 * ACCURACY  # mm: limits for small steps, where noise matters
CONFLICT_SHARE = 1e-3  # of the slack that remains if rows contradict each other: a smaller residual needs no other solver

Arrays = dict[str, Float[Array, "_ _"]]  # by name, (realization, entry)


class ContactSolver:
    """The chosen solver of the QPs of a ContactQP, with its fallbacks. Threads must not share it."""

    def __init__(self, qp: ContactQP, choice: SolverChoice) -> None:
        self._qp, self._choice = qp, choice
        self._assemble, self._finish, self._energy, self._relate = qp.evaluators
        self._kernel = None if qp.flexibility is None else SOLVERS["graph"].solver(qp)
        h, a = (qp.assemble.sparsity_out(name) for name in ("h", "a"))
        self._order = band_order(h, a, slacks=qp.slacks) if qp.flexibility is None else np.zeros(0, dtype=int)
        self._equalities = np.arange(a.size1() - qp.equations, a.size1())
        self._max_dense = max(MAX_DENSE_ENTRIES // (sum(a.shape) + qp.slacks) ** 2, 1)
        self._start_with(choice.solver(qp))

    def twin(self) -> "ContactSolver":
        """Return an equal solver for another thread."""
        twin = copy.copy(self)
        twin._start_with(self._solver.twin())
        return twin

    def start_over(self) -> None:
        """Forget all previous problems: some solvers start from the previous one."""
        if not self._is_new:
            self._start_with(self._solver.twin())

    def _start_with(self, solver: Solver) -> None:
        """Take a new solver, which has solved no problem yet."""
        self._solver = solver
        self._fallbacks: dict[str, Solver] = {}
        self._is_new = True

    def __call__(self, **arrays: Float[Array, "realization ..."]) -> Arrays:
        """Return the outputs of contact_qp by name, (realization, entry), for its inputs by name, (realization, ...).

        Further inputs are `guess` (realization, row) and `guessed_slack` (realization, pair): probable reactions and slacks,
        which a solver may start from. A further output is `second` (realization, 1): whether another solver answered.
        Problems that this solver fails to solve are solved without curvature, since with it they may have no minimum: by this
        solver, and then by others. If all fail, `residual` is infinite, and other outputs may be NaN.
        """
        inputs = {name: flat(values) for name, values in arrays.items()}
        self._is_new = False
        answer = self._solved(self._solver, inputs)
        self._retry(self._solver, answer, inputs, _is_lost(answer) & (inputs["newton"][:, 0] != 0), second=0.0)
        for name in self._choice.substitutes(elastic=self._kernel is not None):
            lost = _is_lost(answer)
            if not lost.any():
                break
            if SOLVERS[name].remembers:  # then each problem gets a solver of its own, so that it does not depend on others
                for row in np.flatnonzero(lost):
                    self._retry(SOLVERS[name].solver(self._qp), answer, inputs, np.arange(len(lost)) == row, second=1.0)
                continue
            if name not in self._fallbacks:
                self._fallbacks[name] = SOLVERS[name].solver(self._qp)
            self._retry(self._fallbacks[name], answer, inputs, lost, second=1.0)
        return answer

    def _retry(
        self, solver: Solver, answer: Arrays, inputs: Arrays, lost: Bool[Array, " realization"], *, second: float
    ) -> None:
        """Solve the `lost` problems without curvature, and write better answers into `answer`."""
        rows = np.flatnonzero(lost)
        if not rows.size:
            return
        retry = self._solved(solver, _of(inputs, rows) | {"newton": np.zeros((len(rows), 1))})
        retry["second"] = np.maximum(retry["second"], second)
        better = retry["residual"][:, 0] < answer["residual"][rows, 0]
        _replace(answer, rows[better], _of(retry, better))

    def energy(self, **arrays: Float[Array, "realization ..."]) -> Float[Array, " realization"]:
        """Return the objective (realization,) at poses, for raw poses, moments and deviations (see ContactQP)."""
        return self._energy(**arrays)["energy"][:, 0]

    def relative(self, **arrays: Float[Array, "realization ..."]) -> Float[Array, "realization pair 12"]:
        """Return X_RM (realization, pair, 12) of the group's pairs at poses, for deviations."""
        relative = self._relate(**arrays)["relative"]
        return relative.reshape(len(relative), -1, ENTRIES)

    def _solved(self, solver: Solver, inputs: Arrays) -> Arrays:
        count = len(inputs["poses"])
        size = self._qp.max_batch
        parts = [self._solved_batch(solver, _of(inputs, slice(k, k + size))) for k in range(0, max(count, 1), size)]
        return parts[0] if len(parts) == 1 else {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}

    def _solved_batch(self, solver: Solver, inputs: Arrays) -> Arrays:
        if self._qp.flexibility is not None:
            inputs = inputs | {"bent": self._qp.flexibility.bent(inputs["reactions"] * inputs["newton"])}
        problem = self._assemble(**inputs)
        slacks = np.ones((len(inputs["guess"]), self._qp.slacks))  # an active compliant row has a positive slack
        slacks[:, : inputs["guessed_slack"].shape[1]] = inputs["guessed_slack"]
        if not solver.remembers:
            return self._polished(inputs, problem, *solver(problem, inputs["guess"], slacks))
        outputs, predicted = self._predicted(inputs, problem, slacks)
        if predicted.all():
            return outputs
        remaining = np.flatnonzero(~predicted)
        inputs, problem = _of(inputs, remaining), _of(problem, remaining)
        answer = self._polished(inputs, problem, *solver(problem, inputs["guess"], slacks[remaining]))
        if not predicted.any():
            return answer
        _replace(outputs, remaining, answer)
        return outputs

    def _predicted(self, inputs: Arrays, problem: Arrays, slacks: np.ndarray) -> tuple[Arrays, Bool[Array, " realization"]]:
        """Return the outputs for the predicted active set, and which problems it is optimal for.

        The guess predicts the active set, since small steps seldom change it. Outputs of other problems are arbitrary.
        The active set of elastic parts is not predicted, but found by the solver in the reactions.
        """
        if self._kernel is not None:
            solution, failed = self._kernel(problem, inputs["guess"], slacks)
            outputs = self._finished(inputs | problem | solution)
            outputs["second"][:] = 1
            return outputs, ~failed & ~(_is_rough(outputs) & ~(outputs["slack"] > ACCURACY).any(axis=1))
        active = np.zeros((len(slacks), self._qp.sparsity("a").size1()), dtype=np.bool_)
        active[:, : inputs["guess"].shape[1]] = inputs["guess"] > 0
        active[:, self._equalities] = True
        outputs = {}
        predicted = np.zeros(len(slacks), dtype=np.bool_)
        for rows in self._parts(np.flatnonzero(inputs["guess"].any(axis=1))):
            systems = self._dense_problem(_of(problem, rows))
            solution = solve_active(systems, active[rows], slacks[rows] > 0, self._order)
            answer = self._finished(_of(inputs, rows) | _of(problem, rows) | solution)
            outputs = outputs or {name: np.empty((len(slacks), values.shape[1])) for name, values in answer.items()}
            _replace(outputs, rows, answer)
            predicted[rows] = ~_is_rough(answer)
        return outputs, predicted

    def _polished(self, inputs: Arrays, problem: Arrays, solution: Arrays, failed: Bool[Array, " realization"]) -> Arrays:
        """Return the outputs for a solver's solutions. Rough ones are polished, and all of elastic parts."""
        outputs = self._finished(inputs | problem | solution)
        outputs["residual"][failed] = np.inf
        if "opened" in solution:  # of the kernel itself
            return outputs
        is_rough = _is_rough(outputs) | (self._kernel is not None)
        for rows in self._parts(np.flatnonzero(is_rough & np.isfinite(outputs["residual"][:, 0]))):
            part, rough = _of(problem, rows), _of(solution, rows)
            if self._kernel is not None:  # it exchanges wrong rows
                pushes = -rough["lam_a"][:, : part["length"].shape[1]]
                polished = self._kernel(part, pushes, np.zeros_like(pushes))[0]
            else:
                systems = self._dense_problem(part)
                active = active_set(systems, rough, self._equalities, self._qp.slacks)
                polished = solve_active(systems, *active, self._order)
            answer = self._finished(_of(inputs, rows) | part | polished)
            better = answer["residual"][:, 0] < outputs["residual"][rows, 0]
            _replace(outputs, rows[better], _of(answer, better))
        return outputs

    def _finished(self, arrays: Arrays) -> Arrays:
        """Return the outputs of `finish`; elastic parts bend by the reactions, and rows in conflict are `opened`."""
        flexibility, size = self._qp.flexibility, self._qp.assemble.size1_out("h")
        if flexibility is not None:
            length = arrays["length"]
            reactions = -arrays["lam_a"][:, : length.shape[1]] / length * self._qp.scale
            bent = flexibility.bent(reactions) + arrays.get("opened", 0)
            arrays = arrays | {"bent": bent, "x": arrays["x"][:, :size], "lam_x": arrays["lam_x"][:, :size]}
        outputs = self._finish(**arrays)
        if "opened" in arrays:
            outputs["slack"] += np.maximum.reduceat(np.abs(arrays["opened"]), [span.start for span in self._qp.spans], axis=1)
        usable = np.isfinite(outputs["corrected"]).all(axis=1)
        residual = outputs["residual"]
        outputs["second"] = np.zeros_like(residual)
        residual[~(usable & np.isfinite(residual[:, 0]))] = np.inf
        return outputs

    def _parts(self, rows: np.ndarray) -> list[np.ndarray]:
        """Return the rows in parts, so that the dense matrices of a part take little memory."""
        return np.split(rows, range(self._max_dense, len(rows), self._max_dense)) if rows.size else []

    def _dense_problem(self, problem: Arrays) -> Problem:
        """Return all entries of h, g, a and lba: (realization, row, column), or (realization, row) of a vector."""
        dense = {}
        for name in ("h", "g", "a", "lba"):
            stored, sparsity = problem[name], self._qp.sparsity(name)
            columns = np.zeros((len(stored), sparsity.numel()))
            columns[:, sparsity.find()] = stored
            shape = len(stored), sparsity.size2(), sparsity.size1()
            dense[name] = columns if sparsity.size2() == 1 else columns.reshape(shape).swapaxes(1, 2)
        return dense


def _is_rough(answer: Arrays) -> Bool[Array, " realization"]:
    """Return which answers need polishing."""
    small = answer["step"][:, 0] < SMALL_STEP
    return ~(answer["residual"][:, 0] <= np.where(small, SMALL_STEP_RESIDUAL, POLISHED_RESIDUAL))


def _is_lost(answer: Arrays) -> Bool[Array, " realization"]:
    """Return which answers miss ACCURACY. Rows in conflict have such large multipliers that rounding alone may exceed it."""
    slack = answer["slack"].max(axis=1, initial=0)
    return ~(answer["residual"][:, 0] <= np.maximum(ACCURACY, CONFLICT_SHARE * slack))


def _of(arrays: Arrays, rows: np.ndarray | slice) -> Arrays:
    """Return the given rows of all arrays."""
    return {name: values[rows] for name, values in arrays.items()}


def _replace(arrays: Arrays, rows: np.ndarray, replacements: Arrays) -> None:
    """Overwrite the given rows of all arrays."""
    for name, values in replacements.items():
        arrays[name][rows] = values
