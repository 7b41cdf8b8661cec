"""Intervals that include what few measured parts leave open, against closed forms and nested simulation."""

import io
import re

import numpy as np
import pytest
from rich.console import Console
from scipy import optimize, stats

import tolcontact as tc
from tests.helpers import compiled
from tolcontact.discretization import discretize
from tolcontact.report import runs_text, summary_text
from tolcontact.variation import Draws

PARTS, MEAN, SD = 30, 0.01, 0.02
OTHERS = {"Z2": (0, 0, 0), "Z3": (20, 0, 0), "Y1": (0, 0, 5), "Y2": (20, 0, 5), "X1": (0, 10, 5)}
FIGURES = ["mean", "6 sigma", "outside limits", "Ppk as normal"]


def exact_upper(hits, count):
    """Return the upper bound of Clopper and Pearson."""
    return stats.beta.ppf(0.975, hits + 1, count - hits)


def supplied(count=1, parts=PARTS, limits=(None, 0.06)):
    stack = tc.Stack("supplied")
    for k in range(count):
        stack.link(f"link {k}", 0, tc.Tolerance(distribution=stats.norm(MEAN, SD), parts=parts))
    stack.gap("gap", limits=limits)
    return stack


def figures(model, samples=10_000, measure="gap"):
    """Return the FIGURES (figure, interval) of a measure, or of each of some."""
    summary = tc.summarize(tc.run(compiled(model), samples=samples, seed=3))
    return summary.statistic_value.sel(measure=measure, state="corrected", statistic=FIGURES).values


def test_intervals_of_one_contributor_are_those_of_its_parts():
    mean, six_sigma, share, index = figures(supplied(), samples=40_000)
    half = stats.t(PARTS - 1).ppf(0.975) * SD / np.sqrt(PARTS)
    assert np.allclose(mean[1:] - mean[0], [-half, half], atol=0.04 * half)
    ends = 6 * SD * np.sqrt((PARTS - 1) / stats.chi2(PARTS - 1).ppf([0.975, 0.025]))
    assert np.allclose(six_sigma[1:], ends, rtol=0.04)
    k = (0.06 - MEAN) / SD  # the exact interval of a normal share: noncentral t
    exact = [
        stats.norm.sf(optimize.brentq(lambda z, q=q: stats.nct.cdf(k * PARTS**0.5, PARTS - 1, z * PARTS**0.5) - q, 0, 6))
        for q in (0.025, 0.975)
    ]
    assert np.allclose(np.log(share[1:]), np.log(exact), atol=0.3)  # it also has the error of the run
    assert share[2] > 4 * share[0] > 2 * exact_upper(share[0] * 40_000, 40_000)
    assert np.allclose(index[1:], stats.norm.isf(share[:0:-1]) / 3, rtol=0.05)


def test_many_parts_leave_nothing_open():
    few, many, none = (figures(supplied(parts=parts)) for parts in (PARTS, 1_000_000, None))
    assert np.array_equal(few[:, 0], none[:, 0])
    assert np.allclose(many, none, rtol=5e-3, atol=1e-4)
    assert ((few[:, 2] - few[:, 1]) > 1.5 * (none[:, 2] - none[:, 1])).all()


def test_nested_simulation_gives_the_same_intervals_of_a_value_that_stops():
    """y = max(x1 - x2, 0) as contact makes it: parts are drawn anew, and their stack is simulated, by other code."""
    play = tc.Assembly("stop")
    base = play.part("base", tc.Box(40, 40, 10), fixed=True)
    block = play.part("block", tc.Box(20, 20, 10), at=(10, 10, 10))
    tolerance = tc.Tolerance(distribution=stats.norm(0.002, SD), parts=PARTS)
    play.variable("lift", tolerance, drives={f"block.A{k}": 1 for k in (1, 2, 3)})
    play.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=2), tolerance=0)
    play.contact("seat", moving=block.face("-z"), reference=base.face("+z"))
    play.measure("gap", block.point(10, 10, 0), along="z", limits=(None, 0.05))
    mean, six_sigma, share, _ = figures(play, samples=15_000)
    rng, z = np.random.default_rng(5), stats.norm.ppf((np.arange(3000) + 0.5) / 3000)
    nested = []
    for _ in range(2000):
        sigma = SD * np.sqrt((PARTS - 1) / rng.chisquare(PARTS - 1))
        y = np.maximum(0.002 + sigma * rng.standard_normal() / np.sqrt(PARTS) + sigma * z, 0)
        nested.append([y.mean(), 6 * y.std(), (y > 0.05).mean()])
    ends = np.quantile(nested, [0.025, 0.975], axis=0).T
    assert np.allclose(np.log([mean[1:], six_sigma[1:]]), np.log(ends[:2]), atol=0.12)
    assert share[2] == pytest.approx(ends[2, 1], rel=0.15)


