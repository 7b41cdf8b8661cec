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
from tests.helpers import PAPER, call, nightly
from tests.test_ra1 import MEASURED, TOP, plane_weights
from tolcontact.analyses.analysis import independent_groups
from tolcontact.analyses.designs import MixedDraws, ReleasedDraws
from tolcontact.analyses.linear_model import linear_model
from tolcontact.statistics.sobol_indices import missed, shapley_effects, sobol_indices


def values(function, A, B):
    """f (n, 2 + group) of each column alone as a group."""
    mixed = [np.where(np.arange(A.shape[1]) == k, B, A) for k in range(A.shape[1])]
    return np.column_stack([function(x) for x in (A, B, *mixed)])


def ishigami(x):
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def clipped(x):
    """A contact that is open below: what lies below is cut off."""
    return np.maximum(0, x[:, 0] + 0.5 * x[:, 1])


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


ISHIGAMI = np.array([[0.31390, 0.44241, 0.0], [0.55758, 0.44241, 0.24368]])  # a = 7, b = 0.1
KNOWN = {
    "ishigami": (ishigami, lambda g, n: g.uniform(-np.pi, np.pi, (n, 3)), ISHIGAMI),
    "clipped": (clipped, lambda g, n: g.normal(size=(n, 2)), of_clipped()),
}


@pytest.mark.parametrize("name", KNOWN)
def test_intervals_of_known_functions_cover(name):
    """500 repeats with n = 2000 each: 95 % is covered in 465 to 487 of them with 98 % probability, for one index."""
    function, draw, truth = KNOWN[name]
    generator, inside = np.random.default_rng(4), np.zeros(truth.shape)
    for _ in range(500):
        f = values(function, draw(generator, 2000), draw(generator, 2000))
        for order, found in enumerate(sobol_indices(f)):
            inside[order] += [e.lower <= t <= e.upper for e, t in zip(found, truth[order], strict=True)]
    assert (inside >= 460).all() and (inside <= 490).all(), inside


def test_estimates_are_those_of_scipy():
    generator = np.random.default_rng(1)
    A, B = generator.normal(size=(2, 4096, 2))
    f = values(clipped, A, B)
    first, total = sobol_indices(f)
    theirs = stats.sobol_indices(func={"f_A": f[None, :, 0], "f_B": f[None, :, 1], "f_AB": f.T[2:, None]}, n=4096)
    assert [e.value for e in first] == pytest.approx(theirs.first_order.ravel(), abs=5e-3)
    assert [e.value for e in total] == pytest.approx(theirs.total_order.ravel(), abs=5e-3)


def test_nothing_is_said_of_what_does_not_vary_or_is_no_number():
    for f in (np.ones((10, 4)), np.full((10, 4), np.nan)):
        assert all(np.isnan(e).all() for found in sobol_indices(f) for e in found)


def test_a_prediction_misses_what_it_does_not_explain():
    generator = np.random.default_rng(2)
    x, noise = generator.normal(size=(2, 20_000))
    for scale, expected in ((0.0, 0.0), (1.0, 0.5)):
        found = missed(x + scale * noise, x)
        assert found.lower - 1e-12 <= expected <= found.upper + 1e-12 and found.upper - found.lower < 0.03


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
    program = tc.build(cases.model("ra1"), solver="daqp")
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


def test_mixtures_do_not_depend_on_blocks_and_exchange_columns():
    draws = tc.build(cases.ra1(), solver="daqp").draws
    mixed = MixedDraws(draws, [np.array([0]), np.array([3, 5])])
    whole = mixed(seed=2, start=0, stop=40)
    assert np.array_equal(whole[7:23], mixed(seed=2, start=7, stop=23))
    A, B, first, second = whole.reshape(10, 4, -1).transpose(1, 0, 2)
    assert np.array_equal(A, draws(seed=2, start=0, stop=10)) and not (A == B).any()
    assert np.array_equal(first[:, 0], B[:, 0]) and np.array_equal(np.delete(first, 0, 1), np.delete(A, 0, 1))
    assert np.array_equal(second[:, [3, 5]], B[:, [3, 5]]) and np.array_equal(second[:, :3], A[:, :3])


def test_what_is_drawn_together_is_one_group():
    a = cases.stack()
    a.correlate(["upper.A1", "middle.A1"], [[1, 0.8], [0.8, 1]])
    program = tc.build(a, solver="daqp")
    labels = list(program.nominal.contributors)
    groups = independent_groups(program.draws, labels, np.ones(len(labels), dtype=bool))
    assert "middle.A1 + upper.A1" in groups or "upper.A1 + middle.A1" in groups
    assert sorted(k for columns in groups.values() for k in columns) == list(range(len(labels)))
    by_part = tc.analyses.contributions(a, samples=16, solver="daqp", by="part")
    assert by_part.sizes["group"] == 2 and "bottom" in by_part["group"].values


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


CORRELATED = ["upper.A3", "middle.A1", "upper.A1"]
MATRIX = [[1, 0.8, -0.3], [0.8, 1, 0.1], [-0.3, 0.1, 1]]


