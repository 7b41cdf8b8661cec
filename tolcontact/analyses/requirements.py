"""Requirements on corrected measures of realizations: a largest share outside limits, or a smallest Ppk.

Realizations that cannot be assembled count as outside the limits, and a Ppk leaves them out, as summaries do.
"""

import bisect
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.limits import Limits
from tolcontact.realizations import is_assembled
from tolcontact.statistics.capability import by_percentiles, share_outside, without_stops
from tolcontact.statistics.intervals import UNDEFINED, Estimate, proportion_of
from tolcontact.statistics.measure_statistics import MIN_VALUES, VALUE, StatisticRequest
from tolcontact.statistics.sample import Sample
from tolcontact.vocabulary import PPK, PPM

TAIL = 0.00135
ROUNDING = 1e-9
MIN_DECISIVE, DECISIVE = 128, 8  # values that determine a margin: at least, and in multiples of the values beyond it
SPREAD = 4.0  # of the shares whose quantiles are averaged for slopes: a single quantile rests on too few realizations
MIN_HITS = 10  # realizations outside the limits needed to estimate a share
EXAMPLES = ("corner height: ppm 1000", "gap: Ppk 1.33")


@dataclass(frozen=True, eq=False)
class Corrected:
    """Corrected measures of realizations. Poses of unresolved realizations are arbitrary, and so are their measures.

    values  (n, measure)
    status  (n,)
    """

    values: np.ndarray
    status: np.ndarray

    @property
    def count(self) -> int:
        """The number of realizations."""
        return len(self.status)

    @property
    def is_assembled(self) -> np.ndarray:
        """Whether each realization can be assembled, (n,)."""
        return is_assembled(self.status)

    @property
    def is_resolved(self) -> np.ndarray:
        """Whether each realization is resolved, (n,)."""
        return ~np.isin(self.status, terms.UNRESOLVED)

    def existing(self, measure: int) -> np.ndarray:
        """Return the values (k,) of a measure, of the realizations that can be assembled."""
        return self.values[self.is_assembled, measure]

    def take(self, rows: np.ndarray) -> "Corrected":
        """Return the realizations with the indices, or the mask, `rows`."""
        return Corrected(self.values[rows], self.status[rows])

    def replaced(self, rows: np.ndarray, others: "Corrected") -> "Corrected":
        """Return the same realizations with `others` at the indices `rows`."""
        values, status = self.values.copy(), self.status.copy()
        values[rows], status[rows] = others.values, others.status
        return Corrected(values, status)

    @classmethod
    def joined(cls, parts: "Sequence[Corrected]") -> "Corrected":
        """Return the realizations of all parts."""
        return cls(np.concatenate([part.values for part in parts]), np.concatenate([part.status for part in parts]))


