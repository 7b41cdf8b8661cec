"""A sample that is read piece by piece, as often as needed, so that it need not fit into memory."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache, cached_property

import numpy as np
import xarray as xr
from scipy import special

from tolcontact import vocabulary as terms
from tolcontact.realizations import pieces

MAX_SORTED_VALUES = 1 << 20  # larger samples are not sorted in memory
MAX_KEPT_VALUES = 1 << 20  # more values are read from the file for each statistic
DIGIT = 16  # bits
COUNTED_DIGITS = 2
MAX_PREFIXES = 16  # counted in one pass, in 25 MB
MIN_REPLICATES = 16
ROUNDING = 1e-20  # of the variance of realizations: a smaller variance between replicates counts as 0
STANDARDIZED_MOMENTS = 17  # the fourth powers of influences on the fourth moment, and the zeroth


class Sample:
    """One number for each realization, in `pieces`: a function that yields arrays (realization,) from the start at each call.

    `replicate` successive realizations are one replicate, independent of all others; 1 if all realizations are independent.
    """

    def __init__(
        self, pieces: Callable[[], Iterable[np.ndarray]], replicate: int = 1, max_sorted: int = MAX_SORTED_VALUES
    ) -> None:
        self.pieces, self.replicate, self.max_sorted = pieces, replicate, max_sorted

    @classmethod
    def of(cls, x: "np.ndarray | Sample") -> "Sample":
        """Return a sample of an array (realization,), or the sample itself."""
        return x if isinstance(x, Sample) else cls(lambda: [x])

    def __sub__(self, subtrahend: "Sample") -> "Sample":
        return Sample(lambda: (a - b for a, b in zip(self.pieces(), subtrahend.pieces(), strict=True)), self.replicate)

    def map(self, function: Callable[[np.ndarray], np.ndarray]) -> "Sample":
        """Return the sample of an elementwise function of the values."""
        return Sample(lambda: (function(piece) for piece in self.pieces()), self.replicate)

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
    def count(self) -> int:
        return sum(len(piece) for piece in self.pieces())

    @cached_property
    def mean(self) -> float:
        # Summed relative to the first value: the mean of equal numbers equals them to the last bit.
        origin = float(next(piece[0] for piece in self.pieces() if len(piece)))
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
        """Return the order statistics at ranks from 0 (least) to count - 1; NaN if a value is not finite.

        A sample that does not fit into memory is not sorted. Its values are counted by their leading digits instead, and only
        the values with the leading digits of the required ones are sorted.
        """
        if not np.isfinite(self.mean):
            return np.full(len(ranks), np.nan)
        if self.count <= self.max_sorted:
            return self._sorted[list(ranks)]
        # The leading digits of the required keys, and the rank of each key among the values with these leading digits.
        prefixes, inner_ranks, bits = np.zeros(len(ranks), dtype=np.uint64), np.array(ranks, dtype=np.int64), 64
        for _ in range(COUNTED_DIGITS):
            bits -= DIGIT
            unique_prefixes, prefix_numbers = np.unique(prefixes, return_inverse=True)
            for start in range(0, len(unique_prefixes), MAX_PREFIXES):
                counted = unique_prefixes[start : start + MAX_PREFIXES]
                cumulative = self._digit_counts(counted, bits).cumsum(axis=1)
                for k in np.flatnonzero((prefix_numbers >= start) & (prefix_numbers < start + len(counted))):
                    of_prefix = cumulative[prefix_numbers[k] - start]
                    digit = np.searchsorted(of_prefix, inner_ranks[k], side="right")
                    inner_ranks[k] -= of_prefix[digit - 1] if digit else 0
                    prefixes[k] = (prefixes[k] << np.uint64(DIGIT)) | np.uint64(digit)
        keys, counts = self._counted_keys(np.unique(prefixes), bits)
        before = np.searchsorted(keys, prefixes << np.uint64(bits))
        cumulative = counts.cumsum()
        places = np.concatenate([[0], cumulative])[before] + inner_ranks
        return _values(keys[np.searchsorted(cumulative, places, side="right")])

    @cached_property
    def _sorted(self) -> np.ndarray:
        return np.sort(np.concatenate(list(self.pieces())))

    def _digit_counts(self, prefixes: np.ndarray, shift: int) -> np.ndarray:
        """Return the counts (prefix, digit) of each digit after each prefix in the keys shifted by `shift` bits."""
        counts = np.zeros(len(prefixes) << DIGIT, dtype=np.int64)
        for piece in self.pieces():
            keys = _keys(piece) >> np.uint64(shift)
            numbers = np.searchsorted(prefixes, keys >> np.uint64(DIGIT)).clip(max=len(prefixes) - 1)
            matches = prefixes[numbers] == keys >> np.uint64(DIGIT)
            digits = (keys[matches] & np.uint64((1 << DIGIT) - 1)).astype(np.int64)
            counts += np.bincount((numbers[matches] << DIGIT) + digits, minlength=len(counts))
        return counts.reshape(len(prefixes), -1)

    def _counted_keys(self, prefixes: np.ndarray, shift: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the distinct keys, in order, that begin with a prefix (all except `shift` bits), and their counts."""
        found, times = [np.zeros(0, np.uint64)], [np.zeros(0, np.int64)]
        for piece in self.pieces():
            keys = _keys(piece)
            leading = keys >> np.uint64(shift)
            numbers = np.searchsorted(prefixes, leading).clip(max=len(prefixes) - 1)
            different, counts = np.unique(keys[prefixes[numbers] == leading], return_counts=True)
            found.append(different)
            times.append(counts)
        different, numbers = np.unique(np.concatenate(found), return_inverse=True)
        return different, np.bincount(numbers, np.concatenate(times), minlength=len(different)).astype(np.int64)


def measured_sample(rows: xr.Dataset, measure: int, state: str) -> Sample:
    """Return the values of a measure, given by its index, in a state; they are read from the rows when needed.

    Up to MAX_KEPT_VALUES are read once, and kept for the lifetime of the sample.
    """
    column = rows[[terms.MEASURED.name]].sel({terms.STATE: state}).isel({terms.MEASURE: measure})
    is_planned = rows.attrs.get("sampler", terms.MONTE_CARLO) != terms.MONTE_CARLO

    def read() -> Iterator[np.ndarray]:
        return (piece[terms.MEASURED.name].values for piece in pieces(column))

    is_kept = rows.sizes[terms.REALIZATION] <= MAX_KEPT_VALUES
    return Sample(cache(lambda: list(read())) if is_kept else read, terms.REPLICATE if is_planned else 1)


_SIGN = np.uint64(1 << 63)


def _keys(x: np.ndarray) -> np.ndarray:
    """Return unsigned integers in the order of the floating-point numbers `x`."""
    bits = np.ascontiguousarray(x, dtype=float).view(np.uint64)
    return np.where(bits & _SIGN, ~bits, bits | _SIGN)


def _values(keys: np.ndarray) -> np.ndarray:
    """Return the floating-point numbers of some keys."""
    return np.where(keys & _SIGN, keys ^ _SIGN, ~keys).view(float)