@pytest.mark.slow
def test_shapley_effects_divide_what_is_correlated():
    """Against the closed form: also of a locator that the measure does not follow; it is correlated with one it follows."""
    rho, first, second = 0.5, 1, 2  # Owen, Prieur (2017), two numbers
    own = (first**2 * (1 - rho**2 / 2) + rho * first * second + second**2 * rho**2 / 2) / 7
    assert of_normal([first, second], [[1, rho], [rho, 1]]) == pytest.approx([own, 1 - own])
    a = cases.stack()
    a.correlate(CORRELATED, MATRIX)
    program = tc.build(a, solver="daqp", method=PAPER)
    found = tc.analyses.contributions(program, samples=4096).sel(measure="top")
    columns = [list(program.nominal.contributors).index(label) for label in (*CORRELATED, "upper.A2")]
    slopes = linear_model(program).by_deviations[0, columns]
    matrix = np.eye(4)
    matrix[:3, :3] = MATRIX
    for label, truth in zip((*CORRELATED, "upper.A2"), of_normal(slopes, matrix), strict=True):
        estimate, lower, upper = found["shapley"].sel(state="raw", unit=label).values
        assert abs(estimate - truth) < 1.7 * (upper - lower) / 2 + 1e-3 and truth > 0.05, label
    assert found["shapley"].sel(interval="estimate").sum("unit").values == pytest.approx([1, 1])
    assert found.sizes["unit"] == found.sizes["group"] + 2
    assert tc.analyses.contributions(program, samples=16, by="part").sizes["unit"] == 3


def test_intervals_of_shapley_effects_cover():
    """Of a clipped sum of independent numbers they are the means of first-order and total indices."""
    draws, inside = np.random.default_rng(8), np.zeros(2)
    truth = of_clipped().mean(axis=0)
    for _ in range(500):
        A, B = draws.normal(size=(2, 1000, 2))
        places = draws.random((1000, 2)).argsort(axis=1)
        f = np.column_stack([clipped(np.where(places < members, A, B)) for members in range(3)])
        inside += [e.lower <= t <= e.upper for e, t in zip(shapley_effects(f, places), truth, strict=True)]
    assert (inside >= 460).all() and (inside <= 490).all(), inside


def test_released_draws_do_not_depend_on_blocks_and_keep_correlations():
    a = cases.stack()
    a.correlate(CORRELATED, MATRIX)
    program = tc.build(a, solver="daqp")
    labels = list(program.nominal.contributors)
    columns = [labels.index(label) for label in CORRELATED]
    released = ReleasedDraws(
        program.draws, independent_groups(program.draws, labels, np.ones(len(labels), dtype=bool), correlated=False)
    )
    whole = released(seed=2, start=0, stop=19 * 3000)
    assert np.array_equal(whole[37:777], released(seed=2, start=37, stop=777))
    rows = whole.reshape(3000, 19, -1)
    assert np.abs(rows[:, -1] - program.draws(seed=2, start=0, stop=3000)).max() < 1e-9
    for members in (0, 9, 18):
        assert np.corrcoef(rows[:, members, columns].T) == pytest.approx(np.array(MATRIX), abs=0.06)
    places = released.positions(2, 0, 3000)
    kept = np.isclose(rows[:, 9], rows[:, -1], atol=1e-9)[:, labels.index("upper.A2")]
    assert np.array_equal(kept, places[:, labels.index("upper.A2")] < 9)


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
    # Root sum square of CASES C7, which is nearly linear: sensitivities times a sixth of the tolerances.
    parts = np.array([11.910 * 0.1, 23.732 * 0.02, 11.821 * 0.025]) ** 2
    for label, part in zip(("hub.flat.offset", "roller.barrel.size", "ring.bore.size"), parts / parts.sum(), strict=True):
        estimate, lower, upper = shares["total"].sel(group=label).values
        assert abs(estimate - part) < 1.7 * (upper - lower) / 2 + 0.01


def test_an_option_that_cannot_act_is_refused():
    program = tc.build(cases.one_dimensional(0), solver="daqp")
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
    program = tc.build(shelf({f"v{k}": w for k, w in enumerate(WEIGHTS)}), solver="daqp", method=PAPER)
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
    program = tc.build(shelf({f"v{k}": w for k, w in enumerate(WEIGHTS)}), solver="daqp", method=PAPER)
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


def test_what_varies_by_less_than_its_accuracy_has_no_shares():
    rng = np.random.default_rng(1)
    f = -0.15 + 1e-9 * rng.standard_normal((500, 4))
    first, total = sobol_indices(f, 1e-8)
    assert np.isnan(first).all() and np.isnan(total).all() and np.isnan(missed(f[:, 0], f[:, 1], 1e-8)).all()
    assert not np.isnan(sobol_indices(f, 0.0)[0][0].value)


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
    contributors = tc.build(a, solver="daqp", method=PAPER).draws.contributors
    assert next(c for c in contributors if c.label == "v").variance == pytest.approx(variance, rel=2e-4)
