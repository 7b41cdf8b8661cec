"""Capability of a measure: shares beyond its limits and their verdict; Pp and Ppk, by percentiles and as if normal.

Contact truncates and skews distributions, so the figures by percentiles (the general method of ISO 22514-2) come first: half of
the values lie below X50, and 99.73 % between X0.135 and X99.865.

    Pp  = (U - L) / (X99.865 - X0.135)
    Ppk = min((U - X50) / (X99.865 - X50), (X50 - L) / (X50 - X0.135))

With one limit, Ppk comes from its side, and there is no Pp. For a normal distribution, X50 is the mean, and the differences are
3 and 6 standard deviations.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from tolcontact.limits import Limits
from tolcontact.statistics import intervals
from tolcontact.statistics.intervals import (
    CONFIDENCE,
    MIN_SHAPE,
    MIN_SKEW,
    UNDEFINED,
    Estimate,
    binomial_quantile,
    hypotenuse,
    is_constant,
    percentiles,
    proportion,
    proportion_of,
    standard_deviation,
)
from tolcontact.statistics.sample import Sample

PERCENTS = 0.135, 50.0, 99.865
MIN_AT_STOP = 2  # values at a limit that is a stop
MIN_TAIL, MIN_TAILS = 2730, 3240  # realizations that bound a tail of 0.135 %; that bound both
MAX_KURTOSIS = 10.0  # of a sample in which the errors of mean and standard deviation may cancel
TRIALS = 1 << 11  # simulated triples of percentiles; an interval covers 95 % of them
ALLOWED_SHARE = 0.0027  # share of a normal distribution beyond three standard deviations: Ppk 1 on both sides
MEETS, FAILS, UNDECIDED, CONSTANT = "meets", "does not meet", "undecided", "does not vary"
LIKELY_DISTANCE = 0.6745  # of a share from the allowed one, in standard errors, if the two seem equal: the median
GROWTH = 1.25  # of the number of realizations between two trials
KEPT = "kept by contact"
VERDICT_RULE = (
    f'"{MEETS}": the 95 % interval of the share out of specification, with contact, lies at or below {ALLOWED_SHARE:.2%} '
    "(for each measurement alone; a one-sided test with an error of 2.5%); "
    f'"{FAILS}": it lies above; "{UNDECIDED}": it contains {ALLOWED_SHARE:.2%}; '
    f'"{CONSTANT}": all values are equal, with and without contact, and within the limits; '
    f'"{KEPT}": the limit is a stop, and no value is beyond it with contact'.replace("%", " %")
).replace("95  %", "95 %")


def share_outside(x: Sample, limits: Limits, missing: int = 0, *, counts_missing: bool = True) -> Estimate:
    """Return the share out of specification, with its exact interval; undefined without limits.

    These are values beyond the limits and, if `counts_missing`, the `missing` values of realizations that cannot be assembled:
    such a product is a nonconforming one.
    """
    return UNDEFINED if limits.are_open else proportion(x.map(limits.outside).followed_by(missing * [counts_missing]))


def without_stops(x: Sample, limits: Limits) -> Limits:
    """Return the limits without stops. At a stop no value lies beyond, and at least two values are kept at the limit itself.

    The index of such a limit would depend on how many values are there alone: it is 1, for any values in between, if these are
    more than 0.135 %.
    """
    settled = limits.settled(x.values)
    if _are_kept(x, settled == limits.lower) and not limits.below(x.values).any():
        limits = limits._replace(lower=-math.inf)
    if _are_kept(x, settled == limits.upper) and not limits.above(x.values).any():
        limits = limits._replace(upper=math.inf)
    return limits


def _are_kept(x: Sample, equal: np.ndarray) -> bool:
    """Return whether values that are `equal` (realization,) are kept where they are: contact moved two of them there.

    Otherwise the other values decide. Two equal values have probability 0 where these are distinct; where these are repeated,
    as those of a measured population are, equal values are no stop.
    """
    if equal.sum() < MIN_AT_STOP:
        return False
    if x.cause is not None and (np.abs(x.values - x.cause.values)[equal] > x.accuracy).sum() >= MIN_AT_STOP:
        return True
    others = np.sort(x.values[~equal])
    repeats = np.diff(np.flatnonzero(np.diff(others, prepend=-math.inf, append=math.inf) > x.accuracy))
    return not len(repeats) or bool(np.median(repeats) == 1)


def by_percentiles(x: Sample, limits: Limits) -> tuple[Estimate, Estimate]:
    """Return Pp and Ppk by percentiles; sides at which values stop are left out (see without_stops).

    The numbers of values below the three percentiles are multinomial for any distribution. Each percentile lies between the
    two order statistics next to its simulated number. The interval uses the conservative one, and leaves out 2.5 % of the
    simulated indices on either side. A sample that is too small to bound a tail has no interval, unless surely more than
    0.135 % lie outside of the limits: then the lower bound is 0. If only samples with a value outside had an interval, it would
    rest on the extreme ones.
    """
    if is_constant(x, limits.accuracy) or not np.isfinite(x.mean):
        return UNDEFINED, UNDEFINED
    limits, x = without_stops(x, limits), x.map(limits.settled)
    low, median, high = (percentile.value for percentile in percentiles(x, PERCENTS))
    lows, highs = _simulated_percentiles(x)
    pp, ppk = UNDEFINED, UNDEFINED
    if np.isfinite(limits.lower) and np.isfinite(limits.upper):
        worst, best = _pp(lows[0], highs[2], limits), _pp(highs[0], lows[2], limits)
        pp = _with_interval(_pp(low, high, limits), worst, [best])
    if not limits.are_open:
        # Sides that are equally near must not bias their minimum: its upper bound is the least of all upper bounds.
        worst = np.stack([_sides(lows[0], middle, highs[2], limits) for middle in (lows[1], highs[1])])
        best = np.stack([_sides(highs[0], middle, lows[2], limits) for middle in (lows[1], highs[1])])
        best_sides = list(np.fmax.reduce(best, axis=0))
        ppk = _with_interval(np.min(_sides(low, median, high, limits)), np.fmin.reduce(worst, axis=(0, 1)), best_sides)
    if proportion(x.map(limits.outside)).lower > PERCENTS[0] / 100:
        return pp, ppk
    return _bounded(pp), _bounded(ppk)


def _bounded(index: Estimate) -> Estimate:
    """Return an index, without its interval if the lower bound says nothing."""
    return index if index.lower > 0 else Estimate(index.value, math.nan, math.nan)


def as_normal(x: Sample, limits: Limits) -> tuple[Estimate, Estimate]:
    """Return Pp and Ppk from mean and standard deviation; their intervals do not assume a normal distribution."""
    if is_constant(x, limits.accuracy) or not np.isfinite(x.mean):
        return UNDEFINED, UNDEFINED
    lower, upper, _ = without_stops(x, limits)
    spread, pp = standard_deviation(x, times=6), UNDEFINED
    if np.isfinite(lower) and np.isfinite(upper):
        pp = Estimate(*((upper - lower) / width for width in (spread.value, spread.upper, spread.lower)))
    sides = [_side(x, spread, limit, sign) for limit, sign in ((upper, 1.0), (lower, -1.0)) if np.isfinite(limit)]
    return pp, min(sides, key=lambda side: side.value) if sides else UNDEFINED


def _side(x: Sample, spread: Estimate, limit: float, sign: float) -> Estimate:
    """Return the index of one side for a normal distribution; `sign` is 1 for the upper limit, -1 for the lower.

    The distances of its bounds add up from the mean and the `spread` 6 sigma, like errors. Their correlation
    follows from skewness and kurtosis. Small samples and heavy tails use it only where it widens the interval, since few skewed
    values do not prove that two errors cancel.
    """
    reach = sign * (limit - x.mean)
    index, (skew, kurt) = 2 * reach / spread.value, x.standardized_moments[3:5].tolist()
    by_mean = sorted(2 * sign * (limit - bound) / spread.value for bound in intervals.mean(x)[1:])
    by_spread = sorted(2 * reach / width for width in spread[1:])
    correlation = sign * float(np.sign(reach)) * skew / math.sqrt(max(kurt - 1, MIN_SKEW))
    if x.count < MIN_SHAPE or kurt > MAX_KURTOSIS:
        correlation = max(correlation, 0.0)
    distances = np.transpose([by_mean, by_spread]) - index
    below, above = (hypotenuse(of_mean, of_spread, correlation) for of_mean, of_spread in distances.tolist())
    return Estimate(index, index - below, index + above)


def _pp(low: np.ndarray | float, high: np.ndarray | float, limits: Limits) -> np.ndarray:
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.divide(limits.upper - limits.lower, _width(low, high, limits))


def _sides(low: np.ndarray | float, median: np.ndarray | float, high: np.ndarray | float, limits: Limits) -> list[np.ndarray]:
    """Return the index of each side that has a limit."""
    with np.errstate(divide="ignore", invalid="ignore"):
        below = np.divide(np.subtract(median, limits.lower), _width(low, median, limits))
        above = np.divide(np.subtract(limits.upper, median), _width(median, high, limits))
    return [index for limit, index in ((limits.lower, below), (limits.upper, above)) if np.isfinite(limit)]


def _width(low: np.ndarray | float, high: np.ndarray | float, limits: Limits) -> np.ndarray:
    """Return widths; a width within the accuracy, as between values at a stop, is 0."""
    width = np.subtract(high, low)
    return np.where(width > limits.accuracy, width, 0.0)


def _with_interval(estimate: np.ndarray, worst: np.ndarray, best: Sequence[np.ndarray]) -> Estimate:
    """Return an estimate with the interval that covers 95 % of simulated indices, given their worst and best values."""
    low = np.quantile(np.where(np.isnan(worst), 0.0, worst), 0.5 - CONFIDENCE / 2, method="inverted_cdf")
    bests = [np.where(np.isnan(of_side), np.inf, of_side) for of_side in best]
    high = min(np.quantile(of_side, 0.5 + CONFIDENCE / 2, method="inverted_cdf") for of_side in bests)
    return Estimate(float(estimate), float(min(low, estimate)), float(max(high, estimate)))


def _simulated_percentiles(x: Sample) -> tuple[np.ndarray, np.ndarray]:
    """Return order statistics at or below, and at or above, simulated percentiles of the distribution, (percentile, trial)."""
    numbers = values_below(x.count)
    ranks, places = np.unique(np.stack([numbers, numbers + 1]), return_inverse=True)
    is_within = (ranks >= 1) & (ranks <= x.count)
    values = np.where(ranks < 1, -np.inf, np.inf)
    values[is_within] = x.ordered((ranks[is_within] - 1).tolist())
    lows, highs = values[places.reshape(2, *numbers.shape)]
    return lows, highs


@lru_cache
def values_below(n: int) -> np.ndarray:
    """Return simulated numbers of the values below the percentiles, among `n` values, (percentile, trial)."""
    # A Latin hypercube; that of scipy.stats takes longer to import than a summary.
    u = np.random.default_rng(0).permuted(np.tile((np.arange(TRIALS) + 0.5) / TRIALS, (len(PERCENTS), 1)), axis=1)
    p = np.array(PERCENTS) / 100
    below_low = binomial_quantile(u[0], np.full(TRIALS, n), p[0])
    below_median = below_low + binomial_quantile(u[1], n - below_low, (p[1] - p[0]) / (1 - p[0]))
    below_high = below_median + binomial_quantile(u[2], n - below_median, (p[2] - p[1]) / (1 - p[1]))
    return np.array([below_low, below_median, below_high])


class Verdict(NamedTuple):
    """The verdict on a measurement.

    word   one of MEETS, FAILS, UNDECIDED, CONSTANT
    more   number of additional realizations that would probably decide; 0 if it is decided, infinite if only parts would
    """

    word: str
    more: float = 0.0


def verdict(share: np.ndarray, realizations: int, *, varies: bool = True, open_by_parts: bool = False) -> Verdict | None:
    """Return the verdict on a share (estimate, lower, upper) out of specification; None for a share that is not a number.

    A measure that does not vary needs no further realizations: it is CONSTANT if none is out of specification. None decide a
    share that few measured parts leave open.
    """
    estimate, lower, upper = (float(value) for value in share)
    if not all(map(math.isfinite, (estimate, lower, upper))):
        return None
    word = _word(lower, upper) if varies or estimate > 0 else CONSTANT
    if word != UNDECIDED:
        return Verdict(word)
    return Verdict(word, math.inf if open_by_parts else _more(estimate, realizations))


def _word(lower: float, upper: float) -> str:
    return MEETS if upper <= ALLOWED_SHARE else FAILS if lower > ALLOWED_SHARE else UNDECIDED


def _more(estimate: float, realizations: int) -> float:
    """Return the number of additional independent realizations that would decide if the estimate did not change.

    By chance an estimate may come so near to the allowed share that millions would be needed. It counts as no nearer than the
    two are in half of such cases, so that the number settles.
    """
    distance = LIKELY_DISTANCE * math.sqrt(ALLOWED_SHARE / realizations)
    if abs(estimate - ALLOWED_SHARE) < distance:
        estimate = max(ALLOWED_SHARE + math.copysign(distance, estimate - ALLOWED_SHARE), 0.0)
    count = GROWTH * realizations
    while _word(*proportion_of(estimate * count, count)[1:]) == UNDECIDED:
        count *= GROWTH
    return math.ceil(count - realizations)
