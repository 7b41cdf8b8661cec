"""A sample that is read piece by piece, as often as needed, so that it need not fit into memory."""

import itertools
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache, cached_property

import numpy as np
import xarray as xr
from scipy import special

from tolcontact import vocabulary as terms
from tolcontact.errors import TolcontactError
from tolcontact.realizations import pieces

MAX_SORTED_VALUES = 1 << 20  # larger samples are not sorted in memory
MAX_KEPT_VALUES = 1 << 20  # more values are read from the file for each statistic
MIN_REPLICATES = 16
MIN_APART = 20  # values apart from a stop: moments of fewer have no interval
ROUNDING = 1e-20  # of the variance of realizations: a smaller variance between replicates counts as 0
STANDARDIZED_MOMENTS = 17  # the fourth powers of influences on the fourth moment, and the zeroth


class Sample:
    """One number for each realization, in `pieces`: a function that yields arrays (realization,) from the start at each call.

    `replicate` successive realizations are one replicate, independent of all others; 1 if all realizations are independent.
    Values that differ by no more than `accuracy` are equal. `cause` is the same measure without contact, if it is
    known.
    """

    def __init__(
        self, pieces: Callable[[], Iterable[np.ndarray]], replicate: int = 1, max_sorted: int = MAX_SORTED_VALUES,
        accuracy: float = 0.0, cause: "Sample | None" = None,
    ) -> None:  # fmt: skip
        self.pieces, self.replicate, self.max_sorted = pieces, replicate, max_sorted
        self.accuracy, self.cause = accuracy, cause

    @classmethod
    def of(cls, x: "np.ndarray | Sample") -> "Sample":
        """Return a sample of an array (realization,), or the sample itself."""
        return x if isinstance(x, Sample) else cls(lambda: [x])

    def __sub__(self, subtrahend: "Sample") -> "Sample":
        return Sample(
            lambda: (a - b for a, b in zip(self.pieces(), subtrahend.pieces(), strict=True)), self.replicate,
            accuracy=self.accuracy + subtrahend.accuracy, cause=self.cause or subtrahend.cause,
        )  # fmt: skip

    def map(self, function: Callable[[np.ndarray], np.ndarray]) -> "Sample":
        """Return the sample of an elementwise function of the values."""
        return Sample(lambda: (function(piece) for piece in self.pieces()), self.replicate)

    def followed_by(self, values: Sequence[float]) -> "Sample":
        """Return the sample with more values at its end."""
        return Sample(lambda: itertools.chain(self.pieces(), [np.array(values)]), self.replicate) if values else self

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
        sums, start = np.zeros((2, replicates)), 0  # over a whole replicate, and over as many realizations as the last one has
        for piece in self.pieces():
            numbers, places = np.divmod(start + np.arange(len(piece)), self.replicate)
            for k, counts in enumerate((places >= 0, places < rest)):
                sums[k] += np.bincount(numbers, (piece - self.mean) * counts, minlength=replicates)[:replicates]
            start += len(piece)
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
        # If nearly all values of several pieces are equal, they are the median of the first one as well.
        first = next(piece for piece in self.pieces() if len(piece))
        median = np.partition(first, len(first) // 2)[len(first) // 2]
        at_stop = sum(int((np.abs(piece - median) <= self.accuracy).sum()) for piece in self.pieces())
        if at_stop == self.count:
            return self.cause is not None and self.cause.moments[0] <= max(ROUNDING * self.cause.mean**2, self.accuracy**2)
        return at_stop <= 1 or self.count - at_stop >= MIN_APART

    @cached_property
    def count(self) -> int:
        return sum(len(piece) for piece in self.pieces())

    @cached_property
    def mean(self) -> float:
        # Summed relative to the first value: the mean of equal numbers equals them to the last bit.
        origin = float(next(piece[0] for piece in self.pieces() if len(piece)))
        if not np.isfinite(origin):
            return np.nan
        with np.errstate(invalid="ignore"):  # of infinite values
            return origin + float(sum((piece - origin).sum() for piece in self.pieces()) / self.count)

    @cached_property
    def moments(self) -> tuple[float, float]:
        """The second and the fourth central moment."""
        sums = np.zeros(2)
        for piece in self.pieces():
            square = (piece - self.mean) ** 2
            sums += square.sum(), (square**2).sum()
        return float(sums[0] / self.count), float(sums[1] / self.count)

    @cached_property
    def standardized_moments(self) -> np.ndarray:
        """The moments of the standardized values, from the zeroth to the sixteenth."""
        scale, sums = np.sqrt(self.moments[0]), np.zeros(STANDARDIZED_MOMENTS)
        for piece in self.pieces():
            z = (piece - self.mean) / scale
            power = np.ones_like(z)
            for k in range(STANDARDIZED_MOMENTS):
                sums[k] += power.sum()
                power *= z  # a power by `**` takes twenty times as long
        return sums / self.count

    def ordered(self, ranks: Sequence[int]) -> np.ndarray:
        """Return the order statistics at ranks from 0 (least) to count - 1; NaN if a value is not finite."""
        return np.array(self._sorted[list(ranks)]) if np.isfinite(self.mean) else np.full(len(ranks), np.nan)

    @cached_property
    def _sorted(self) -> np.ndarray:
        """The values in ascending order; values of a sample that does not fit into memory are in a temporary file."""
        if self.count <= self.max_sorted:
            return np.sort(np.concatenate(list(self.pieces())))
        try:
            with tempfile.TemporaryFile() as file:  # it exists until the array is gone
                for piece in self.pieces():  # written, not mapped: a full disk is an error, and does not end the process
                    file.write(np.ascontiguousarray(piece, dtype=float).data)
                file.flush()
                values = np.memmap(file, dtype=float, mode="r+", shape=(self.count,))
        except OSError as error:
            raise TolcontactError(
                f"{self.count} values cannot be sorted: {error.strerror}; folder {tempfile.gettempdir()} needs room for "
                f"{8 * self.count / 1e6:.2g} MB; choose another one by the variable TMPDIR"
            ) from error
        values.sort()
        return values


def measured_sample(rows: xr.Dataset, measure: int, state: str) -> Sample:
    """Return the values of a measure, given by its index, in a state; they are read from the rows when needed.

    Up to MAX_KEPT_VALUES are read once, and kept for the lifetime of the sample.
    """
    column = rows[[terms.MEASURED.name]].sel({terms.STATE: state}).isel({terms.MEASURE: measure})
    is_planned = rows.attrs.get("sampler", terms.MONTE_CARLO) != terms.MONTE_CARLO

    def read() -> Iterator[np.ndarray]:
        return (piece[terms.MEASURED.name].values for piece in pieces(column))

    is_kept = rows.sizes[terms.REALIZATION] <= MAX_KEPT_VALUES
    sample = Sample(
        cache(lambda: list(read())) if is_kept else read, terms.REPLICATE if is_planned else 1,
        accuracy=float(rows[terms.MEASURE_ACCURACY.name].values[measure]),
    )  # fmt: skip
    raw = terms.STATES[terms.RAW]
    sample.cause = sample if state == raw else measured_sample(rows, measure, raw)
    return sample