def test_a_share_of_a_population_is_known_as_well_as_its_parts_are():
    values = np.round(stats.norm(0, SD).ppf((np.arange(PARTS) + 0.5) / PARTS), 4)
    stack = tc.Stack("population")
    stack.link("measured", 0, 0.1)
    stack.link("other", 0, 0.1)
    stack.gap("gap", {"measured": 1}, limits=(-0.1, 0.1))
    stack.gap("far", {"other": 1}, limits=(-0.1, 0.1))
    stack.population({"measured": values})
    upper = exact_upper(0, PARTS)
    (_, sigma, share, _), far = figures(stack, measure=["gap", "far"])
    assert share[2] == pytest.approx(upper, rel=0.02)
    assert far[2, 2] == pytest.approx(exact_upper(0, 10_000), rel=1e-12)
    assert 0.7 < sigma[1] / sigma[0] < 0.9
    assert 1.1 < sigma[2] / sigma[0] < 1.3


@pytest.mark.parametrize("parts", [3, 10])
def test_an_interval_of_a_mean_of_few_measured_rows_is_as_wide_as_students_and_a_spread_of_fewer_than_ten_has_none(parts):
    values = np.random.default_rng(1).normal(0, SD, parts)
    stack = tc.Stack("population")
    stack.link("measured", 0, 0.1)
    stack.gap("gap", limits=(None, 0.06))
    stack.population({"measured": values})
    mean, sigma, share, index = figures(stack)
    half = stats.t(parts - 1).ppf(0.975) * values.std(ddof=1) / np.sqrt(parts)
    assert mean[2] - mean[1] == pytest.approx(2 * half, rel=0.15)
    assert share[2] == pytest.approx(exact_upper(0, parts), rel=0.02)
    assert np.isfinite([sigma[1:], index[1:]]).all() == (parts == 10)


def test_what_few_parts_leave_open_needs_parts_and_no_realizations():
    """Three parts leave a share of up to 70 % possible, whatever the number of realizations."""

    def text(parts):
        stack = tc.Stack("measured")
        stack.link("a", 10, 0.3)
        stack.gap("gap", limits=(9.5, 10.5))
        if parts:
            stack.population({"a": np.linspace(-0.01, 0.01, parts)})
        console = Console(width=200, record=True, file=io.StringIO())
        console.print(summary_text(tc.summarize(tc.run(stack, samples=200, seed=1))))
        return console.export_text()

    few, many, none = text(3), text(5000), text(0)
    assert "gap: undecided: it is known from few parts, so measure more parts; more realizations decide nothing\n" in few
    assert "[-] of fewer than 10 measured rows the mean and shares alone have an interval: measure more\n" in few
    assert "Pp and Ppk need" not in few and "Pp and Ppk need" in none
    assert "measurements include: population 1: a from 3 parts\n" in few and "known from" not in none
    assert all(re.search(r"gap: undecided: about [\d ]+ more realizations\n", printed) for printed in (many, none))


@pytest.mark.parametrize("is_population", [False, True])
@pytest.mark.parametrize("keep", ["measures", "poses", "all"])
def test_a_summary_without_deviations_states_that_it_leaves_few_parts_out(keep, is_population):
    stack = supplied(parts=8, limits=(-1, 1)) if not is_population else tc.Stack("population")
    if is_population:
        stack.link("link 0", 0, 0.1)
        stack.gap("gap", limits=(-1, 1))
        stack.population({"link 0": np.random.default_rng(1).normal(0, SD, 8)})
    summary = tc.summarize(tc.run(stack, samples=3000, seed=1, keep=keep))
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(summary_text(summary))
    text, is_left_out = console.export_text(), keep != "all"
    assert ("which intervals of measurements include: " in text) != is_left_out
    assert ('from few parts, which no interval includes without deviations (keep="all"): ' in text) == is_left_out
    assert ('gap: meets its limits; but without what few parts leave open: archive the deviations, keep="all"' in text) == (
        is_left_out
    )


def change(after, before, seeds=(1, 1)):
    """Return the changes (change_of, interval) of the gap."""
    models = {"before": before, "after": after}
    runs = {name: tc.run(model, samples=3000, seed=seed) for (name, model), seed in zip(models.items(), seeds, strict=True)}
    compared = tc.compare_runs(runs)
    assert compared.few_parts.values.tolist() == ["included"] * 2
    return compared.change.sel(run="after", measure="gap", state="raw").values


