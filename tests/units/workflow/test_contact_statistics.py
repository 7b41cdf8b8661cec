"""Insides of `workflow` under the claims of `tests/test_contact_statistics.py`."""

import numpy as np

import tolcontact as tc
from tests import cases
from tolcontact.workflow.run_sums import MAX_COUNTED


def test_a_block_touches_in_half_of_the_realizations_at_all_its_points():
    results = tc.run(cases.one_dimensional(0), samples=4000, seed=1, solver="daqp", surfaces=0)
    _, lower, upper = results.tolcontact.summary().carried.sel(pair="seat").values
    assert lower < 0.5 < upper and upper - lower < 0.04
    found = results.tolcontact.touching()
    share = (results["status"].values[:MAX_COUNTED] == tc.Status.RESOLVED).mean()
    assert found.attrs["realizations"] == MAX_COUNTED and (found["pair"] == "seat").all()
    assert np.abs(found["touching"].sel(interval="estimate") - share).max() < 1e-12
    archived = results["contact"]  # for whoever reads an archive without tolcontact
    assert np.array_equal(archived["touching"], found["touching"].sel(interval="estimate"))
    assert np.array_equal(archived["touching_interval"], found["touching"].sel(interval=["lower", "upper"]))
    assert int(archived["touching_realizations"]) == MAX_COUNTED and archived["touching"].dims == ("point",)
