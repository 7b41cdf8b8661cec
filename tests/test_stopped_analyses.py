"""Analyses that are stopped, or whose time ends: the answer so far is left, says so, and is right within its own accuracy."""

import signal
import sys
import time

import numpy as np
import pytest
import xarray as xr
from scipy import stats

import tolcontact as tc
from tests import cases
from tests.helpers import PAPER, call, finish, posix_only, start

OPTIONS = {"solver": "daqp", "method": PAPER}
LIMIT = 1.0


def block():
    """A block on a block, whose corrected height is max(0, g), g ~ N(0, 1), above nominal."""
    a = cases.one_dimensional(0)
    a.measure("kept", a.parts[1].point(5, 5, 10), along="z", limits=(None, LIMIT))
    return a


def stopped(analysis, *arguments, after, **options):
    """The answer of an analysis that is interrupted once this number of realizations is exceeded."""

    def progress(done, _):
        if done > after:
            raise KeyboardInterrupt

    with pytest.raises(tc.analyses.Stopped) as stop:
        analysis(*arguments, progress=progress, **OPTIONS, **options)
    assert stop.value.dataset.attrs["coarse"].startswith("stopped: ")
    return stop.value.dataset


def test_stopped_sensitivities_are_those_of_fewer_realizations():
    found = stopped(tc.analyses.sensitivities, block(), samples=20_000, after=9000)
    count = found.attrs["realizations"]
    assert 1000 <= count < 20_000 and f"{count} of 20000" in found.attrs["coarse"]
    fewer = tc.analyses.sensitivities(block(), samples=count, **OPTIONS)
    for name in ("sensitivity", "spread", "changing", "by_contact"):
        assert np.allclose(found[name], fewer[name], atol=1e-9, equal_nan=True), name
    _, lower, upper = found["sensitivity"].sel(measure="height", state="corrected").values[0]
    assert lower < 0.5 < upper  # contact follows in half of the realizations


def test_the_first_answers_need_no_realizations():
    found = tc.analyses.sensitivities(block(), samples=5000, minutes=1e-9, **OPTIONS)
    assert found.attrs["realizations"] == 0 and found.nominal.values[0, 0] == pytest.approx(1)
    assert "minutes have passed: nominal derivatives" in found.attrs["coarse"] and np.isnan(found["sensitivity"]).all()
    found = tc.analyses.contributions(cases.ra1(), samples=5000, minutes=1e-9, **OPTIONS)
    assert np.isnan(found.total).all() and found.linear.sum("group").values == pytest.approx(1)
    with pytest.raises(tc.OptionError, match="minutes is 0; expected a positive number"):
        tc.analyses.tails(block(), minutes=0)


def test_stopped_contributions_are_those_of_fewer_realizations():
    found = stopped(tc.analyses.contributions, cases.ra1(), samples=20_000, after=15_000)
    count = found.attrs["base_realizations"]
    fewer = tc.analyses.contributions(cases.ra1(), samples=count, **OPTIONS)
    assert 100 < count < 20_000 and np.allclose(found.total, fewer.total, atol=1e-9) and np.allclose(found.first, fewer.first)


def test_stopped_tails_are_counted():
    found = stopped(tc.analyses.tails, block(), after=1500)
    _, lower, upper = found.probability.values[0]
    assert lower < stats.norm.sf(LIMIT) < upper < 2 * lower and "counted among 1500 realizations" in found.attrs["coarse"]
    assert int(found.simulated[0]) == 1500


def test_a_stopped_worst_case_is_the_worst_so_far_and_lies_within_the_bound():
    whole = tc.analyses.worst_case(cases.ra1(), samples=256, **OPTIONS).isel(measure=0)
    found = stopped(tc.analyses.worst_case, cases.ra1(), samples=256, after=600).isel(measure=0)
    senses = np.array([-1, 1])
    assert (senses * (whole.worst - found.worst) >= -1e-9).all() and (senses * (found.worst - found.random) >= -1e-9).all()
    assert "have not ended" in found.attrs["coarse"] and found.bound.equals(whole.bound)
    again = tc.build(cases.ra1(), **OPTIONS)
    assert np.allclose(tc.analyses.worst_case(again, samples=256).isel(measure=0).worst, whole.worst, atol=1e-6)


@pytest.mark.slow
def test_a_stopped_allocation_states_what_present_tolerances_keep():
    found = stopped(tc.analyses.allocate, block(), "kept: ppm 100000", samples=8192, after=8192)
    _, lower, upper = found.kept.sel(stage="before").values[0]
    assert lower < stats.norm.sf(LIMIT) < upper and found.met.values.tolist() == [0] and (found.factor == 1).all()
    assert "present tolerances" in found.attrs["coarse"]


def test_a_complete_answer_replaces_a_coarse_one_in_an_archive_and_is_not_replaced(tmp_path):
    path = tmp_path / "block.nc"
    tc.run(block(), samples=50, seed=1, out=path, **OPTIONS)
    options = {"samples": 300, "into": path, **OPTIONS}
    tc.analyses.sensitivities(path, minutes=1e-9, **options)
    coarse = xr.load_dataset(path, group="statistics/sensitivities")
    assert (
        "coarse" in coarse.attrs
        and "COARSE" in call(tmp_path, "report", path.name).stdout + (tmp_path / "block.html").read_text()
    )
    tc.analyses.sensitivities(path, **options)
    whole = xr.load_dataset(path, group="statistics/sensitivities")
    assert "coarse" not in whole.attrs and np.isfinite(whole["sensitivity"]).all()
    with pytest.raises(tc.errors.ArchiveError, match="already has statistics/sensitivities"):
        tc.analyses.sensitivities(path, **options)


@posix_only
def test_ctrl_c_prints_the_answer_so_far(tmp_path):
    command = [sys.executable, "-m", "tolcontact", "contributions", cases.MODELS / "ra1.py", "--samples", "2000000"]
    process = start(command, cwd=tmp_path)
    while "so far: " not in (line := process.stderr.readline()):
        assert line, "it has ended"
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    done = finish(process)
    assert done.returncode == 130 and "COARSE, stopped: " in done.stdout and "corner height" in done.stdout
    assert done.stderr.splitlines()[-1].startswith("stopped: ")
