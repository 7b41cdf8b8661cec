"""A sample that need not fit into memory: it is read piece by piece, as often as needed."""

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property

import numpy as np
import xarray as xr
from scipy import special

from tolcontact import vocabulary as terms
from tolcontact.realizations import pieces

AT_ONCE = 1 << 18  # values that are sorted in memory
DIGIT = 16  # bits
LEAST_REPLICATES = 16


class Sample:
    """Numbers, one for each realization. `pieces` gives them in arrays, from the first one each time that it is called.

    `together` realizations after each other are a replicate, independent of all others; 1 if each of them is.
    """

    def __init__(self, pieces: Callable[[], Iterable[np.ndarray]], together: int = 1) -> None:
        self.pieces, self.together = pieces, together

    @classmethod
    def of(cls, x: "np.ndarray | Sample") -> "Sample":
        """A sample, whatever it is kept in."""
        return x if isinstance(x, Sample) else cls(lambda: [x])

    def __sub__(self, other: "Sample") -> "Sample":
        return Sample(lambda: (a - b for a, b in zip(self.pieces(), other.pieces(), strict=True)), self.together)

    def map(self, function: Callable[[np.ndarray], np.ndarray]) -> "Sample":
        """What a function of single numbers makes of them."""
        return Sample(lambda: (function(piece) for piece in self.pieces()), self.together)

    @property
    def widening(self) -> float:
        """By how much an interval of the mean for independent realizations is too narrow (1 if they are, less if too wide).

        The root of the design effect (Kish, 1965): the variance of means of replicates, over what it were if realizations were
        independent; with Student's t for that many replicates. Below LEAST replicates 1: their spread is not known well.
        """
        if self.together == 1:
            return 1.0
        replicates = self.count // self.together
        if replicates < LEAST_REPLICATES or not self.moments[0] > 0:
            return 1.0
        sums, place = np.zeros(replicates), 0
        for piece in self.pieces():
            own = (place + np.arange(len(piece))) // self.together
            sums += np.bincount(own, piece - self.mean, minlength=replicates)[:replicates]
            place += len(piece)
        variance = (sums / self.together).var(ddof=1)
        shared = float(special.stdtrit(replicates - 1, 0.975) / special.ndtri(0.975))
        return float(shared * np.sqrt(variance * self.together / self.moments[0]))

    @cached_property
    def count(self) -> int:
        return sum(len(piece) for piece in self.pieces())

    @cached_property
    def mean(self) -> float:
        # From the first value on: equal numbers have themselves as their mean, to the last bit.
        first = float(next(piece[0] for piece in self.pieces() if len(piece)))
        return first + float(sum((piece - first).sum() for piece in self.pieces()) / self.count)

    @cached_property
    def moments(self) -> tuple[float, float]:
        """Second and fourth central moment."""
        sums = np.zeros(2)
        for piece in self.pieces():
            square = (piece - self.mean) ** 2
            sums += square.sum(), (square**2).sum()
        return float(sums[0] / self.count), float(sums[1] / self.count)

    def ordered(self, ranks: Sequence[int]) -> np.ndarray:
        """The values of some ranks: 0 is the least, count - 1 the largest. NaN if one of the numbers is not finite.

        What does not fit into memory is not sorted: digit by digit, the numbers are counted by the digits that they begin with.
        """
        if not np.isfinite(self.mean):
            return np.full(len(ranks), np.nan)
        if self.count <= AT_ONCE:
            return np.asarray(np.sort(np.concatenate(list(self.pieces())))[list(ranks)])
        rest, found = np.array(ranks, dtype=np.int64), np.zeros(len(ranks), dtype=np.uint64)
        for shift in range(64 - DIGIT, -1, -DIGIT):
            beginnings, own = np.unique(found, return_inverse=True)
            counts = np.zeros(len(beginnings) << DIGIT, dtype=np.int64)
            for piece in self.pieces():
                keys = _keys(piece) >> np.uint64(shift)
                place = np.searchsorted(beginnings, keys >> np.uint64(DIGIT)).clip(max=len(beginnings) - 1)
                ours = beginnings[place] == keys >> np.uint64(DIGIT)
                digits = (keys[ours] & np.uint64((1 << DIGIT) - 1)).astype(np.int64)
                counts += np.bincount((place[ours] << DIGIT) + digits, minlength=len(counts))
            ends = counts.reshape(len(beginnings), -1).cumsum(axis=1)
            for k, begins in enumerate(own):
                digit = np.searchsorted(ends[begins], rest[k], side="right")
                rest[k] -= ends[begins, digit - 1] if digit else 0
                found[k] = (found[k] << np.uint64(DIGIT)) | np.uint64(digit)
        return _values(found)


def measured_sample(rows: xr.Dataset, measure: int, state: str) -> Sample:
    """The values of a measure, by number, in a state; read from the rows of an archive as often as needed."""
    of = rows[[terms.MEASURED.name]].sel({terms.STATE: state}).isel({terms.MEASURE: measure})
    is_planned = rows.attrs.get("sampler", terms.MONTE_CARLO) != terms.MONTE_CARLO
    return Sample(
        lambda: (np.asarray(piece[terms.MEASURED.name].values) for piece in pieces(of)), terms.REPLICATE if is_planned else 1
    )


_SIGN = np.uint64(1 << 63)


def _keys(x: np.ndarray) -> np.ndarray:
    """Whole numbers in the order of the floating-point numbers `x`."""
    bits = np.ascontiguousarray(x, dtype=float).view(np.uint64)
    return np.where(bits & _SIGN, ~bits, bits | _SIGN)


def _values(keys: np.ndarray) -> np.ndarray:
    return np.asarray(np.where(keys & _SIGN, keys ^ _SIGN, ~keys).view(float))
