"""The contact QP of one group, solved for many realizations: assemble, solve, finish."""

import numpy as np

from tolcontact.symbolic.batch import Mapped, evaluator, flat
from tolcontact.symbolic.contact_program import INPUTS, OUTPUTS, ContactProgram


class ContactSolver:
    """Solves the QPs of a ContactProgram. Not to be shared between threads."""

    def __init__(self, program: ContactProgram) -> None:
        self._assemble, self._finish = evaluator(program.assemble), evaluator(program.finish)
        self._solve = Mapped(program.qp)
        self._names = program.qp.name_in()
        self._results = program.qp.name_out()
        size, slacks = program.qp.numel_in("g"), program.slacks
        at_least = np.full(size, -np.inf)
        at_least[size - slacks :] = 0.0
        self._given = {"lbx": at_least, "ubx": np.full(size, np.inf)}
        self._sizes = {name: program.qp.nnz_in(name) for name in self._names}

    def __call__(self, **arrays: np.ndarray) -> dict[str, np.ndarray]:
        """The outputs of contact_program by name, (realization, entry), for its inputs by name, (realization, ...).

        They are NaN where the solver gave up.
        """
        inputs = [flat(arrays[name]) for name in INPUTS]
        count = len(inputs[0])
        (H, f, A, lower, upper, U), _ = self._assemble(inputs)
        problem = {"h": H, "g": f, "a": A, "lba": lower, "uba": upper}
        for name in self._names:
            if name not in problem:
                problem[name] = np.broadcast_to(self._given.get(name, np.zeros(self._sizes[name])), (count, self._sizes[name]))
        solved, failed = self._solve([problem[name] for name in self._names])
        x, lam_a, lam_x = (solved[self._results.index(name)] for name in ("x", "lam_a", "lam_x"))
        outputs, _ = self._finish([*inputs, H, f, A, lower, U, x, lam_a, lam_x])
        for output in outputs:
            output[failed] = np.nan
        return dict(zip(OUTPUTS, outputs, strict=True))
