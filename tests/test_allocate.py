"""Allocation: closed forms where measures are sums, RA1 with contact, what is refused."""

import io
import json

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import minimize
from scipy.stats import norm

import tolcontact as tc
from tests import cases
from tests.cases import toleranced
from tests.helpers import PAPER, call, nightly
from tolcontact.discretization import discretize
from tolcontact.variation import Draws


def pile(*ranges, tolerance=1.0):
    """Blocks, each located on the one below and never near it: the top is the sum of independent deviations."""
    a = tc.Assembly("pile")
    below = None
    for k, width in enumerate(ranges):
        part = a.part(f"p{k}", tc.Box(10, 10, 10), at=(0, 0, 20 * k))
        a.locate(part, cases.translating(width), on=below)
        below = part
    a.measure("top", below.point(5, 5, 10), along="z", tolerance=tolerance)
    return a


@pytest.mark.slow
def test_ranges_of_a_sum_are_those_of_lagrange():
    """min sum c / r with sum (r T / 6)^2 = s^2: r^3 is proportional to c / T^2."""
    widths, costs = np.array([0.6, 0.3, 0.9]), np.array([1.0, 4.0, 2.0])
    names = [f"p{k}.Z" for k in range(3)]
    found = tc.analyses.allocate(
        pile(*widths), "top: ppm 2700", costs=dict(zip(names, costs.tolist(), strict=True)), samples=32_768, solver="daqp"
    )
    r = (costs / widths**2) ** (1 / 3)
    r *= (1 / norm.isf(0.00135) / 2) / np.sqrt(((r * widths / 6) ** 2).sum())  # limits are three standard deviations away
    assert found.factor.sel(group=names).values == pytest.approx(r, rel=0.12)
    assert float(found.cost.sel(stage="after").sum()) == pytest.approx((costs / r).sum(), rel=0.03)
    estimate, lower, upper = found.kept.sel(stage="after").values[0]
    assert estimate <= 0.0027 and lower < 0.0027 and upper > 0.0018
    assert found.range.sel(group=names, stage="after").values == pytest.approx(widths * found.factor.sel(group=names).values)


@pytest.mark.slow
def test_effects_are_those_of_the_sum():
    widths = np.array([0.6, 0.3, 0.9])
    found = tc.analyses.allocate(pile(*widths), "top: Ppk 0.5", samples=16_384, solver="daqp")
    usual, narrow = np.sqrt((widths**2).sum()), np.sqrt((widths**2).sum() - 0.19 * widths**2)
    effects = found.effect.isel(measure=0).sel(of_effect="6 sigma")
    for k, truth in enumerate(narrow - usual):
        estimate, lower, upper = effects.sel(group=f"p{k}.Z").values
        assert abs(estimate - truth) < 1.6 * (upper - lower) / 2 and upper - lower < 0.1 * usual  # three standard errors


@pytest.mark.slow
def test_ra1_costs_less_and_keeps_what_is_required_in_a_run_of_its_own():
    a = cases.ra1()
    a.measure("wide", a.parts[1].point(50, 0, 10), along="z", tolerance=12)
    found = tc.analyses.allocate(a, "wide: ppm 10000", solver="daqp", method=PAPER, samples=4096)
    before, after = found.cost.sum("group").values
    assert before == 12 and after < 6.5
    assert float(found.kept.sel(stage="after", interval="estimate")[0]) <= 0.01
    # Verified once more, with ranges written into a model, and another seed.
    b = tc.Assembly("allocated")
    base = b.part("base", tc.Box(100, 50, 10))
    top = b.part("top", tc.Box(50, 25, 10), at=(50, 12.5, 10))
    for part, side in ((base, "-y"), (top, "+y")):
        scheme = tc.three_two_one(part.face("-z"), part.face(side), part.face("-x"), inset=5)
        labels = ("A1", "A2", "A3", "B1", "B2", "C1")
        widths = found.range.sel(group=[f"{part.name}.{label}" for label in labels], stage="after").values
        b.locate(part, [tc.Locator(*each) for each in located(part, scheme, labels, widths)])
    b.contact("interface", moving=top.face("-z"), reference=base.face("+z"), points=202)
    b.measure("wide", top.point(50, 0, 10), along="z", tolerance=12)
    seen = tc.summarize(
        tc.run(b, samples=20_000, seed=77, solver="daqp", method=PAPER, keep="measures", fields="none", surfaces=0)
    )
    _, lower, _ = seen.statistic_value.sel(measure="wide", state="corrected", statistic="outside limits").values
    assert lower < 0.0105
    effects = found.effect.sel(measure="wide", of_effect="6 sigma", interval="estimate")
    assert str(effects.group[int(effects.argmin())].values) == "base.A2"  # as its total Sobol' index says


