"""What few measured parts leave open about the changes between two runs, from the posterior draws of both (see few_parts).

What both runs know from the same parts is the same in each posterior draw: an equal population, or a contributor with equal
name, distribution and number of parts. All other parts are drawn independently, as those of two suppliers. The spread of the
changes over these worlds adds to their intervals like an independent error, on the log scale for ratios.

The shares of parts that were not measured, and of values beyond all realizations, are in the interval of each run and in no
world. So changes of shares combine the distances of the bounds of both runs as if they were independent (Zou and Donner, 2008):
that is conservative for runs with the same parts. Where these have distributions, and many values beyond limits, the worlds do.
"""

import math
from typing import NamedTuple

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.limits import Limits
from tolcontact.statistics.few_parts import FEW_BEYOND, NAMES, NEGLIGIBLE, Index, Worlds, joined, weighted
from tolcontact.statistics.intervals import Estimate
from tolcontact.statistics.measure_statistics import MIN_VALUES


class MeasureOfRun(NamedTuple):
    """A measurement of a run in a state.

    worlds   of its contributors; None if all are known
    y        (realization,) values, NaN if they do not exist
    limits   of the measurement
    outside  its share outside of them, with what few parts leave open
    """

    worlds: Worlds | None
    y: np.ndarray
    limits: Limits
    outside: Estimate

    @property
    def few_parts(self) -> Index | None:
        """The contributors of few parts in one number; None if the measurement does not depend on any."""
        if self.worlds is None or np.isfinite(self.y).sum() < MIN_VALUES:
            return None
        index = self.worlds.index(self.y)
        return index if any(index.depends) or index.spread > NEGLIGIBLE * np.nanstd(self.y) else None

    def draws(self, index: Index | None) -> tuple[np.ndarray, np.ndarray]:
        """Return the mean, 6 sigma and share outside in the run (3,), and in its worlds (world, 3) or (1, 3)."""
        order = np.argsort(self.y)[: int(np.isfinite(self.y).sum())]  # NaN come last
        columns = [NAMES.index(name) for name in (terms.MEAN, terms.SIX_SIGMA, terms.OUTSIDE)]

        def statistics(weights: np.ndarray) -> np.ndarray:
            return weighted(self.y[order], weights[:, order], self.limits, self.limits)[:, columns]

        own = statistics(np.full((1, len(self.y)), 1 / len(self.y)))
        if index is None or self.worlds is None:
            return own[0], own
        return own[0], np.concatenate([statistics(weights) for weights in self.worlds.weights(index)])


def widened_changes(estimates: list[Estimate], of_run: MeasureOfRun, of_reference: MeasureOfRun) -> list[Estimate]:
    """Return `CHANGES_OF_RUNS` from a reference run, with the intervals of the realizations alone made wider."""
    runs = of_run, of_reference
    indices = [run.few_parts for run in runs]
    known = [
        (run.worlds, index) for run, index in zip(runs, indices, strict=True) if run.worlds is not None and index is not None
    ]
    if not known or not all(np.isfinite(run.y).sum() >= MIN_VALUES for run in runs):
        return estimates
    (own, drawn), (own_reference, drawn_reference) = (run.draws(index) for run, index in zip(runs, indices, strict=True))
    widened = dict(zip(terms.CHANGES_OF_RUNS, estimates, strict=True))
    with np.errstate(divide="ignore", invalid="ignore"):
        draws = {
            terms.SHIFT: widened[terms.SHIFT].value + (drawn - own - drawn_reference + own_reference)[:, 0],
            terms.SPREAD_RATIO: widened[terms.SPREAD_RATIO].value * (drawn / own / drawn_reference * own_reference)[:, 1],
        }
    for name, of_change in draws.items():
        stretch = float(np.max([worlds.stretch(index, name) for worlds, index in known]))  # NaN if one is
        bounds = joined(np.array(widened[name]), of_change, stretch, is_positive=name != terms.SHIFT)
        widened[name] = Estimate(widened[name].value, *map(float, bounds))
    share = widened[terms.SHARE_SHIFT]
    hits = [drawn[:, 2].mean() * len(of_run.y), drawn_reference[:, 2].mean() * len(of_reference.y)]
    if _have_same_distributions(of_run.worlds, of_reference.worlds) and min(hits) >= FEW_BEYOND:
        of_share = share.value + (drawn - own - drawn_reference + own_reference)[:, 2]
        lower, upper = map(float, joined(np.array(share), of_share, 1.0, is_positive=False))
    else:
        lower, upper = _difference(share, of_run.outside, of_reference.outside)
    widened[terms.SHARE_SHIFT] = Estimate(share.value, max(lower, -1.0), min(upper, 1.0))
    return [widened[name] for name in terms.CHANGES_OF_RUNS]


def _have_same_distributions(worlds: Worlds | None, reference: Worlds | None) -> bool:
    """Return whether all that two runs know from few parts are the same distributions, and no measured rows."""
    if worlds is None or reference is None or worlds.has_rows or reference.has_rows:
        return False
    return worlds.sources == reference.sources


def _difference(change: Estimate, outside: Estimate, reference: Estimate) -> tuple[float, float]:
    """Return the bounds of a difference of shares, from the bounds of both, and no closer than the realizations give."""
    lower = change.value - math.hypot(outside.value - outside.lower, reference.upper - reference.value)
    upper = change.value + math.hypot(outside.upper - outside.value, reference.value - reference.lower)
    return (min(lower, change.lower), max(upper, change.upper)) if math.isfinite(change.value) else change[1:]