@dataclass(frozen=True)
class Requirement:
    """A largest share of a corrected measure outside its limits, or a smallest Ppk.

    name      the text of the user
    measure   index of the measure
    is_share  whether `value` is a share (of 1); otherwise it is a Ppk
    """

    name: str
    measure: int
    limits: Limits
    is_share: bool
    value: float

    @classmethod
    def parse(cls, text: str, program: Program) -> "Requirement":
        """Return the requirement "corner height: ppm 1000" or "corner height: Ppk 1.33". Raises OptionError for others."""
        request = StatisticRequest.parse(text, "require", statistics=(PPM, PPK), form=VALUE, examples=EXAMPLES)
        measures = program.nominal.measures
        number = request.number_of([measure.name for measure in measures])
        limits = program.limits(number)
        if limits.are_open:
            raise OptionError(f'require names "{request.measure}", which has no limits; give it tolerance=... or limits=...')
        is_share = request.statistic == PPM
        return cls(text.strip(), number, limits, is_share, request.value * (1e-6 if is_share else 1))

    @property
    def share(self) -> float:
        """The permitted share of values beyond the limits; for a Ppk, the share beyond its percentiles."""
        return self.value if self.is_share else TAIL

    def margin(
        self, corrected: Corrected, shares: float | np.ndarray | None = None, index: float | None = None
    ) -> float:  # fmt: skip
        """Return the margin of measures above the requirement, in the measure's units; negative if they miss it.

        For a share the margin is a quantile of the distances within the limits. It changes continuously with the values,
        while a count of values outside jumps. Limits that are stops need no margin (see without_stops).
        `shares`, whose quantiles are averaged, and the `index` replace the share and the index of the requirement.
        """
        shares = self.share if shares is None else shares
        if self.is_share:
            return -float(np.quantile(self._excess(corrected), 1 - shares).mean())
        index, x = self.value if index is None else index, corrected.existing(self.measure)
        if len(x) < MIN_VALUES:  # the estimate is undefined; the search needs a number
            x = corrected.values[:, self.measure]
        limits = without_stops(Sample.of(x), self.limits)
        tail, middle, head = np.quantile(x, shares).mean(), np.median(x), np.quantile(x, 1 - shares).mean()
        sides = limits.upper - middle - index * (head - middle), middle - limits.lower - index * (middle - tail)
        return float(np.nanmin(sides))

    def _excess(self, corrected: Corrected) -> np.ndarray:
        """Return by how much values (n,) lie beyond the limits that are no stops.

        Realizations that cannot be assembled lie beyond by the largest distance of any value from the limits.
        """
        limits = without_stops(Sample.of(corrected.existing(self.measure)), self.limits)
        excess = limits.excess(corrected.values[:, self.measure])
        distances = np.abs(excess[np.isfinite(excess)])  # infinite if all limits are stops
        return np.where(corrected.is_assembled, excess, distances.max(initial=self.limits.accuracy))

    def smooth_margin(self, corrected: Corrected) -> float:
        """Return the margin with the means of quantiles around the quantiles of `margin`, for slopes."""
        spread = min(SPREAD, self.share**-0.5)
        return self.margin(corrected, self.share * np.geomspace(1 / spread, spread, 16))

    def sure_margin(self, corrected: Corrected) -> float:
        """Return the margin of the 95 % interval of the share or the Ppk: 0 or more if a fresh run keeps the requirement."""
        if self.is_share:
            count = corrected.count
            hits = bisect.bisect_right(range(count + 1), self.value, key=lambda hits: proportion_of(hits, count).upper) - 1
            return self.margin(corrected, hits / count) if hits >= 0 else -math.inf
        value, lower, _ = self.estimate(corrected)
        return self.margin(corrected, index=self.value + value - lower) if lower > 0 else -math.inf

    def decisive(self, corrected: Corrected) -> np.ndarray:
        """Return the indices of the realizations that determine the margin: values beyond it, and values near it.

        The median of a Ppk is treated as constant.
        """
        x = corrected.values[:, self.measure]
        count = max(math.ceil(DECISIVE * self.share * len(x)), MIN_DECISIVE)
        keys = [-self._excess(corrected)] if self.is_share else [x, -x]
        return np.concatenate([np.argsort(key)[:count] for key in keys])

    def shortfall(self, corrected: Corrected) -> float:
        """Return the shortfall of the bound of an estimate as a share of the required value; 0 if it meets the requirement."""
        _, lower, upper = self.estimate(corrected)
        missing = upper - self.value if self.is_share else self.value - lower
        return max(missing / self.value, 0.0) if np.isfinite(missing) else np.inf

    def estimate(self, corrected: Corrected) -> Estimate:
        """Return the share outside, or the Ppk, with its 95 % interval."""
        x = corrected.existing(self.measure)
        if self.is_share:
            return share_outside(Sample.of(x), self.limits, corrected.count - len(x))
        return by_percentiles(Sample.of(x), self.limits)[1] if len(x) >= MIN_VALUES else UNDEFINED


def requirements_of(require: str | Sequence[str], program: Program, samples: int) -> list[Requirement]:
    """Return the requirements that texts state. Raises OptionError if there are none, or for too few samples."""
    requirements = [Requirement.parse(text, program) for text in ([require] if isinstance(require, str) else require)]
    if not requirements:
        raise OptionError('require is empty; expected a text such as "corner height: ppm 1000"')
    for requirement in requirements:
        minimum = int(np.ceil(MIN_HITS / requirement.share * (1 - ROUNDING)))
        if samples < minimum:
            raise OptionError(
                f'{samples} realizations are too few for "{requirement.name}"; expected samples={minimum} or more'
            )
    return requirements
