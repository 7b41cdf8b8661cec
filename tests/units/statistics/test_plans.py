"""Insides of `statistics` under the claims of `tests/test_plans.py`."""

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad
from scipy.special import ndtri

from tests.helpers import nightly
from tests.test_plans import LABELS, STRATIFIED
from tolcontact.statistics import intervals
from tolcontact.statistics.intervals import skewness
from tolcontact.statistics.sample import Sample
from tolcontact.variation.plans import planned_numbers
from tolcontact.vocabulary import REPLICATE, SOBOL

MEAN, SECOND = 1 / np.sqrt(2 * np.pi), 0.5
SIGMA = np.sqrt(SECOND - MEAN**2)
CAPPED = [quad(lambda z, k=k: z**k * stats.norm.pdf(z), 0, 1)[0] + stats.norm.sf(1) for k in (1, 2, 3)]  # of min(1, max(0, z))
SKEW = (CAPPED[2] - 3 * CAPPED[0] * CAPPED[1] + 2 * CAPPED[0] ** 3) / (CAPPED[1] - CAPPED[0] ** 2) ** 1.5


def clipped(name, seed, count):
    """max(0, sum of three), whose standard deviation is 1."""
    numbers = planned_numbers(name, LABELS, seed, 0, count)
    return np.maximum(0.0, sum(ndtri(numbers(label)) for label in LABELS) / np.sqrt(3))


@pytest.mark.parametrize("name", STRATIFIED)
@pytest.mark.parametrize("rest", [204, *nightly(60)])
def test_intervals_with_an_incomplete_replicate_cover(name, rest):
    """300 runs: errors over standard errors have Student's t distribution, whose spread is known to 15 % (99.9 %)."""
    truths = {"mean": MEAN, "share": stats.norm.sf(1), "6 sigma": 6 * SIGMA}
    errors = {word: [] for word in truths}
    for seed in range(300):
        # Of a single contributor complete replicates tell nearly all.
        values = np.maximum(0.0, ndtri(planned_numbers(name, LABELS, seed, 0, 16 * REPLICATE + rest)(LABELS[0])))
        x = Sample(lambda values=values: values, REPLICATE)
        share = intervals.proportion(x.map(lambda piece: piece > 1))
        for word, own in zip(truths, (intervals.mean(x), share, intervals.standard_deviation(x, times=6)), strict=True):
            errors[word].append((own.value - truths[word]) / (own.upper - own.lower) * 2 * intervals.student(15))
    for word, of_runs in errors.items():
        assert np.sqrt(np.mean(np.square(of_runs))) == pytest.approx(np.sqrt(15 / 13), rel=0.15), word


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize("name", [STRATIFIED[0], *nightly(*STRATIFIED[1:])])
def test_intervals_of_replicates_cover(name):
    """500 runs of 20 replicates; two standard errors of a coverage of 95 % are 2 %."""
    repeats, hits, widths = 500, dict.fromkeys(("mean", "6 sigma", "share", "95 %", "skewness"), 0), []
    truths = {"mean": MEAN, "6 sigma": 6 * SIGMA, "share": stats.norm.sf(1), "95 %": stats.norm.ppf(0.95), "skewness": SKEW}
    for seed in range(repeats):
        values = clipped(name, seed, 20 * REPLICATE)
        x = Sample(lambda values=values: values, REPLICATE)
        found = {
            "mean": intervals.mean(x),
            "6 sigma": intervals.standard_deviation(x, times=6),
            "share": intervals.proportion(x.map(lambda piece: piece > 1)),
            "95 %": intervals.percentiles(x, [95])[0],
            "skewness": skewness(x.map(lambda piece: np.minimum(piece, 1))),
        }
        for word, (estimate, lower, upper) in found.items():
            assert lower <= estimate <= upper
            hits[word] += lower <= truths[word] <= upper
        plain = intervals.mean(values)
        widths.append((found["mean"].upper - found["mean"].lower) / (plain.upper - plain.lower))
    assert all(0.93 * repeats <= count <= 0.98 * repeats for count in hits.values()), hits
    assert np.median(widths) < 0.6


def test_few_replicates_have_the_intervals_of_independent_realizations():
    x = clipped(SOBOL, 1, 15 * REPLICATE)
    assert intervals.mean(Sample(lambda: x, REPLICATE)) == intervals.mean(x)
    assert intervals.mean(Sample(lambda: x, 1)) == intervals.mean(x)
    nothing = Sample(lambda: np.zeros(20 * REPLICATE, dtype=bool), REPLICATE)
    assert intervals.proportion(nothing) == intervals.proportion_of(0, 20 * REPLICATE)


def test_replicates_that_hit_alike_have_the_interval_of_independent_realizations():
    """Their spread is nothing, which is no reason to be sure: 4096 coins that come up in turns."""
    coins = np.tile([True, False], 2048)
    hits = Sample(lambda: coins, replicate=256)
    assert hits.map(lambda piece: piece.astype(float)).widening == 0
    own = intervals.proportion(hits)
    expected = stats.binomtest(2048, 4096).proportion_ci(0.95, method="exact")
    assert (own.value, own.lower, own.upper) == pytest.approx((0.5, expected.low, expected.high), abs=1e-9)