def located(part, scheme, labels, widths):
    """The locators of a scheme, one by one."""
    a = tc.Assembly("of the scheme")
    own = a.part(part.name, part.geometry, at=part.at)
    side = "-y" if part.name == "base" else "+y"
    a.locate(own, tc.three_two_one(own.face("-z"), own.face(side), own.face("-x"), inset=5), tolerance=1)
    a.measure("m", own.point(0, 0, 0), along="x")
    locators = discretize(a).locators
    for k, (label, width) in enumerate(zip(labels, widths, strict=True)):
        yield label, tuple(locators.points[k] - part.at), tuple(locators.directions[k]), float(width)


def test_scaled_draws_are_draws_of_other_ranges():
    one, other = (Draws(discretize(pile(*widths))) for widths in ((0.6, 0.3), (1.2, 0.15)))
    names = [each.label for each in one.contributors]
    scale = np.array([{"p0.Z": 2.0, "p1.Z": 0.5}.get(name, 1.0) for name in names])
    assert np.array_equal(one.scaled(scale)(seed=3, start=0, stop=50), other(seed=3, start=0, stop=50))


@pytest.mark.parametrize(
    "bore",
    [
        lambda size, zone: (tc.Size(10, *size), tc.Position(zone, "A|B", material="M")),
        lambda size, zone: (tc.Size(10, *size), tc.Position(zone, "A|B", material="L")),
        lambda size, zone: (tc.Size(10, *size, envelope=True), tc.Cylindricity(zone, form=tc.Form(modes=3))),
    ],
)
def test_scaled_sizes_take_their_material_limits_with_them(bore):
    """A bonus, and the envelope, count from the limits of the scaled size: 0.1/0 becomes 0.2/-0.1 about its middle."""
    declared, redrawn = (
        Draws(discretize(toleranced.ring_with("bore", *bore(*limits)))) for limits in (((0.1, 0), 0.1), ((0.2, -0.1), 0.15))
    )
    scale = np.array([3.0 if label == "ring.bore.size" else 1.5 for label in declared.labels])
    expected = redrawn(seed=3, start=0, stop=50)
    assert declared.scaled(scale)(seed=3, start=0, stop=50) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_the_bound_of_a_fresh_run_keeps_what_is_required_and_costs_little_more_than_it_must():
    """One range: 6 standard deviations of the sum are 1 / 0.9 mm."""
    totals = set()
    found = tc.analyses.allocate(
        pile(0.6, 0.3), "top: Ppk 0.9", costs={"p0.Z": 1.0}, samples=8192, seed=7, solver="daqp",
        progress=lambda _, total: totals.add(total),
    )  # fmt: skip
    assert len(totals) >= 2 and float(found.kept.sel(stage="after", interval="lower")[0]) >= 0.9
    assert 0.92 < float(found.factor.sel(group="p0.Z")) / (np.sqrt((1 / 0.9) ** 2 - 0.3**2) / 0.6) <= 1.0


