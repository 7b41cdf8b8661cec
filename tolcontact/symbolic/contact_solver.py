"""The contact QP of one group, solved for many realizations: assemble, solve, finish."""

import copy

import numpy as np

from tolcontact.symbolic.batch import Expressions, Mapped, flat, quiet
from tolcontact.symbolic.contact_program import INPUTS, OUTPUTS, ContactProgram

ASSEMBLED = {"h": 0, "g": 1, "a": 2, "lba": 3, "uba": 4}  # which output of `assemble` is which input of the solver
TOGETHER = 1024  # realizations whose QPs fit into a processor's cache


class ContactSolver:
    """Solves the QPs of a ContactProgram. Not to be shared between threads."""

    def __init__(self, program: ContactProgram) -> None:
        self._program = program
        self._assemble, self._finish = Expressions(program.assemble), Expressions(program.finish)
        self.start_over()

    def twin(self) -> "ContactSolver":
        """The same for another thread."""
        other = copy.copy(self)
        other.start_over()
        return other

    def start_over(self) -> None:
        """Forget all problems solved before: some plugins start from the last one."""
        self._first: _PluginSolver = _PluginSolver(self._program)
        self._second: _PluginSolver | None = None

    def __call__(self, **arrays: np.ndarray) -> dict[str, np.ndarray]:
        """The outputs of contact_program by name, (realization, entry), for its inputs by name, (realization, ...).

        They are NaN where the solver gave up.
        """
        return self._solved(self._first, arrays)

    def again(self, **arrays: np.ndarray) -> dict[str, np.ndarray]:
        """A second try of what was missed, with what the plugin's entry changes for that, and without memory of the first."""
        if self._second is None:
            self._second = _PluginSolver(self._program, second=True)
        answer = self._solved(self._second, arrays)
        if self._program.plugin.remembers:
            self.start_over()
        return answer

    def _solved(self, solver: "_PluginSolver", arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        inputs = [flat(arrays[name]) for name in INPUTS]
        outputs = [np.empty((len(inputs[0]), size)) for size in self._finish.sizes_out]
        for start in range(0, len(inputs[0]), TOGETHER):
            rows = slice(start, start + TOGETHER)
            for output, part in zip(outputs, self._solved_together(solver, [array[rows] for array in inputs]), strict=True):
                output[rows] = part
        return dict(zip(OUTPUTS, outputs, strict=True))

    def _solved_together(self, solver: "_PluginSolver", inputs: list[np.ndarray]) -> list[np.ndarray]:
        assembled = self._assemble(inputs)
        H, f, A, lower, _, U, length = assembled
        solution, failed = solver(assembled, inputs[INPUTS.index("reactions")])
        outputs = self._finish([*inputs, H, f, A, lower, U, length, *solution])
        for output in outputs:
            output[failed] = np.nan
        return outputs


class _PluginSolver:
    """The plugin's solver, with a memory of its own."""

    def __init__(self, program: ContactProgram, *, second: bool = False) -> None:
        self._remembers = program.plugin.remembers
        # Whatever the thread: quiet() has one lock, so that CasADi's objects are made one after the other.
        with quiet():
            qp = program.qp(second=second)
        self._inputs = [ASSEMBLED[name] for name in qp.name_in() if name in ASSEMBLED]
        self._results = [qp.name_out().index(name) for name in ("x", "lam_a", "lam_x")]
        at_least = np.zeros(qp.numel_in("g"))
        at_least[: -program.slacks] = -np.inf
        bounds = {"lbx": at_least, "ubx": np.full(at_least.shape, np.inf)}
        # The other inputs are zero, and starting points that no plugin is told to use.
        given = {i: bounds.get(name, np.zeros(1)) for i, name in enumerate(qp.name_in()) if name not in ASSEMBLED}
        with quiet():
            self._solve = Mapped(qp, given)

    def __call__(self, assembled: list[np.ndarray], before: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
        """x, lam_a and lam_x of assembled QPs, (realization, entry), and (realization,) where the solver gave up.

        A solver that starts from the previous problem's rows has less to change where problems alike follow each other:
        those in which the same rows probably carry, that did `before` (realization, row), or in a first step are violated.
        """
        problems = [assembled[i] for i in self._inputs]
        if not self._remembers:
            solved, failed = self._solve(problems)
            return [solved[i] for i in self._results], failed
        violated = assembled[ASSEMBLED["lba"]][:, : before.shape[1]]
        likely = np.where(before.any(axis=1, keepdims=True), before, violated) > 0
        order = np.lexsort(np.packbits(likely, axis=1).T)
        solved, failed = self._solve([problem[order] for problem in problems])
        back = np.argsort(order)
        return [solved[i][back] for i in self._results], failed[back]
