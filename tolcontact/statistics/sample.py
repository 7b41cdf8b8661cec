"""A sample of one number for each realization. It is read when it is first needed, and then kept."""

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
import xarray as xr
from scipy import special

from tolcontact import vocabulary as terms
from tolcontact.realizations import column

MIN_REPLICATES = 16
MIN_APART = 20  # values apart from a stop: moments of fewer have no interval
ROUNDING = 1e-20  # of the variance of realizations: a smaller variance between replicates counts as 0
STANDARDIZED_MOMENTS = 17  # the fourth powers of influences on the fourth moment, and the zeroth


class Sample:
    """One number for each realization: `values` (realization,), which a function reads.

    `replicate` successive realizations are one replicate, independent of all others; 1 if all realizations are independent.
    Values that differ by no more than `accuracy` are equal. `cause` is the same measure without contact, if it is
    known.
    """

    def __init__(
        self, read: Callable[[], np.ndarray], replicate: int = 1, accuracy: float = 0.0, cause: "Sample | None" = None
    ) -> None:
        self._read, self.replicate, self.accuracy, self.cause = read, replicate, accuracy, cause

    @classmethod
    def of(cls, x: "np.ndarray | Sample") -> "Sample":
        """Return a sample of an array (realization,), or the sample itself."""
        return x if isinstance(x, Sample) else cls(lambda: x)

    def __sub__(self, subtrahend: "Sample") -> "Sample":
        return Sample(
            lambda: self.values - subtrahend.values, self.replicate, accuracy=self.accuracy + subtrahend.accuracy,
            cause=self.cause or subtrahend.cause,
        )  # fmt: skip

    def map(self, function: Callable[[np.ndarray], np.ndarray]) -> "Sample":
        """Return the sample of an elementwise function of the values."""
        return Sample(lambda: function(self.values), self.replicate)

    def followed_by(self, values: Sequence[float]) -> "Sample":
        """Return the sample with more values at its end."""
        return Sample(lambda: np.concatenate([self.values, values]), self.replicate) if values else self

    @cached_property
    def values(self) -> np.ndarray:
        return self._read()

    @property
    def widening(self) -> float:
        """The widening factor for the interval of a mean of independent realizations; a factor below 1 narrows it.

        The factor is the root of the design effect (Kish, 1965), the variance of the means of replicates over the variance of
        means of independent realizations, with Student's t for the number of replicates. The last replicate may be incomplete;
        its sum varies like the sum of equally many realizations at the start of the others. The factor is 1 with fewer than
        MIN_REPLICATES replicates, since their spread is too uncertain.
        """
        if self.replicate == 1:
            return 1.0
        replicates, rest = divmod(self.count, self.replicate)
        if replicates < MIN_REPLICATES or not self.moments[0] > 0:
            return 1.0
        numbers, places = np.divmod(np.arange(self.count), self.replicate)
        # Over a whole replicate, and over as many realizations as the last one has.
        sums = np.array([
            np.bincount(numbers, (self.values - self.mean) * counts, minlength=replicates)[:replicates]
            for counts in (places >= 0, places < rest)
        ])  # fmt: skip
        variance = float(np.dot((replicates, 1), sums.var(axis=1, ddof=1))) / self.count
        if variance < ROUNDING * self.moments[0]:
            return 0.0
        student_over_normal = float(special.stdtrit(replicates - 1, 0.975) / special.ndtri(0.975))
        return student_over_normal * float(np.sqrt(variance / self.moments[0]))

    @cached_property
    def determines_moments(self) -> bool:
        """Whether enough values are apart from a stop, the value of more than one realization that is also the median.

        The interval of a moment relies on the values apart from it. If there are none, the moment is certain only if the
        measure does not vary without contact, either.
        """
        if not np.isfinite(self.mean):
            return True
        if self._apart == 0:
            return self.cause is not None and self.cause.moments[0] <= max(ROUNDING * self.cause.mean**2, self.accuracy**2)
        return self._apart >= min(MIN_APART, self.count - 1)

    @property
    def required(self) -> int:
        """The number of realizations from which a moment would have an interval; 0 if it has one.

        If no value is apart from a stop, their share is at most 1 - 0.025^(1 / n), and the number a least one.
        """
        if self.determines_moments:
            return 0
        share = self._apart / self.count or -np.expm1(np.log(0.025) / self.count)
        return int(np.ceil(MIN_APART / share))

    @cached_property
    def _apart(self) -> int:
        """The number of values that differ from the median."""
        median = np.partition(self.values, self.count // 2)[self.count // 2]
        return int((np.abs(self.values - median) > self.accuracy).sum())

    @cached_property
    def count(self) -> int:
        return len(self.values)

    @cached_property
    def mean(self) -> float:
        # Summed relative to the first value: the mean of equal numbers equals them to the last bit.
        origin = float(self.values[0])
        if not np.isfinite(origin):
            return np.nan
        with np.errstate(invalid="ignore"):  # of infinite values
            return origin + float((self.values - origin).sum() / self.count)

    @cached_property
    def moments(self) -> tuple[float, float]:
        """The second and the fourth central moment."""
        square = (self.values - self.mean) ** 2
        return float(square.sum() / self.count), float((square**2).sum() / self.count)

    @cached_property
    def standardized_moments(self) -> np.ndarray:
        """The moments of the standardized values, from the zeroth to the sixteenth."""
        z, sums = (self.values - self.mean) / np.sqrt(self.moments[0]), np.zeros(STANDARDIZED_MOMENTS)
        power = np.ones_like(z)
        for k in range(STANDARDIZED_MOMENTS):
            sums[k] = power.sum()
            power *= z  # a power by `**` takes twenty times as long
        return sums / self.count

    def ordered(self, ranks: Sequence[int] | np.ndarray) -> np.ndarray:
        """Return the order statistics at ranks from 0 (least) to count - 1; NaN if a value is not finite."""
        return np.array(self._sorted[list(ranks)]) if np.isfinite(self.mean) else np.full(len(ranks), np.nan)

    @cached_property
    def _sorted(self) -> np.ndarray:
        return np.sort(self.values)


def measured_sample(rows: xr.Dataset, measure: int, state: str) -> Sample:
    """Return the values of a measure, given by its index, in a state; they are read from the rows when needed.

    An infinite value is not a number.
    """
    is_planned, raw = rows.attrs.get("sampler", terms.MONTE_CARLO) != terms.MONTE_CARLO, terms.STATES[terms.RAW]

    def read() -> np.ndarray:
        values = column(rows, terms.MEASURED, state=terms.STATES.index(state), measure=measure)
        return np.where(np.isfinite(values), values, np.nan)

    sample = Sample(
        read, terms.REPLICATE if is_planned else 1, accuracy=float(rows[terms.MEASURE_ACCURACY.name].values[measure]),
    )  # fmt: skip
    sample.cause = sample if state == raw else measured_sample(rows, measure, raw)
    return sample
