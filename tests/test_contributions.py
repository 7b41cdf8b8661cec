"""Sobol' indices: known functions, RA1's closed form, scipy's estimates; what is drawn together; what the command prints."""

import io
import itertools
import json

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import tolcontact as tc
from tests import cases
from tests.helpers import PAPER, call, compiled, nightly
from tests.test_ra1 import MEASURED, TOP, plane_weights
from tolcontact.discretization import discretize
from tolcontact.variation import Draws


def of_clipped(variances=(1.0, 0.25)):
    """First-order and total indices of max(0, z), z a sum of normal numbers, by quadrature: mean and variance are known."""
    whole_variance = sum(variances)
    whole = whole_variance * (0.5 - 1 / (2 * np.pi))
    phi, Phi = stats.norm.pdf, stats.norm.cdf

    def moments(m, s):
        first = m * Phi(m / s) + s * phi(m / s)
        return first, (m**2 + s**2) * Phi(m / s) + m * s * phi(m / s) - first**2

    found = []
    z, weights = np.polynomial.hermite_e.hermegauss(150)
    weights = weights / weights.sum()
    for own, other in ((np.sqrt(v), np.sqrt(whole_variance - v)) for v in variances):
        given, left = moments(own * z, other)[0], moments(other * z, own)[1]
        found.append(((weights @ given**2 - (weights @ given) ** 2) / whole, weights @ left / whole))
    return np.array(found).T


@pytest.fixture(scope="module")
def of_ra1():
    return tc.analyses.contributions(cases.model("ra1"), samples=4096, solver="daqp")


def test_raw_indices_of_ra1_are_the_closed_form(of_ra1):
    weights = plane_weights(TOP, MEASURED) ** 2
    shares = dict(zip(("top.A1", "top.A2", "top.A3"), weights / weights.sum(), strict=True))
    raw = of_ra1.sel(measure="corner height", state="raw")
    for group, share in shares.items():
        for word in ("first", "total"):
            estimate, lower, upper = raw[word].sel(group=group).values
            half = 1.7 * (upper - lower) / 2 + 0.005  # 99.9 %, and the second order
            assert abs(estimate - share) < half, (group, word)
        assert float(of_ra1["linear"].sel(group=group).item()) == pytest.approx(share, abs=0.015)
    assert float(raw["missed"].sel(interval="upper")) < 0.01
    assert (raw["total"].sel(group=[f"base.A{k}" for k in (1, 2, 3)], interval="estimate") == 0).all()


def test_linear_percentages_name_the_wrong_contributor_of_ra1(of_ra1):
    corrected = of_ra1.sel(measure="corner height", state="corrected")
    total = corrected["total"].sel(interval="estimate")
    assert str(total["group"].values[total.argmax()]) == "base.A2"
    assert str(of_ra1["group"].values[of_ra1["linear"].isel(measure=0).argmax()]) == "top.A3"
    assert float(corrected["first"].sel(group="base.A2", interval="lower")) > 0.5
    assert float(corrected["missed"].sel(interval="lower")) > 1
    assert float(corrected["first"].sel(interval="estimate").sum()) < 1 < float(total.sum())
    assert int(of_ra1["by_status"].sum()) == 4096 * 14 == of_ra1.attrs["realizations"]


@pytest.mark.slow
def test_fixing_a_group_removes_its_share():
    """Total of all but base.A2, another way: the variance that is left when it is fixed, on average over where."""
    whole = tc.analyses.contributions(cases.model("ra1"), samples=2048, seed=5, solver="daqp")
    program = compiled(cases.model("ra1"), solver="daqp")
    column, left, f = list(program.nominal.contributors).index("base.A2"), [], []
    draws = program.draws(seed=77, start=0, stop=60 * 200)
    for k in range(60):
        own = draws[200 * k : 200 * (k + 1)].copy()
        own[:, column] = own[0, column]

        def fixed(*, seed, start, stop, own=own):
            return own[start:stop]

        (block,) = tc.simulate_blocks(program, samples=200, seed=1, draws=fixed)
        left.append(block.measured[:, 1, 0].var(ddof=1))
        f.append(block.measured[:, 1, 0].mean())
    variance = float(np.concatenate([b.measured[:, 1, 0] for b in tc.simulate_blocks(program, samples=20_000, seed=3)]).var())
    found = 1 - np.mean(left) / variance
    error = np.std(left, ddof=1) / np.sqrt(len(left)) / variance
    estimate, lower, upper = whole["first"].sel(measure="corner height", state="corrected", group="base.A2").values
    assert abs(found - estimate) < 3.3 * np.hypot(error, (upper - lower) / 4)


def test_a_group_of_correlated_contributors_does_not_hide_a_contributor_of_the_same_name():
    stack = tc.Stack("names")
    for name, tolerance in {"a": 0.6, "b": 0.6, "a + b": 1.2, "a + b (2)": 0.6}.items():
        stack.link(name, 10, tolerance)
    stack.correlate(["a", "b"], 0.5)
    stack.gap("gap", tolerance=4)
    found = tc.analyses.contributions(stack, samples=64)
    assert found["group"].values.tolist() == ["a + b (3)", "a + b", "a + b (2)"]
    assert found["linear"].values.ravel() == pytest.approx(np.array([3, 4, 1]) / 8, abs=1e-3)