@pytest.mark.slow
def test_equal_parts_get_equal_ranges():
    """Four blocks of the same cost: none differs by more than the noise of slopes from a few hundred realizations."""
    factors = tc.analyses.allocate(pile(*[0.6] * 4), "top: ppm 2700", samples=8192, seed=4, solver="daqp").factor.values
    assert factors.max() < 1.15 * factors.min()


def test_groups_without_a_cost_keep_their_ranges_and_a_cost_may_be_a_curve():
    found = tc.analyses.allocate(
        pile(0.6, 0.3, 0.9),
        "top: ppm 20000",
        costs={"p2": lambda factor: 5 / factor**2},
        by="part",
        samples=2048,
        solver="daqp",
    )
    assert found.factor.sel(group=["p0", "p1"]).values.tolist() == [1.0, 1.0]
    assert found.cost.sel(group="p2").values == pytest.approx([5, 5 / float(found.factor.sel(group="p2")) ** 2])
    assert float(found.factor.sel(group="p2")) != 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"require": "top"}, "require is 'top'"),
        ({"require": "bottom: ppm 1000"}, 'the measurement "bottom"; expected one of: top'),
        ({"require": "top: ppm 10"}, "expected samples=1000000 or more"),
        ({"require": []}, "require is empty"),
        ({"require": "top: Ppk 1", "by": "colour"}, "by is 'colour'"),
        ({"require": "top: Ppk 1", "costs": {"p9.Z": 1}}, 'costs has "p9.Z"; expected some of: p0.Z'),
        ({"require": "top: Ppk 1", "costs": {"p0.Z": -1}}, 'cost of "p0.Z" is -1'),
        ({"require": "top: Ppk 1", "costs": {}}, "costs is empty"),
    ],
)
def test_what_cannot_be_allocated_is_refused(options, said):
    with pytest.raises(tc.OptionError) as refused:
        tc.analyses.allocate(pile(0.6, 0.3), **options)
    assert said in str(refused.value)


def test_a_measure_without_limits_and_a_model_without_ranges_are_refused():
    with pytest.raises(tc.OptionError, match="which has no limits"):
        tc.analyses.allocate(pile(0.6, 0.3, tolerance=None), "top: Ppk 1")
    with pytest.raises(tc.OptionError, match="has no tolerance to allocate"):
        tc.analyses.allocate(pile(0, norm(0, 0.1)), "top: Ppk 1")


def test_the_command_prints_tables_json_and_csv(tmp_path):
    model = tmp_path / "model.py"
    model.write_text(
        "import tolcontact as tc\n\n\ndef assembly():\n    a = tc.Assembly('m')\n    b = a.part('b', tc.Box(10, 10, 10))\n"
        "    a.locate(b, tc.three_two_one(b.face('-z'), b.face('-y'), b.face('-x')), tolerance=0.6)\n"
        "    a.measure('h', b.point(5, 5, 10), along='z', tolerance=0.8)\n    return a\n"
    )
    options = ("allocate", model, "--require", "h: ppm 20000", "--samples", "512", "--cost", "b.A1=1", "--cost", "b.A2=2")
    done = call(tmp_path, *options)
    assert done.returncode == 0 and "h: ppm 20000" in done.stdout and "b.A2" in done.stdout, done.stderr
    said = json.loads(call(tmp_path, *options, "--json").stdout, parse_constant=pytest.fail)
    assert said["coords"]["requirement"]["data"] == ["h: ppm 20000"]
    table = pd.read_csv(io.StringIO(call(tmp_path, *options, "--csv").stdout))
    assert {"group", "range before", "range after", "cost after"} <= set(table)
    assert call(tmp_path, *options, "--cost", "b.A3").returncode == 2


