"""Screening: few realizations show which groups of contributors matter for any measure; the others are estimated as one group.

The total index of a set of groups is at least the total index of each group in it: T_i <= T_u for i in u. So the joint total
index of all minor groups bounds the first-order and total index of each of them, and costs as much as one group.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tolcontact.analyses.designs import MixedDraws
from tolcontact.analyses.engine import Engine
from tolcontact.statistics.intervals import UNDEFINED, Estimate
from tolcontact.statistics.sobol_indices import sobol_indices

MIN_GROUPS = 17  # fewer are not screened
SCREENING_SAMPLES, START = 128, 1 << 38  # base realizations of a screening, and the number of the first one
MINOR_SHARE = 0.01  # of the variance of any measure in any state: the largest joint share of minor groups
MIN_EFFECTIVE = 16  # effective base realizations behind the variance of a measure: with fewer, no group is minor


@dataclass(frozen=True, eq=False)
class Screening:
    """Groups of contributors, divided into major and minor ones.

    groups     columns of deviations by group
    is_minor   (group,)
    totals     (measure, state, group): rough total indices; NaN where nothing varies
    """

    groups: Mapping[str, np.ndarray]
    is_minor: np.ndarray
    totals: np.ndarray

    @classmethod
    def none(cls, groups: Mapping[str, np.ndarray]) -> "Screening":
        """Return a screening without minor groups."""
        return cls(groups, np.zeros(len(groups), dtype=bool), np.zeros((0, 0, len(groups))))

    @property
    def estimated(self) -> list[np.ndarray]:
        """The columns of the estimated groups: each major group, then all minor groups as one, if there are any."""
        columns = list(self.groups.values())
        minor = [columns[k] for k in np.flatnonzero(self.is_minor)]
        return [columns[k] for k in np.flatnonzero(~self.is_minor)] + ([np.concatenate(minor)] if minor else [])

    def of_all_groups(
        self, estimates: tuple[list[Estimate], list[Estimate]], measure: int, state: int
    ) -> tuple[list[Estimate], list[Estimate], Estimate]:
        """Return first-order and total indices of all groups, and the joint total index of the minor ones.

        `estimates` are first-order and total indices of the estimated groups. The interval of a minor group extends from 0 to
        the joint upper bound of all minor groups.
        """
        if not self.is_minor.any():
            return *estimates, Estimate(0.0, 0.0, 0.0)
        together = estimates[1][-1]
        bounded = [self._bounded(float(total), together) for total in self.totals[measure, state]]
        first_order, total = (
            [bounded[k] if minor else next(major) for k, minor in enumerate(self.is_minor)] for major in map(iter, estimates)
        )
        return first_order, total, together

    def _bounded(self, total: float, together: Estimate) -> Estimate:
        """Return the index of a minor group from its rough total and the joint total of all minor groups."""
        if np.isnan(together.value):
            return UNDEFINED
        upper = together.value if np.isnan(together.upper) else max(together.upper, 0.0)
        return Estimate(min(np.nan_to_num(total), upper), 0.0 * together.upper, together.upper)


def screened(engine: Engine, groups: Mapping[str, np.ndarray], seed: int) -> Screening:
    """Return the screening of groups by total indices, with separate realizations. Few groups are all estimated."""
    if len(groups) < MIN_GROUPS:
        return Screening.none(groups)
    design = MixedDraws(engine.program.draws, list(groups.values()))
    measured, _ = engine.simulate_design(design, SCREENING_SAMPLES, seed=seed, start=START)
    totals, accuracies = [], engine.program.accuracies
    for states, accuracy in zip(measured.transpose(3, 2, 0, 1), accuracies, strict=True):
        totals.append([[index.value for index in sobol_indices(f, accuracy)[1]] for f in states])
        if any(0 < _effective_count(f) < MIN_EFFECTIVE for f in states):
            return Screening.none(groups)
    shares = np.nan_to_num(np.array(totals)).reshape(-1, len(groups))
    order = np.argsort(shares.max(axis=0, initial=0.0), kind="stable")
    is_minor = np.zeros(len(groups), dtype=bool)
    is_minor[order] = (shares[:, order].cumsum(axis=1) <= MINOR_SHARE).all(axis=0)
    return Screening(groups, is_minor, np.array(totals)) if is_minor.sum() > 1 else Screening.none(groups)


def _effective_count(f: np.ndarray) -> float:
    """Return the effective number of base realizations behind the variance of f (n, 2 + group); 0 without variance."""
    squares = ((f[:, :2] - f[:, :2].mean()) ** 2).mean(axis=1)
    return float(squares.sum() ** 2 / (squares**2).sum()) if squares.any() else 0.0
