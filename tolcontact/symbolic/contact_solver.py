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
        self._solve = self._solver()

    def again(self, **arrays: np.ndarray) -> dict[str, np.ndarray]:
        """A second try of what was missed, with what the plugin's entry changes for that, and without memory of others."""
        self._solve = self._solver(second=True)
        answer = self(**arrays)
        self.start_over()
        return answer

    def _solver(self, *, second: bool = False) -> Mapped:
        # Whatever the thread: quiet() has one lock, so that CasADi's objects are made one after the other.
        with quiet():
            qp = self._program.qp(second=second)
        self._inputs = [name for name in qp.name_in() if name in ASSEMBLED]
        self._results = qp.name_out()
        at_least = np.zeros(qp.numel_in("g"))
        at_least[: -self._program.slacks] = -np.inf
        bounds = {"lbx": at_least, "ubx": np.full(at_least.shape, np.inf)}
        # The other inputs are zero, and starting points that no plugin is told to use.
        given = {i: bounds.get(name, np.zeros(1)) for i, name in enumerate(qp.name_in()) if name not in ASSEMBLED}
        with quiet():
            return Mapped(qp, given)

    def __call__(self, **arrays: np.ndarray) -> dict[str, np.ndarray]:
        """The outputs of contact_program by name, (realization, entry), for its inputs by name, (realization, ...).

        They are NaN where the solver gave up.
        """
        inputs = [flat(arrays[name]) for name in INPUTS]
        outputs = [np.empty((len(inputs[0]), size)) for size in self._finish.sizes_out]
        for start in range(0, len(inputs[0]), TOGETHER):
            rows = slice(start, start + TOGETHER)
            for output, part in zip(outputs, self._solve_some([array[rows] for array in inputs]), strict=True):
                output[rows] = part
        return dict(zip(OUTPUTS, outputs, strict=True))

    def _solve_some(self, inputs: list[np.ndarray]) -> list[np.ndarray]:
        assembled = self._assemble(inputs)
        solved, failed = self._solve([assembled[ASSEMBLED[name]] for name in self._inputs])
        x, lam_a, lam_x = (solved[self._results.index(name)] for name in ("x", "lam_a", "lam_x"))
        H, f, A, lower, _, U, length = assembled
        outputs = self._finish([*inputs, H, f, A, lower, U, length, x, lam_a, lam_x])
        for output in outputs:
            output[failed] = np.nan
        return outputs
