"""Analyses of measures of any station: shares, slopes and extremes that are known in closed form."""

import numpy as np
import pytest

import tolcontact as tc
from tests.cases import stations as cases

# The height of the third part, less that of the end of the rail: by the causes of both stations.
SLOPES = {"za": -1 / 14, "zb": 1 / 14, "p1": 1 / 14, "p2": -15 / 14, "zc": 1.0}


def test_contributors_of_earlier_stations_count():
    line = cases.rail()
    found = tc.analyses.contributions(line, samples=128, solver="daqp").sel(measure="flush")
    shares = dict(zip(found.group.values, found["linear"].values, strict=True))
    total = sum(slope**2 for slope in SLOPES.values())
    assert {name: shares[name] for name in SLOPES} == pytest.approx({k: s**2 / total for k, s in SLOPES.items()}, abs=1e-9)
    nominal = tc.analyses.sensitivities(line, samples=64, solver="daqp").sel(measure="flush")["nominal"]
    assert {name: float(nominal.sel(contributor=name)) for name in SLOPES} == pytest.approx(SLOPES, abs=1e-7)


def test_the_worst_case_goes_through_both_stations():
    bound = tc.analyses.worst_case(cases.rail(), samples=64, solver="daqp")["bound"].sel(measure="flush", state="raw").values
    assert bound == pytest.approx(np.array([-1, 1]) * 3 * cases.SIGMA * sum(map(abs, SLOPES.values())), rel=1e-6)