def of_normal(weights, matrix):
    """Shapley effects of a sum of correlated normal numbers, from the variance that each set of them explains."""
    weights, matrix = np.asarray(weights), np.asarray(matrix)

    def explained(members):
        members = list(members)
        slopes = np.linalg.solve(matrix[np.ix_(members, members)], matrix[members] @ weights)
        return slopes @ matrix[members] @ weights

    found, orders = np.zeros(len(weights)), list(itertools.permutations(range(len(weights))))
    for order in orders:
        for place, own in enumerate(order):
            found[own] += explained(order[: place + 1]) - (explained(order[:place]) if place else 0)
    return found / len(orders) / (weights @ matrix @ weights)


def test_the_command_prints_a_table_json_and_csv(tmp_path):
    options = ("contributions", cases.MODELS / "ra1.py", "--samples", "64", "--solver", "daqp")
    done = call(tmp_path, *options)
    assert done.returncode == 0 and "missed by linear sensitivities" in done.stdout, done.stderr
    assert max(map(len, done.stdout.splitlines())) <= 80
    said = json.loads(call(tmp_path, *options, "--json").stdout, parse_constant=pytest.fail)
    assert said["attrs"]["realizations"] == 64 * 14
    table = pd.read_csv(io.StringIO(call(tmp_path, *options, "--csv", "--by", "part").stdout))
    assert set(table["group"]) == {"base", "top"} and "total upper" in table
    for wrong, words in (
        (["--by", "colour"], "by is 'colour'"),
        (["--csv", "--json"], "choose one"),
        (["--samples", "1"], "samples"),
    ):
        done = call(tmp_path, *options, *wrong)
        assert done.returncode == 2 and words in done.stderr


def test_a_model_in_which_nothing_varies_is_refused():
    a = tc.Assembly("still")
    a.part("block", tc.Box(10, 10, 10), fixed=True)
    a.measure("height", a.parts[0].point(0, 0, 10), along="z")
    with pytest.raises(tc.OptionError, match="nothing varies"):
        tc.analyses.contributions(a)


@pytest.mark.slow
def test_what_only_contact_moves_has_no_linear_percentages(tmp_path):
    """The clutch's roller floats: without contact its angle does not vary."""
    done = call(tmp_path, "contributions", cases.MODELS / "clutch.py", "--samples", "64", "--solver", "daqp")
    assert done.returncode == 0 and "nan" not in done.stdout and "without contact -, with contact" in done.stdout
    shares = (
        tc.analyses.contributions(cases.MODELS / "clutch.py", samples=1024, solver="daqp")
        .isel(measure=0)
        .sel(state="corrected")
    )
    # Root sum square of the one-way clutch, which is nearly linear: sensitivities times a sixth of the tolerances.
    parts = np.array([11.910 * 0.1, 23.732 * 0.02, 11.821 * 0.025]) ** 2
    for label, part in zip(("hub.flat.offset", "roller.barrel.size", "ring.bore.size"), parts / parts.sum(), strict=True):
        estimate, lower, upper = shares["total"].sel(group=label).values
        assert abs(estimate - part) < 1.7 * (upper - lower) / 2 + 0.01


def test_an_option_that_cannot_act_is_refused():
    program = compiled(cases.one_dimensional(0), solver="daqp")
    for answer in (tc.analyses.contributions, tc.analyses.sensitivities):
        with pytest.raises(tc.OptionError, match="a Program has its solver and method"):
            answer(program, solver="daqp")
        assert answer(program, samples=16).attrs["solver"] == "daqp"


def shelf(weights, own=0.0):
    """A block that shared causes lift off a table: the height is max(0, sum of weight * cause)."""
    a = tc.Assembly("shelf")
    table, block = a.part("table", tc.Box(100, 50, 10), fixed=True), a.part("block", tc.Box(50, 25, 10), at=(25, 12.5, 10))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=own)
    for name, weight in weights.items():
        a.variable(name, tc.Tolerance(0.6), drives={f"block.A{k}": weight for k in (1, 2, 3)})
    a.contact("under", moving=block.face("-z"), reference=table.face("+z"), points=12)
    a.measure("height", block.point(25, 12.5, 10), along="z", tolerance=1)
    return a


@pytest.mark.slow
def test_independent_causes_of_the_same_locators_have_shares_of_their_own():
    found = tc.analyses.contributions(shelf({"a": 1.0, "b": -0.5}), samples=2048, solver="daqp").sel(measure="height")
    assert found.group.values.tolist() == ["a", "b"]
    assert found.linear.values == pytest.approx([0.8, 0.2], abs=1e-6)  # exact, not of draws
    for name in ("first", "total"):
        for group, share in (("a", 0.8), ("b", 0.2)):
            _, lower, upper = found[name].sel(state="raw", group=group).values
            assert lower - 0.02 < share < upper + 0.02
    assert found.missed.sel(state="raw", interval="estimate") < 1e-6


