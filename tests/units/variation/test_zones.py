"""Insides of `variation` under the claims of `tests/test_zones.py`."""

import numpy as np
import pytest
from scipy.stats import binom

from tolcontact.variation.zones import MemberZone, equal_spread, share_inside


def zone_with(rows):
    """The zone of one feature, whose coordinates are its components."""
    return [MemberZone(rows, np.eye(rows.shape[2]))]


@pytest.mark.slow
def test_the_share_inside_is_that_of_draws():
    rng = np.random.default_rng(0)
    for entries, components in ((1, 3), (2, 4), (3, 3), (1, 6)):
        rows, sds = rng.normal(size=(7, entries, components)), rng.uniform(0.02, 0.1, size=components)
        width = equal_spread(zone_with(rows), sds[:0], components, 1.0) and 1.0
        drawn = rng.normal(size=(400_000, components)) * sds
        inside = (np.linalg.norm(np.einsum("pec,nc->npe", rows, drawn), axis=2).max(axis=1) <= width / 2).sum()
        low, high = binom.interval(0.9999, len(drawn), share_inside(zone_with(rows), sds, width))
        assert low - 40 <= inside <= high + 40  # the directions' own error: 1e-4


def test_spreads_are_in_proportion_to_the_width_down_to_a_nanometre():
    rows = np.random.default_rng(1).normal(size=(7, 2, 3))
    inner, factor = np.array([0.05]), equal_spread(zone_with(rows), np.array([0.05]), 2, 1.0)
    for width in (1e3, 1e-3, 1e-6):
        assert equal_spread(zone_with(rows), inner * width, 2, width) == pytest.approx(factor * width, rel=1e-6)


def test_a_feature_that_does_not_vary_is_inside_its_zone():
    rows = np.random.default_rng(1).normal(size=(7, 2, 3))
    assert share_inside(zone_with(rows), np.zeros(3), 1e-3) == 1.0
    assert share_inside(zone_with(rows[:0]), np.ones(3), 1e-3) == 1.0  # nor does one without points, whatever its components do
