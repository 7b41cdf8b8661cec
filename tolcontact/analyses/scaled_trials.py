"""Simulations of a model whose tolerance ranges are scaled."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.analyses.engine import VERIFICATION_FACTOR, Engine
from tolcontact.variation import Draws


@dataclass(frozen=True, eq=False)
class ScaledTrials:
    """Simulations with scaled ranges, on the same draws.

    groups  columns of each group
    """

    engine: Engine
    groups: Sequence[np.ndarray]
    seed: int
    samples: int

    def corrected(self, factors: np.ndarray, *, verification: int = 0) -> np.ndarray:
        """Return corrected measures (n, measure) with the groups' ranges times factors (group,).

        A `verification` with a number above 0 has draws of its own, and more of them.
        """
        count = VERIFICATION_FACTOR * self.samples if verification else self.samples
        measured, _ = self.engine.simulate(count, start=verification << 32, seed=self.seed, draws=self._draws(factors))
        return np.ascontiguousarray(measured[:, terms.CORRECTED])

    def corrected_rows(self, factors: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return corrected measures (row, measure) of some realizations alone, by their numbers (row,)."""
        deviations = self._draws(factors)(seed=self.seed, start=0, stop=self.samples)[rows]
        return self.engine.simulate_deviations(deviations)[0][:, terms.CORRECTED]

    def _draws(self, factors: np.ndarray) -> Draws:
        program = self.engine.program
        scale = np.ones(len(program.nominal.contributors))
        for factor, columns in zip(factors, self.groups, strict=True):
            scale[columns] = factor
        return program.draws.scaled(scale)

    def __len__(self) -> int:
        return len(self.groups)
