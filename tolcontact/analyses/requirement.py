"""Requirements on a measure: a share outside its limits, or a capability."""

import math
from dataclasses import dataclass

import numpy as np

from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.limits import Limits
from tolcontact.statistics.capability import by_percentiles, share_outside
from tolcontact.statistics.intervals import Estimate
from tolcontact.statistics.measure_statistics import VALUE, StatisticRequest
from tolcontact.statistics.sample import Sample
from tolcontact.vocabulary import PPK, PPM

TAIL, HEAD = 0.00135, 0.99865
ROUNDING = 1e-9
MIN_DECISIVE, DECISIVE = 64, 4  # values that determine a margin: at least, and in multiples of the values beyond it
MIN_HITS = 10  # realizations outside the limits needed to estimate a share
EXAMPLES = ("corner height: ppm 1000", "gap: Ppk 1.33")


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

    def check(self, samples: int) -> None:
        """Raise OptionError if `samples` are too few to estimate the share or the Ppk."""
        minimum = int(np.ceil(MIN_HITS / self.share * (1 - ROUNDING)))
        if samples < minimum:
            raise OptionError(f'{samples} realizations are too few for "{self.name}"; expected samples={minimum} or more')

    def margin(self, x: np.ndarray) -> float:
        """Return the margin of values (n,) above the requirement, in the measure's units; negative if they do not meet it.

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
        """Return the indices of the values (n,) that determine the margin: values beyond it, and values near it.

        The median of a Ppk is treated as constant.
        """
        count = max(math.ceil(DECISIVE * self.share * len(x)), MIN_DECISIVE)
        orders = [np.argsort(-self.limits.excess(x))] if self.is_share else [np.argsort(x), np.argsort(-x)]
        return np.concatenate([order[:count] for order in orders])

    def shortfall(self, x: np.ndarray) -> float:
        """Return the shortfall of values (n,) as a share of the required value; 0 if they meet the requirement."""
        reached = self.estimate(x).value
        missing = reached - self.value if self.is_share else self.value - reached
        return max(missing / self.value, 0.0) if np.isfinite(missing) else np.inf

    def estimate(self, x: np.ndarray) -> Estimate:
        """Return the share outside, or the Ppk, of values (n,), with its 95 % interval."""
        sample = Sample.of(x)
        if self.is_share:
            return share_outside(sample, self.limits)
        return by_percentiles(sample, self.limits)[1]
