"""Rare events: known probabilities, intervals that cover, and what leads to them."""

import io
import json

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import tolcontact as tc
from tests import cases
from tests.helpers import PAPER, SEATED, call, nightly
from tolcontact.analyses.engine import Engine
from tolcontact.analyses.tails import BISECTIONS, INFLATIONS, not_assemblable, simulated_scores
from tolcontact.simulation import map_blocks
from tolcontact.statistics.rare_events import REPLICATES, mean_probability, tail_probability
from tolcontact.variation.plans import uniform

TWELVE = np.ones(12) / np.sqrt(12)
TAILS = {
    "plane": (lambda u: u @ TWELVE - 4.5, 12, stats.norm.sf(4.5)),
    "two sides": (lambda u: np.abs(u[:, 0]) - 4, 12, 2 * stats.norm.sf(4)),
    "corner": (lambda u: np.minimum(u[:, 0] - 2, u[:, 1] - 2.5), 6, stats.norm.sf(2) * stats.norm.sf(2.5)),
    "steps": (lambda u: np.floor(2 * (u @ TWELVE - 4)) + 0.5, 12, stats.norm.sf(4)),
}


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize("name", ["corner", *nightly(*(name for name in TAILS if name != "corner"))])
def test_intervals_cover_known_tails(name):
    """Estimates from 40 000 realizations each; of 500, two standard errors of a coverage of 95 % are 2 %."""
    score, dimensions, truth = TAILS[name]
    repeats = 500 if name == "plane" else 120
    found = np.array(
        [tail_probability(score, dimensions, samples=40_000, rng=np.random.default_rng(seed)) for seed in range(repeats)]
    )
    covered = ((found[:, 1] <= truth) & (truth <= found[:, 2])).mean()
    assert abs(covered - 0.95) <= 3 * np.sqrt(0.95 * 0.05 / repeats)
    error = found[:, 0].std() / np.sqrt(repeats)
    assert abs(found[:, 0].mean() - truth) < 3 * error + 0.02 * truth
    assert np.median(found[:, 2] - found[:, 1]) / 2 < 0.35 * truth


def test_what_is_not_rare_is_counted():
    rng = np.random.default_rng(1)
    _, lower, upper = tail_probability(lambda u: u[:, 0] + 0.5, 3, samples=20_000, rng=rng)
    assert lower < stats.norm.cdf(0.5) < upper and upper - lower < 0.02


def test_what_is_never_seen_is_at_most_what_no_hit_says():
    rng = np.random.default_rng(1)
    estimate, lower, upper = tail_probability(lambda u: np.full(len(u), -1.0), 3, samples=20_000, rng=rng)
    assert (estimate, lower) == (0, 0) and 1e-4 < upper < 1e-3


def limited(limit):
    """CASES C1, whose corrected height is max(0, g), g ~ N(0, 1), above nominal."""
    a = cases.one_dimensional(0)
    a.measure("kept", a.parts[1].point(5, 5, 10), along="z", limits=(None, limit))
    return a


@pytest.mark.slow
def test_a_limit_far_out_is_exceeded_as_often_as_the_closed_form_says():
    found = tc.tails(limited(4.5), samples=8000, solver="daqp", method=PAPER)
    assert found.event.values.tolist() == ["kept outside limits"]
    estimate, lower, upper = found.probability.values[0]
    assert lower < stats.norm.sf(4.5) < upper and upper - lower < 4 * estimate
    assert int(found.simulated[0]) == int(found.by_status.sum()) < 16_000


@pytest.mark.slow
@pytest.mark.parametrize("samples", [40_000, *nightly(200_000)])
def test_ra1_as_a_run_counts_it(samples):
    """An event that a run still sees."""
    a = cases.ra1()
    a.measure("far", a.parts[1].point(50, 0, 10), along="z", limits=(None, 9.5))
    counted = tc.summarize(tc.run(a, samples=samples, seed=5, solver="daqp", keep="measures", fields="none", surfaces=0))
    _, low, high = counted.statistic_value.sel(measure="far", state="corrected", statistic="above limit").values
    found = tc.tails(a, samples=6000, solver="daqp")
    _, lower, upper = found.probability.sel(event="far outside limits").values
    assert lower < high and low < upper and 0 < high < 1e-3


