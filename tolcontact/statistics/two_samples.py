"""How two samples differ, with a 95 % interval: samples of the same realizations (paired), or of different ones.

Realization k of both samples is one pair. Pairs are independent of each other whether or not the two of a pair are, so paired
intervals hold for any two runs of equally many realizations; same draws make them narrow.
"""

import math

import numpy as np
from scipy import special

from tolcontact.statistics import intervals
from tolcontact.statistics.intervals import NOTHING, Estimate
from tolcontact.statistics.sample import Sample

_Z = float(special.ndtri(0.5 + intervals.CONFIDENCE / 2))


def shift(after: Sample, before: Sample, *, paired: bool) -> Estimate:
    """Difference of the means: Student's t of the differences; Welch's of different realizations."""
    if paired:
        return intervals.mean(after - before)
    own = [x.moments[0] / (x.count - 1) for x in (after, before)]
    difference, total = after.mean - before.mean, sum(own)
    if not total > 0:
        return Estimate(difference, difference, difference) if math.isfinite(difference) else NOTHING
    freedom = total**2 / sum(each**2 / (x.count - 1) for each, x in zip(own, (after, before), strict=True))
    half = intervals.student(freedom) * math.sqrt(total)
    return Estimate(difference, difference - half, difference + half)


def variance_ratio(after: Sample, before: Sample, *, paired: bool) -> Estimate:
    """Ratio of the variances, on the log scale; of different realizations with Bonett's standard errors of both."""
    if paired:
        return intervals.variance_ratio(after, before)
    if intervals.is_constant(after) or intervals.is_constant(before):
        return NOTHING
    own = [intervals.variance(x) for x in (after, before)]
    # The intervals of both, on the log scale, are at equal distances from their middles.
    halves = [math.log(each.upper / each.lower) / 2 for each in own]
    ratio, factor = own[0].value / own[1].value, math.exp(math.hypot(*halves))
    return Estimate(ratio, ratio / factor, ratio * factor)


def share_shift(after: Sample, before: Sample, *, paired: bool) -> Estimate:
    """Difference of two shares, of samples of booleans.

    Agresti and Min (2005) if they are of the same realizations, Agresti and Caffo (2000) if not: Wald's interval after half a
    realization more of each kind of pair, or a hit and a miss more in either sample.
    """
    if paired:
        n = after.count
        pairs = [(int((a & ~b).sum()), int((b & ~a).sum())) for a, b in zip(after.pieces(), before.pieces(), strict=True)]
        more, fewer = (sum(each) for each in zip(*pairs, strict=True))
        middle, change = (more - fewer) / (n + 2), more + fewer + 1
        error = math.sqrt(max(change / (n + 2) - middle**2, 0) / (n + 2))
        return _bounded((more - fewer) / n, middle, error)
    hits = [sum(int(piece.sum()) for piece in x.pieces()) for x in (after, before)]
    counts = [after.count, before.count]
    near = [(k + 1) / (n + 2) for k, n in zip(hits, counts, strict=True)]
    error = math.sqrt(sum(p * (1 - p) / (n + 2) for p, n in zip(near, counts, strict=True)))
    return _bounded(hits[0] / counts[0] - hits[1] / counts[1], near[0] - near[1], error)


def _bounded(estimate: float, middle: float, error: float) -> Estimate:
    lower, upper = np.clip([middle - _Z * error, middle + _Z * error], -1, 1)
    return Estimate(estimate, min(float(lower), estimate), max(float(upper), estimate))
