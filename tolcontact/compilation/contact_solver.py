"""The contact QP of one group, solved for many realizations: assemble, solve, polish, finish."""

import copy

import numpy as np

from tolcontact.compilation.contact_qp import INPUTS, OUTPUTS, ContactProgram
from tolcontact.compilation.functions.batch import Batch, Expressions, Mapped, flat
from tolcontact.compilation.plugins import ACCURACY, PLUGINS, Plugin
from tolcontact.compilation.polishing import polished
from tolcontact.mechanics.quiet import MAKING, quiet

ASSEMBLED = {"h": 0, "g": 1, "a": 2, "lba": 3, "uba": 4}  # which output of `assemble` is which input of the solver
TOGETHER = 1024  # realizations whose QPs fit into a processor's cache
ROUGH = 1e-1 * ACCURACY  # mm: an answer with a larger KKT residual is polished, and
NEARLY, FINE = 1e-3, 1e-2 * ACCURACY  # mm: so is one with that residual, where the step is so small that noise would be seen


class ContactSolver:
    """Solves the QPs of a ContactProgram. Not to be shared between threads."""

    def __init__(self, program: ContactProgram) -> None:
        self._program = program
        self._assemble, self._finish = Expressions(program.assemble), Expressions(program.finish)
        self._energy = Batch(program.energy)
        self._plugin = program.plugin
        self.start_over()

    def twin(self) -> "ContactSolver":
        """The same for another thread."""
        other = copy.copy(self)
        other.start_over()
        return other

    def start_over(self) -> None:
        """Forget all problems solved before: some plugins start from the last one."""
        self._first: _PluginSolver = _PluginSolver(self._program, self._plugin)
        self._others: dict[str, _PluginSolver] = {}

    def __call__(self, **arrays: np.ndarray) -> dict[str, np.ndarray]:
        """The outputs of contact_program by name, (realization, entry), for its inputs by name, (realization, ...).

        Besides `second` (realization, 1): whether another plugin had to answer. What the plugin misses is tried again by
        others, without curvature. `residual` is infinite, and other outputs may be NaN, where all gave up.
        """
        answer = self._solved(self._first, arrays)
        answer["second"] = np.zeros_like(answer["residual"])
        for name in self._plugin.second:
            lost = np.flatnonzero(~(answer["residual"][:, 0] <= ACCURACY))
            if not lost.size:
                break
            if name not in self._others:
                self._others[name] = _PluginSolver(self._program, PLUGINS[name])
            problems = {word: values[lost] for word, values in arrays.items()} | {"newton": np.zeros(len(lost))}
            again = self._solved(self._others[name], problems)
            again["second"] = np.ones((len(lost), 1))
            better = again["residual"][:, 0] < answer["residual"][lost, 0]
            for word, values in again.items():
                answer[word][lost[better]] = values[better]
            if PLUGINS[name].remembers:
                del self._others[name]
        return answer

    def energy(self, **arrays: np.ndarray) -> np.ndarray:
        """The objective (realization,) at poses, for raw poses, moments and deviations (see ContactProgram)."""
        return self._energy(**arrays)["energy"][:, 0]

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
        solution, failed = solver(assembled, inputs[INPUTS.index("reactions")])
        outputs = self._finished(inputs, assembled, solution)
        residual = outputs[OUTPUTS.index("residual")]
        residual[failed] = np.inf
        is_rough = residual[:, 0] > np.where(outputs[OUTPUTS.index("step")][:, 0] < NEARLY, FINE, ROUGH)
        rough = np.flatnonzero(is_rough & np.isfinite(residual[:, 0]))
        if rough.size:
            inputs, assembled = ([array[rough] for array in arrays] for arrays in (inputs, assembled))
            polished = self._polished(assembled, [array[rough] for array in solution])
            again = self._finished(inputs, assembled, polished)
            better = again[OUTPUTS.index("residual")][:, 0] < residual[rough, 0]
            for output, values in zip(outputs, again, strict=True):
                output[rough[better]] = values[better]
        return outputs

    def _finished(self, inputs: list[np.ndarray], assembled: list[np.ndarray], solution: list[np.ndarray]) -> list[np.ndarray]:
        H, f, A, lower, _, U, length = assembled
        outputs = self._finish([*inputs, H, f, A, lower, U, length, *solution])
        usable = np.isfinite(outputs[OUTPUTS.index("corrected")]).all(axis=1)
        residual = outputs[OUTPUTS.index("residual")]
        residual[~(usable & np.isfinite(residual[:, 0]))] = np.inf
        return outputs

    def _polished(self, assembled: list[np.ndarray], solution: list[np.ndarray]) -> list[np.ndarray]:
        problem = {}
        for name in ("h", "g", "a", "lba"):
            sparsity, stored = self._program.assemble.sparsity_out(ASSEMBLED[name]), assembled[ASSEMBLED[name]]
            dense = np.zeros((len(stored), sparsity.numel()))
            dense[:, sparsity.find()] = stored
            shape = (sparsity.size2(), sparsity.size1()) if name in ("h", "a") else (sparsity.numel(),)
            problem[name] = dense.reshape(len(stored), *shape)
            if name in ("h", "a"):
                problem[name] = problem[name].swapaxes(1, 2)
        return polished(problem, solution, self._program.equalities, self._program.slacks)


class _PluginSolver:
    """A plugin's solver, with a memory of its own."""

    def __init__(self, program: ContactProgram, plugin: Plugin) -> None:
        self._remembers = plugin.remembers
        with MAKING, quiet():
            qp = program.qp(plugin)
        self._inputs = [ASSEMBLED[name] for name in qp.name_in() if name in ASSEMBLED]
        self._results = [qp.name_out().index(name) for name in ("x", "lam_a", "lam_x")]
        at_least = np.zeros(qp.numel_in("g"))
        at_least[: -program.slacks] = -np.inf
        bounds = {"lbx": at_least, "ubx": np.full(at_least.shape, np.inf)}
        # The other inputs are zero, and starting points that no plugin is told to use.
        given = {i: bounds.get(name, np.zeros(1)) for i, name in enumerate(qp.name_in()) if name not in ASSEMBLED}
        with MAKING, quiet():
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
