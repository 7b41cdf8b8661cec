"""Roots between two places: SciPy's, by the same places on the way."""

import numpy as np
import pytest
from scipy.optimize import brentq

from tolcontact.variation.bracketed_root import bracketed_root


@pytest.mark.parametrize("tolerance", [1e-3, 1e-9, 1e-12])
def test_a_bracketed_root_is_that_of_scipy(tolerance):
    rng = np.random.default_rng(1)
    for steep, place, wave in rng.uniform([0.2, -0.9, 0.0], [20.0, 0.9, 0.3], size=(50, 3)):
        places, expected_places = [], []

        def recorded(x, visited, steep=steep, place=place, wave=wave):
            visited.append(x)
            return float(np.tanh(steep * (x - place)) + wave * np.sin(3 * (x - place)))

        root = bracketed_root(lambda x, visit=recorded, to=places: visit(x, to), -2.0, 3.0, tolerance)
        assert root == brentq(lambda x, visit=recorded, to=expected_places: visit(x, to), -2.0, 3.0, xtol=tolerance)
        assert places == expected_places


def test_a_root_at_an_end_and_none_at_all():
    assert bracketed_root(lambda x: x - 1, 1, 3, 1e-9) == 1
    assert bracketed_root(lambda x: x - 3, 1, 3, 1e-9) == 3
    with pytest.raises(ValueError, match="expected opposite signs"):
        bracketed_root(lambda x: x, 1, 3, 1e-9)