@pytest.mark.slow
def test_parts_are_led_to_where_they_do_not_go_together():
    """CASES C6, rotations alone: the least inflation of all deviations at which parts do not go together, by looking at all."""
    program = tc.build(cases.square_pins("rotations"), solver="daqp", method=SEATED)
    engine = Engine(program, map_blocks)
    score = not_assemblable(engine)
    u = np.random.default_rng(3).standard_normal((24, len(program.draws.varying)))
    every = np.stack([score_of(engine, factor * u) for factor in INFLATIONS])
    assert (every[1:] >= every[:-1]).all()  # what does not go together does not with larger deviations either
    assert score(u) == pytest.approx(0.5 - np.where(every.any(axis=0), every.argmax(axis=0), len(every)))
    assert 2**BISECTIONS == len(INFLATIONS) + 1
    of_run = program.draws(seed=1, start=0, stop=24)
    again = program.draws.from_numbers(lambda label: uniform(1, label, 0, 24), 24)
    assert np.array_equal(again, of_run)


def score_of(engine, u):
    _, status = simulated_scores(engine, u)
    return status == tc.Status.NOT_ASSEMBLABLE


def test_what_has_no_rare_event_is_refused():
    with pytest.raises(tc.OptionError, match="no measure has limits"):
        tc.tails(cases.one_dimensional(0), method=PAPER)
    with pytest.raises(tc.OptionError, match="samples is 100;"):
        tc.tails(limited(4), samples=100)
    still = tc.Assembly("still")
    part = still.part("part", tc.Box(1, 2, 3), fixed=True)
    still.measure("corner", part.point(0, 0, 0), along="x", tolerance=1)
    with pytest.raises(tc.OptionError, match="nothing varies"):
        tc.tails(still)


def test_what_is_drawn_anew_cannot_be_followed():
    a = tc.Assembly("anew")
    plate = a.part("plate", tc.Box(100, 50, 10), fixed=True)
    plate.feature("under", plate.face("-z"), datum="A")
    top = plate.feature("top", plate.face("+z"), tc.Profile(0.3, "A", rule="uniform"))
    a.measure("corner", top.point(100, 50, 10), along="z", tolerance=0.3)
    with pytest.raises(tc.OptionError, match="is redrawn until it lies in its zone"):
        tc.tails(a)


@pytest.mark.slow
def test_measured_parts_and_correlations_are_drawn_as_in_a_run():
    a = limited(2.5)
    a.population(pd.DataFrame({"z": np.linspace(-3, 3, 200)}), {"block.Z": "z"})
    _, lower, upper = tc.tails(a, samples=8000, solver="daqp").probability.values[0]
    assert lower <= (np.linspace(-3, 3, 200) > 2.5).mean() <= upper


@pytest.mark.slow
def test_the_command_prints_a_table_json_and_csv(tmp_path):
    model = tmp_path / "model.py"
    model.write_text(
        "import tolcontact as tc\n\n\ndef assembly():\n    a = tc.Assembly('m')\n    b = a.part('b', tc.Box(10, 10, 10))\n"
        "    a.locate(b, tc.three_two_one(b.face('-z'), b.face('-y'), b.face('-x')), tolerance=0.6)\n"
        "    a.measure('h', b.point(5, 5, 10), along='z', tolerance=0.4)\n    return a\n"
    )
    options = ("tails", model, "--samples", "4000")
    done = call(tmp_path, *options)
    assert done.returncode == 0 and "h outside limits" in done.stdout and "ppm" in done.stdout, done.stderr
    said = json.loads(call(tmp_path, *options, "--json").stdout, parse_constant=pytest.fail)
    assert said["coords"]["event"]["data"] == ["h outside limits"]
    table = pd.read_csv(io.StringIO(call(tmp_path, *options, "--csv").stdout))
    assert {"event", "estimate", "lower", "upper"} <= set(table)
    assert call(tmp_path, *options, "--csv", "--json").returncode == 2
    assert call(tmp_path, "tails", model, "--samples", "10").returncode == 2


@pytest.mark.parametrize("count", [3, REPLICATES])
def test_the_interval_of_estimates_is_that_of_their_logarithm(count):
    """Student's t for as many estimates as there are, less one; at most 1."""
    for scale in (1e-6, 0.6):
        values = np.linspace(0.5, 1.5, count)
        reach = np.exp(stats.t.ppf(0.975, count - 1) * stats.sem(values))
        assert mean_probability(scale * values) == pytest.approx((scale, scale / reach, min(scale * reach, 1.0)))
