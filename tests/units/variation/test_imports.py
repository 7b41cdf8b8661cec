"""Insides of `variation` under the claims of `tests/test_imports.py`."""

import numpy as np
import pytest
from scipy.stats import qmc

from tolcontact.variation.plans import MAX_DIMENSIONS, scrambled_points


@pytest.mark.parametrize("seed", [0, 5])
@pytest.mark.parametrize("dimensions", [1, 3, MAX_DIMENSIONS])
@pytest.mark.parametrize("count", [1, 2, 1000, 2048])
def test_scrambled_points_are_those_of_scipy(seed, dimensions, count):
    expected = qmc.Sobol(dimensions, rng=np.random.default_rng(seed)).random(2048)[:count]
    np.testing.assert_array_equal(scrambled_points(count, dimensions, np.random.default_rng(seed).spawn(1)[0]), expected)
