"""Figures of a measurement that rests on its stop in most realizations: an interval that covers, or none."""

import io
import re

import numpy as np
import pytest
from rich.console import Console
from scipy import special, stats

import tolcontact as tc
from tests.helpers import compiled, nightly
from tolcontact.report import summary_text


def resting(share, name="rest", **limits):
    """A block over a table, whose height is max(0, v) of a normal v with sigma 0.1; it leaves the table in a share."""
    a = tc.Assembly(name)
    table, block = a.part("table", tc.Box(100, 50, 10), fixed=True), a.part("block", tc.Box(50, 25, 10), at=(25, 12.5, 10))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=0)
    cause = tc.Tolerance(distribution=stats.norm(0.1 * special.ndtri(share), 0.1))
    a.variable("v", cause, drives={f"block.A{k}": 1.0 for k in (1, 2, 3)})
    a.contact("under", moving=block.face("-z"), reference=table.face("+z"), points=4)
    a.measure("height", block.point(25, 12.5, 10), along="z", **limits)
    return a


def verdicts(summary):
    console = Console(width=200, file=io.StringIO())
    console.print(summary_text(summary))
    return [line for line in console.file.getvalue().splitlines() if line.startswith("height: ")]


def simulated(model, samples, seed=1, **options):
    return tc.run(compiled(model, solver="daqp"), samples=samples, seed=seed, surfaces=0, fields="none", **options)


def test_a_stop_that_no_realization_leaves_has_no_interval_of_length_zero():
    summary = tc.summarize(simulated(resting(1e-4, limits=(None, 0.4)), 100))
    figures = summary.statistic_value.sel(measure="height", state="corrected")
    for name in ("mean", "standard deviation", "6 sigma", "variance"):
        estimate, lower, upper = figures.sel(statistic=name).values
        assert abs(estimate) < 1e-8 and np.isnan([lower, upper]).all(), name
    lower, upper = figures.sel(statistic="outside limits").values[1:]
    assert lower == 0 < upper


def test_a_run_until_an_interval_is_narrow_goes_on_at_a_stop():
    """Student's t of 64 equal values was 0 wide, and the run ended there."""
    run = simulated(resting(0.02, limits=(None, 0.4)), 64, seed=5, until="height: 6 sigma +-40 %")
    figures = tc.summarize(run).statistic_value.sel(measure="height", state="corrected")
    estimate, lower, upper = figures.sel(statistic="6 sigma").values
    assert 0 < upper - lower <= 0.8 * estimate and run.sizes["realization"] > 64


def test_runs_with_other_seeds_are_compared_at_a_stop():
    """The lower bound of a variance may be 0; then its ratio is unbounded on one side."""
    runs = [simulated(resting(0.12), 300, seed) for seed in (1, 2)]
    change = tc.compare_runs(dict(zip("ab", runs, strict=True))).change.sel(run="b", state="corrected", measure="height")
    estimate, lower, upper = change.sel(change_of="ratio of 6 sigma").values
    assert 0 <= lower < 1 < upper and lower < estimate < upper


def test_a_limit_that_contact_keeps_is_no_proof_of_tolerances_that_meet_it():
    """0 is the least height with contact; without contact 92 % would be below."""
    run = simulated(resting(0.08, limits=(0, None)), 2000)
    raw = float((run.measured.sel(state="raw", measure="height") < 0).mean())
    (line,) = verdicts(tc.summarize(run))
    assert line.startswith(f"height: meets its limits, kept by contact: without contact {100 * raw:.1f} % [")
    assert line.endswith("] below")
    inside = verdicts(tc.summarize(simulated(resting(0.08, limits=(-0.1, None)), 2000)))
    assert inside == ["height: meets its limits"]


@pytest.mark.parametrize("share", [0.5, *nightly(0.05, 0.01)])
def test_solvers_agree_on_every_figure_of_a_measurement_at_its_stop(share):
    """The values of three solvers at a stop scatter by 1e-17 to 1e-13 mm, on either side."""
    model, limits = resting(share, limits=(0, 0.2)), {"rtol": 1e-6, "atol": 1e-6, "equal_nan": True}
    first, *others = (
        tc.summarize(tc.run(compiled(model, solver=solver), samples=300, seed=3, surfaces=0, fields="none"))
        for solver in ("qpoases", "daqp", "graph")
    )
    for other in others:
        for name in ("statistic_value", "change", "touched"):
            np.testing.assert_allclose(other[name].values, first[name].values, **limits)
        assert other.measure_stops.values.tolist() == first.measure_stops.values.tolist() == ["lower"]
        assert verdicts(other) == verdicts(first)


def test_a_table_says_from_how_many_realizations_on_a_figure_has_an_interval():
    """The stated number suffices, with room for chance; fewer realizations have no interval."""
    model = resting(0.04, limits=(None, 0.4))
    console = Console(width=200, file=io.StringIO())
    console.print(summary_text(tc.summarize(simulated(model, 200))))
    text = console.file.getvalue()
    (stated,) = re.findall(r"at a stop, moments need 20 values off it: about ([0-9 ]+) realizations", text)
    assert "Pp and Ppk need 2 730 realizations, 3 240 with two limits" in text
    assert "skewness and kurtosis need 1000 realizations, and a kurtosis below 3.5" in text
    required = int(stated.replace(" ", ""))
    for count, has_interval in ((required // 2, False), (2 * required, True)):
        figures = tc.summarize(simulated(model, count)).statistic_value.sel(measure="height", state="corrected")
        assert np.isfinite(figures.sel(statistic="6 sigma", interval="upper")) == has_interval