@pytest.mark.parametrize(("requirement", "needed"), [("top: ppm 1000", 10_000), ("top: Ppk 1.33", 7408)])
def test_a_requirement_needs_ten_realizations_in_the_tail_that_it_is_about(requirement, needed):
    """A Ppk is about the percentiles at 0.135 %."""
    with pytest.raises(tc.OptionError, match=f"1024 realizations are too few .*; expected samples={needed} or more"):
        tc.analyses.allocate(pile(0.6), [requirement], samples=1024, solver="daqp")


@pytest.mark.slow
def test_what_cannot_be_met_is_said_with_the_best_that_was_found(tmp_path):
    """Of N(0, s) at least 67.7 % lie outside 0.1 to 0.5, at s = 0.273; whoever asks for less has to move the nominal."""
    a = pile(0.6)
    a.measure("off", a.parts[0].point(5, 5, 10), along="z", limits=(0.1, 0.5))
    found = tc.analyses.allocate(a, ["off: ppm 10000", "top: ppm 300000"], costs={"p0.Z": 1.0}, samples=1024, solver="daqp")
    assert found.met.sel(requirement="off: ppm 10000") == 0
    _, lower, upper = found.kept.sel(requirement="off: ppm 10000", stage="after").values
    assert lower < 0.70 and upper > 0.675  # factors are tried in steps
    tc.io.write_model(a, tmp_path / "pile.json")
    options = ("--cost", "p0.Z=1", "--samples", "1024", "--quiet")
    done = call(tmp_path, "allocate", "pile.json", "--require", "off: ppm 10000", *options)
    assert done.returncode == 1 and 'not met: "off: ppm 10000"' in done.stderr
    assert (
        "no tolerances were found whose 95 % interval keeps it" in " ".join(done.stdout.split()) and "the best" in done.stdout
    )
    done = call(tmp_path, "allocate", "pile.json", "--require", "top: ppm 300000", *options)
    assert done.returncode == 0 and "not met" not in done.stdout + done.stderr


def supported(shift):
    """A block that is pressed against two supports at one point: x is the larger one of X1 and X2 + shift, exactly."""
    a = tc.Assembly("supported", method=tc.Method(objective="seating"))
    block = a.part("b", tc.Box(100, 50, 10))
    rigid = [("Z1", (5, 5, 0), "z"), ("Z2", (95, 5, 0), "z"), ("Z3", (50, 45, 0), "z"), ("Y1", (5, 0, 5), "y")]
    supports = [("X1", tc.Tolerance(0.6)), ("X2", tc.Tolerance(0.3, shift=shift))]
    a.locate(
        block,
        [
            *(tc.Locator(*each, 0) for each in rigid),
            tc.Locator("Y2", (95, 0, 5), "y", 0.4),
            *(tc.Locator(name, (0, 25, 5), "x", zone, one_sided=True) for name, zone in supports),
        ],
    )
    a.force("f", at=block.point(0, 25, 5), vector=(-10, 0, 0))
    a.measure("x", block.point(0, 25, 5), along="x", limits=(None, 0.2))
    return a


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.parametrize("shift", [0.0, *nightly(-0.4)])
def test_a_tolerance_that_decides_nothing_before_it_is_wider_gets_the_range_of_least_cost(shift):
    """P(x <= 0.2) is the product of two normal distributions; with a shift of -0.4, X2 decides above twice its range alone."""
    found = tc.analyses.allocate(supported(shift), "x: ppm 2000", samples=5000, solver="daqp")
    idle, widths = (dict(zip(found.group.values, x.values, strict=True)) for x in (found.idle, found.range.sel(stage="after")))
    assert idle == {"b.X1": 0, "b.X2": 0, "b.Y2": 1} and widths["b.Y2"] == 0.4

    def log_share(x):
        return norm.logcdf(0.2, 0, x[0] / 6) + norm.logcdf(0.2 - shift, 0, x[1] / 6) - np.log(0.998)

    least = minimize(
        lambda x: 0.6 / x[0] + 0.3 / x[1], [0.4, 0.4], method="SLSQP", bounds=[(0.06, 1.8), (0.03, 0.9)],
        constraints={"type": "ineq", "fun": log_share},
    )  # fmt: skip
    x = [widths["b.X1"], widths["b.X2"]]
    # At most 28 of 20 000 fresh ones may lie outside for a bound of 0.002: ranges for 0.0014 cost 3 % more.
    assert 0.6 / x[0] + 0.3 / x[1] < 1.1 * least.fun and least.x[1] > 0.33
    assert x[1] == pytest.approx(least.x[1], rel=0.12)
    assert -np.expm1(log_share(x) + np.log(0.998)) <= 0.002