WEIGHTS = np.r_[2.0, -1.5, np.full(10, 0.7), np.full(56, 0.02)]  # of 68 causes


@pytest.mark.parametrize("seeds", [range(2), *nightly(range(2, 22))])
def test_minor_contributors_are_bounded_together_and_major_ones_keep_their_intervals(seeds):
    """A stack of 68 causes, and with contact max(0, sum): shares by closed form and by quadrature."""
    program = compiled(shelf({f"v{k}": w for k, w in enumerate(WEIGHTS)}), solver="daqp", method=PAPER)
    shares = WEIGHTS**2 / (WEIGHTS**2).sum()
    truth = {"raw": (shares, shares), "corrected": of_clipped(tuple(WEIGHTS**2))}
    misses, minor_shares = np.zeros(4), shares[12:].sum()
    for seed in seeds:
        found = tc.analyses.contributions(program, samples=512, seed=seed).isel(measure=0)
        assert found.minor.values.tolist() == [0] * 12 + [1] * 56
        assert found.attrs["realizations"] == 128 * 70 + 512 * 15
        assert abs(float(found.minor_total.sel(state="raw", interval="estimate")) / minor_shares - 1) < 0.5
        for state, orders in truth.items():
            for word, expected in zip(("first", "total"), orders, strict=True):
                estimate, lower, upper = found[word].sel(state=state).values.T
                covered = (lower <= expected) & (expected <= upper)
                misses += [*(~covered[:2]), 0.1 * (~covered[2:12]).sum(), 0.02 * (~covered[12:]).sum()]
                assert (estimate >= lower).all() and (estimate <= upper).all() and (upper[12:] < 0.01).all()
    assert (misses <= 0.15 * 4 * len(seeds)).all(), misses


def test_by_default_realizations_are_those_of_what_matters():
    program = compiled(shelf({f"v{k}": w for k, w in enumerate(WEIGHTS)}), solver="daqp", method=PAPER)
    found = tc.analyses.contributions(program)
    assert 58_000 < found.attrs["realizations"] <= 60_000 and found.attrs["base_realizations"] == (60_000 - 8960) // 15
    half_widths = np.ptp(found["total"].sel(interval=["lower", "upper"]).values, axis=-1) / 2
    assert half_widths.max() < 0.04
    assert tc.analyses.contributions(program, samples=64).minor.sum() == 0  # too few to be screened


@pytest.mark.slow
def test_a_cause_and_what_varies_by_itself_stay_apart():
    """z of the middle is a + (A1 + A2 + A3) / 3 or so: each locator keeps its own share."""
    found = tc.analyses.contributions(shelf({"a": 1.0}, own=0.3), samples=2048, solver="daqp").sel(
        measure="height", state="raw"
    )
    groups = found.group.values.tolist()
    assert "a" in groups and {"block.A1", "block.A2", "block.A3"} <= set(groups)
    first = found["first"].sel(interval="estimate")
    assert float(first.sum()) == pytest.approx(1.0, abs=0.06)
    slopes = tc.analyses.sensitivities(shelf({"a": 1.0}, own=0.3), samples=64, solver="daqp").sel(measure="height")
    assert float(slopes.nominal.sel(contributor="a")) == pytest.approx(1.0, abs=1e-6)
    lifted = slopes.nominal.sel(contributor=["block.A1", "block.A2", "block.A3"])
    variance = float((lifted**2).sum()) * 0.05**2
    assert float(first.sel(group="a")) == pytest.approx(0.1**2 / (0.1**2 + variance), abs=0.06)


@pytest.mark.slow
def test_a_cause_is_stepped_with_what_it_drives():
    """height = max(0, v): the mean derivative is 1 raw, and the share of realizations above the table corrected."""
    found = tc.analyses.sensitivities(shelf({"v": 1.0}), samples=2000, solver="daqp").sel(measure="height")
    assert found.contributor.values.tolist() == ["v"]
    raw, corrected = found.sensitivity.sel(contributor="v").values
    assert raw[0] == pytest.approx(1.0, abs=1e-6) and corrected[1] <= 0.5 <= corrected[2]


@pytest.mark.parametrize(
    ("tolerance", "variance"),
    [
        (tc.Tolerance(0.6), 0.01),
        (tc.Tolerance(0.6, "uniform"), 0.03),
        (tc.Tolerance(0.6, "triangular"), 0.015),
        (tc.Tolerance(distribution=stats.t(5, scale=0.1)), 0.01 * 5 / 3),
        (tc.Tolerance(distribution=stats.lognorm(0.5)), stats.lognorm(0.5).var()),
    ],
)
def test_the_variance_of_a_contributor_is_that_of_its_distribution(tolerance, variance):
    a = shelf({})
    a.variable("v", tolerance, drives={"block.A1": 1.0})
    contributors = Draws(discretize(a)).contributors
    assert next(c for c in contributors if c.label == "v").variance == pytest.approx(variance, rel=2e-4)
