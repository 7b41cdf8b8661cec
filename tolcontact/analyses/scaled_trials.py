"""Simulations of a model with scaled tolerance ranges."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.analyses.engine import VERIFICATION_FACTOR, Engine
from tolcontact.variation import Draws

STEP = 0.1  # of ranges, for differences
FIRST_TRIALS = 64  # realizations that show whether most are unresolved
MAX_ROWS = 1 << 16  # realizations per simulation, over several factors


class Trial(NamedTuple):
    """Corrected measures (n, measure) of realizations, and whether each is resolved (n,).

    Poses of unresolved realizations are arbitrary, and so are their measures.
    """

    corrected: np.ndarray
    is_resolved: np.ndarray


@dataclass(frozen=True, eq=False)
class ScaledTrials:
    """Simulations with scaled ranges, on the same draws.

    groups  columns of each group
    """

    engine: Engine
    groups: Sequence[np.ndarray]
    seed: int
    samples: int
    _known: dict[str, np.ndarray] = field(default_factory=dict, init=False)

    def trial(self, factors: np.ndarray, *, verification: int = 0) -> Trial:
        """Return the trial with the groups' ranges times factors (group,).

        A `verification` above 0 is the number of a run with other draws, and more of them.
        """
        count = VERIFICATION_FACTOR * self.samples if verification else self.samples
        measured, status = self.engine.simulate(count, start=verification << 32, seed=self.seed, draws=self._draws(factors))
        return Trial(np.ascontiguousarray(measured[:, terms.CORRECTED]), ~np.isin(status, terms.UNRESOLVED))

    def trial_within(self, factors: np.ndarray, most_unresolved: int) -> Trial | None:
        """Return the trial with the groups' ranges times factors (group,), or None if too many realizations are unresolved.

        It stops once there are more than `most_unresolved`, since these take a hundred times as long as others.
        """
        draws, parts, unresolved, start = self._draws(factors), [], 0, 0
        while start < self.samples:
            stop = min(max(2 * start, FIRST_TRIALS), self.samples)
            measured, status = self.engine.simulate(stop - start, start=start, seed=self.seed, draws=draws)
            parts.append(Trial(measured[:, terms.CORRECTED], ~np.isin(status, terms.UNRESOLVED)))
            unresolved += int((~parts[-1].is_resolved).sum())
            if unresolved > most_unresolved:
                return None
            start = stop
        return Trial(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))

    def corrected_rows(self, factors: Sequence[np.ndarray], rows: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return corrected measures (row, measure) of selected realizations, for each of several factors (group,).

        rows  numbers (row,) of the realizations for each of the factors
        """
        corrected: list[np.ndarray] = []
        while len(corrected) < len(rows):
            start, counts = len(corrected), np.cumsum([len(numbers) for numbers in rows[len(corrected) :]])
            stop = start + max(int(np.searchsorted(counts, MAX_ROWS, side="right")), 1)
            deviations = [self._deviations(*trial) for trial in zip(factors[start:stop], rows[start:stop], strict=True)]
            corrected += np.split(self._corrected(np.concatenate(deviations)), counts[: stop - start - 1])
        return corrected

    def _corrected(self, deviations: np.ndarray) -> np.ndarray:
        """Return corrected measures (n, measure) of deviations (n, contributor); n may be 0."""
        if not len(deviations):
            return np.empty((0, len(self.engine.program.nominal.measures)))
        return self.engine.simulate_deviations(deviations)[0][:, terms.CORRECTED]

    def _deviations(self, factors: np.ndarray, rows: np.ndarray) -> np.ndarray:
        """Return the deviations (row, contributor) of the realizations with numbers `rows` (row,)."""
        return self._draws(factors).from_numbers(lambda label: self._numbers(label)[rows], len(rows))

    def _numbers(self, label: str) -> np.ndarray:
        """Return the random numbers (n,) between 0 and 1 for the deviations of a label, in all realizations."""
        if label not in self._known:
            self._known[label] = self.engine.program.draws.numbers(seed=self.seed, start=0, stop=self.samples)(label)
        return self._known[label]

    def _draws(self, factors: np.ndarray) -> Draws:
        program = self.engine.program
        scale = np.ones(len(program.nominal.contributors))
        for factor, columns in zip(factors, self.groups, strict=True):
            scale[columns] = factor
        return program.draws.scaled(scale)

    def __len__(self) -> int:
        return len(self.groups)
