"""Insides of `statistics` under the claims of `tests/test_comparing_runs.py`."""

import numpy as np
import pytest
from scipy import stats

from tests.helpers import nightly
from tests.units.statistics.test_plans import clipped
from tolcontact.statistics import intervals
from tolcontact.statistics.sample import Sample
from tolcontact.vocabulary import LATIN_HYPERCUBE, MONTE_CARLO, REPLICATE, SOBOL


def hits(generator, p, n):
    return generator.random(n) < p


DIFFERENCES = {  # samples of 80 realizations, and the true difference or ratio
    "shift": (intervals.shift, lambda g: (g.exponential(2, 80), g.normal(1, 1, 80)), 1.0),
    "ratio": (intervals.variance_ratio, lambda g: (g.normal(0, 2, 80), g.uniform(-1, 1, 80)), 12.0),
    "share": (intervals.share_shift, lambda g: (hits(g, 0.3, 80), hits(g, 0.1, 80)), 0.2),
}


@pytest.mark.parametrize("name", DIFFERENCES)
def test_intervals_of_independent_samples_cover(name):
    """500 repeats: 95 % is covered in 465 to 487 of them with 98 % probability; shares are a little conservative."""
    function, draw, truth = DIFFERENCES[name]
    generator, inside = np.random.default_rng(5), 0
    for _ in range(500):
        after, before = (Sample.of(x) for x in draw(generator))
        estimate = function(after, before, paired=False)
        inside += estimate.lower <= truth <= estimate.upper
    assert 463 <= inside <= 490


def test_the_interval_of_a_few_changes_covers():
    """Of 300 realizations 2 leave the limits on average, and none returns: without changes the difference may still be 1 %."""
    covered = 0
    for gained in np.random.default_rng(1).binomial(300, 2 / 300, 500):
        estimate = intervals.share_shift(Sample.of(np.arange(300) < gained), Sample.of(np.zeros(300, bool)), paired=True)
        covered += estimate.lower <= 2 / 300 <= estimate.upper
    assert covered >= 0.95 * 500


def test_intervals_of_paired_shares_cover():
    generator, inside = np.random.default_rng(6), 0
    for _ in range(500):
        u = generator.random(100)
        estimate = intervals.share_shift(Sample.of(u < 0.3), Sample.of((u > 0.05) & (u < 0.2)), paired=True)
        inside += estimate.lower <= 0.15 <= estimate.upper
    assert 463 <= inside <= 492


def planned(name, seed, shift=0.0, replicates=20):
    """A run by a sampling plan: max(0, x) of standard normal x that is the sum of three, and a shift."""
    values = clipped(name, seed, replicates * REPLICATE) + shift
    return Sample(lambda: values, 1 if name == MONTE_CARLO else REPLICATE)


@pytest.mark.parametrize(
    ("plan", "reference_plan", "paired"),
    [
        (SOBOL, SOBOL, False),
        *nightly((LATIN_HYPERCUBE, LATIN_HYPERCUBE, False), (MONTE_CARLO, SOBOL, False), (SOBOL, SOBOL, True)),
    ],
)
def test_intervals_of_changes_between_planned_runs_cover(plan, reference_plan, paired):
    """300 repeats: 95 % is covered in 276 to 295 of them with 99 % probability. Shares are of max(0, x) > 1, and > 0.8."""
    hits, narrowest, repeats = dict.fromkeys(("shift", "ratio", "share"), 0), [], 300
    truths = {"shift": 0.2, "ratio": 1.0, "share": stats.norm.sf(0.8) - stats.norm.sf(1)}
    for k in range(repeats):
        after, before = planned(plan, 2 * k, 0.2), planned(reference_plan, 2 * k + 1)
        shares = [x.map(lambda piece: piece > 1) for x in (after, before)]
        found = {
            "shift": intervals.shift(after, before, paired=paired),
            "ratio": intervals.variance_ratio(after, before, paired=paired),
            "share": intervals.share_shift(*shares, paired=paired),
        }
        for name, (_, lower, upper) in found.items():
            hits[name] += lower <= truths[name] <= upper
        independent = intervals.shift(*(Sample.of(x.values) for x in (after, before)), paired=False)
        narrowest.append(np.ptp(found["shift"]) / np.ptp(independent))
    assert all(276 <= count <= 296 for count in hits.values()), hits
    assert np.median(narrowest) < (0.9 if plan == MONTE_CARLO else 0.6)
