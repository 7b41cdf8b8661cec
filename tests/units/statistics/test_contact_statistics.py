"""Insides of `statistics` under the claims of `tests/test_contact_statistics.py`."""

from collections import Counter

import numpy as np
import pytest
import xarray as xr

from tolcontact.statistics.contact import combinations


@pytest.mark.parametrize("pairs", [1, 9, 64, 65])
def test_combinations_of_pairs_are_counted(pairs):
    names = [f"pair {k}" for k in range(pairs)]
    masks = np.random.default_rng(pairs).random((6, pairs)) < 0.3
    carrying = np.repeat(masks, [1, 2, 3, 4, 5, 6], axis=0).astype(np.int16)
    found = combinations(xr.Dataset({"carrying": (("realization", "pair"), carrying)}, {"pair": names}))
    expected = Counter(tuple(np.array(names)[row].tolist()) for row in carrying > 0)
    assert Counter(dict(found)) == expected
