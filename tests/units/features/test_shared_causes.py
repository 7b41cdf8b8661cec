"""Insides of `features` under the claims of `tests/test_shared_causes.py`."""

import numpy as np
import pytest
from scipy import stats

import tolcontact as tc
from tolcontact.features import Freedom
from tolcontact.features.freedoms import LOCATOR


@pytest.mark.parametrize(
    "tolerance",
    [
        tc.Tolerance(0.6, shift=0.1),
        tc.Tolerance(0.6, cp=1.5, cpk=1.2),
        *(tc.Tolerance(0.6, shape) for shape in ("uniform", "triangular", "truncated normal")),
        tc.Tolerance(distribution=stats.gamma(4, scale=0.02)),
    ],
    ids=str,
)
def test_variances_are_those_of_the_quantiles(tolerance):
    contributor = Freedom("block.A1", LOCATOR, tolerance)
    deviations = contributor.deviations((np.arange(1_000_000) + 0.5) / 1_000_000)
    assert contributor.variance == pytest.approx(deviations.var(), rel=1e-4)