def test_groups_without_influence_keep_their_ranges_and_those_at_a_limit_are_named(tmp_path):
    a = pile(0.6, 0.3)
    aside = a.part("aside", tc.Box(10, 10, 10), at=(50, 0, 0))
    a.locate(aside, cases.translating(0.4))
    found = tc.analyses.allocate(
        a, "top: Ppk 0.5", costs={"p0.Z": 100.0, "p1.Z": 1e-6, "aside.Z": 1.0}, samples=8192, solver="daqp"
    )
    idle, factor = (dict(zip(found.group.values, found[name].values, strict=True)) for name in ("idle", "factor"))
    assert idle["aside.Z"] == 1 and factor["aside.Z"] == 1 and not idle["p0.Z"] and not idle["p1.Z"]
    assert factor["p0.Z"] == pytest.approx(3, rel=1e-3)
    path = tmp_path / "aside.json"
    tc.io.write_model(a, path)
    costs = [text for name, cost in (("p0.Z", 100), ("p1.Z", 1e-6), ("aside.Z", 1)) for text in ("--cost", f"{name}={cost}")]
    printed = call(
        tmp_path, "allocate", path, "--require", "top: Ppk 0.5", *costs, "--samples", "8192", "--solver", "daqp"
    ).stdout
    lines = [line for line in printed.splitlines() if "allowed" in line or "no influence" in line]
    assert any(line.startswith("aside.Z") and "no influence" in line for line in lines)
    assert any(line.startswith("p0.Z") and "largest allowed" in line for line in lines)
    assert "at 0.1 times or 3 times those before, none of 8 192 resolved realizations changed" in " ".join(printed.split())


def in_a_slot():
    """A block with 0.2 mm of play in all between two walls: it fits unless its side deviates by more (1.5 sigma)."""
    a = tc.Assembly("slot")
    walls = [a.part(name, tc.Box(20, 30, 20), at=(x, 0, 0), fixed=True) for name, x in (("left", -20), ("right", 50.2))]
    block = a.part("block", tc.Box(50, 30, 10), at=(0.1, 0, 0.5))
    block.feature("datum", block.face("-x"), datum="A")
    block.feature("side", block.face("+x"), tc.Profile(0.8, "A", rule="translation"))
    seats = [tc.Locator(f"A{k}", point, "z", 0) for k, point in enumerate([(5, 5, 0), (45, 5, 0), (25, 25, 0)])]
    seats += [tc.Locator(f"B{x}", (x, 0, 5), "y", 0) for x in (5, 45)]
    a.locate(block, [*seats, tc.Locator("C", (0, 15, 5), "x", 0.6)])
    for wall, side, other in zip(walls, ("-x", "+x"), ("+x", "-x"), strict=True):
        a.contact(wall.name, moving=block.face(side), reference=wall.face(other), points=4)
    a.measure("x", block.point(0, 15, 5), along="x", limits=(-0.3, 0.3))
    return a


def test_realizations_that_cannot_be_assembled_count_as_outside_limits():
    """The pose of least penetration lies within the limits."""
    found = tc.analyses.allocate(in_a_slot(), "x: ppm 200000", costs={"block.C": 1.0}, samples=256, solver="daqp")
    for _, lower, upper in found.kept.values[0]:
        assert lower < norm.sf(1.5) < upper
