"""Requirements on a measure: a share outside of its limits, or a capability."""

import math
from dataclasses import dataclass

import numpy as np

from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.limits import Limits
from tolcontact.statistics.capability import by_percentiles, share_outside
from tolcontact.statistics.intervals import Estimate
from tolcontact.statistics.sample import Sample
from tolcontact.statistics.statistic_request import VALUE, StatisticRequest
from tolcontact.vocabulary import PPK, PPM

TAIL, HEAD = 0.00135, 0.99865
ROUNDING = 1e-9
MIN_DECISIVE, DECISIVE = 64, 4  # values that decide a margin: at least, and times those beyond it
MIN_HITS = 10  # realizations outside of limits that a share is estimated from
EXAMPLES = ("corner height: ppm 1000", "gap: Ppk 1.33")


@dataclass(frozen=True)
class Requirement:
    """At most a share of a corrected measure outside of its limits, or at least a Ppk.

    name      as the user states it
    measure   number of the measure
    is_share  whether `value` is a share (of 1), else it is a Ppk
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
        """The share of values that it allows beyond the limits; of a Ppk, that beyond its percentiles."""
        return self.value if self.is_share else TAIL

    def check(self, samples: int) -> None:
        """Raise OptionError if `samples` are too few to estimate the share or the Ppk."""
        minimum = int(np.ceil(MIN_HITS / self.share * (1 - ROUNDING)))
        if samples < minimum:
            raise OptionError(f'{samples} realizations are too few for "{self.name}"; expected samples={minimum} or more')

    def margin(self, x: np.ndarray) -> float:
        """Return the margin by which values (n,) keep the requirement, in the measure's units; below 0 if they do not.

        For a share the margin is a quantile of the distances within the limits. It changes continuously with the values,
        while a count of values outside jumps.
        """
        if self.is_share:
            return -float(np.quantile(self.limits.excess(x), 1 - self.value))
        tail, middle, head = np.quantile(x, [TAIL, 0.5, HEAD])
        sides = [
            self.limits.upper - middle - self.value * (head - middle),
            middle - self.limits.lower - self.value * (middle - tail),
        ]
        return float(min(sides))

    def decisive(self, x: np.ndarray) -> np.ndarray:
        """Return the numbers of the values (n,) that the margin follows from: those beyond it, and as many again near it.

        The median of a Ppk is regarded as if it stayed.
        """
        count = max(math.ceil(DECISIVE * self.share * len(x)), MIN_DECISIVE)
        orders = [np.argsort(-self.limits.excess(x))] if self.is_share else [np.argsort(x), np.argsort(-x)]
        return np.concatenate([order[:count] for order in orders])

    def shortfall(self, x: np.ndarray) -> float:
        """Return by how much of the required value values (n,) miss it; 0 if they keep it."""
        reached = self.estimate(x).value
        missing = reached - self.value if self.is_share else self.value - reached
        return max(missing / self.value, 0.0) if np.isfinite(missing) else np.inf

    def estimate(self, x: np.ndarray) -> Estimate:
        """Return the share outside, or the Ppk, of values (n,), with its 95 % interval."""
        sample = Sample.of(x)
        if self.is_share:
            return share_outside(sample, self.limits)
        return by_percentiles(sample, self.limits)[1]