def lot(values, parts, *, is_population, sensitivity=1):
    stack = tc.Stack("lot")
    if is_population:
        stack.link("disc", 0, 0.1, sensitivity=sensitivity)
        stack.population({"disc": values})
    else:
        distribution = stats.norm(values.mean(), values.std(ddof=1))
        stack.link("disc", 0, tc.Tolerance(distribution=distribution, parts=parts), sensitivity=sensitivity)
    stack.gap("gap", limits=(-0.05, 0.05))
    return stack


@pytest.mark.parametrize("is_population", [False, True])
def test_changes_between_suppliers_are_known_as_well_as_the_parts_of_both(is_population):
    z = stats.norm(MEAN, SD).ppf((np.arange(PARTS) + 0.5) / PARTS)
    first, second = z, z + 1e-4
    suppliers = [lot(values, PARTS, is_population=is_population) for values in (second, first)]
    shift, ratio, share = change(*suppliers, seeds=(1, 2))
    half = np.sqrt(2) * stats.t(2 * PARTS - 2).ppf(0.975) * z.std(ddof=1) / np.sqrt(PARTS)
    assert shift[1:] - shift[0] == pytest.approx([-half, half], rel=0.2)  # of 512 draws
    ends = ratio[0] * np.sqrt(stats.f(PARTS - 1, PARTS - 1).ppf([0.025, 0.975]))
    assert np.log(ratio[1:]) == pytest.approx(np.log(ends), rel=0.15 if not is_population else 0.35)
    assert share[1] < -0.02 and share[2] > 0.02


@pytest.mark.parametrize("is_population", [False, True])
def test_changes_between_designs_do_not_depend_on_parts_that_both_have(is_population):
    values = np.random.default_rng(2).normal(MEAN, SD, PARTS)
    designs = [lot(values, PARTS, is_population=is_population, sensitivity=s) for s in (-1.1, -1.0)]
    shift, ratio, _ = change(*designs)
    assert ratio == pytest.approx([1.1] * 3, abs=1e-3)
    half = 0.1 * stats.t(PARTS - 1).ppf(0.975) * values.std(ddof=1) / np.sqrt(PARTS)
    assert np.ptp(shift[1:]) == pytest.approx(2 * half, rel=0.12)


def test_a_comparison_without_deviations_states_that_it_leaves_few_parts_out():
    runs = {keep: tc.run(supplied(), samples=200, keep=keep) for keep in ("all", "measures")}
    compared = tc.compare_runs(runs | {"known": tc.run(supplied(parts=None), samples=200)})
    assert compared.few_parts.values.tolist() == ["included", "left out", "none"]
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(runs_text(compared))
    text = console.export_text()
    assert text.count("known from few parts, which intervals include") == 1
    assert text.count('known from few parts, which no interval includes without deviations (keep="all")') == 1


def test_causes_are_no_parts():
    """What a shared cause adds to a contributor does not widen its own figures."""
    seat = tc.Assembly("seat")
    block = seat.part("block", tc.Box(20, 20, 10))
    known = tc.Tolerance(distribution=stats.norm(MEAN, SD), parts=PARTS)
    lift = tc.Locator("Z1", (10, 10, 0), "z", known)
    others = [tc.Locator(name, point, name[0].lower(), 0) for name, point in OTHERS.items()]
    seat.locate(block, [lift, *others])
    seat.variable("heat", tc.Tolerance(distribution=stats.norm(0, 0.05)), drives={"block.Z1": 1})
    seat.measure("gap", block.point(10, 10, 0), along="z", limits=(None, 0.06))
    mean = figures(seat)[0]
    of_run = 1.96 * np.hypot(SD, 0.05) / 100
    half = stats.t(PARTS - 1).ppf(0.975) * SD / np.sqrt(PARTS)
    assert mean[2] - mean[0] == pytest.approx(np.hypot(of_run, half), rel=0.1)


def test_parts_are_declared_kept_and_told():
    model = supplied(count=6)
    assert str(model.variables[0].tolerance) == "mean 0.01, standard deviation 0.02 mm of 30 parts"
    (line,) = Draws(discretize(model)).in_words
    assert line.endswith("include: link 0, link 1, link 2, link 3 and 2 more from 30 parts")
    faults = {
        tc.Tolerance(distribution=stats.norm(0, 1), parts=4): "parts is 4; expected a whole number, 5 or more",
        tc.Tolerance(0.2, parts=30): r"parts is given, which goes with a mean and a standard deviation: distribution=scipy",
    }
    for tolerance, fault in faults.items():
        assert any(fault in text for text in tolerance.faults())
    bore = tc.Size(8, "H7", distribution=stats.norm(0.007, 0.002), parts=30)
    assert bore.tolerance.parts == 30 and not list(bore.faults())
