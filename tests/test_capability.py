"""Limits of measures, shares beyond them, and capability: closed forms, and what their intervals cover."""

import csv
import json

import numpy as np
import pytest
from scipy import stats

import tolcontact as tc
from tests import cases
from tests.helpers import call, compiled, nightly, simulate

PERCENTS = (0.00135, 0.5, 0.99865)


def truth(distribution, lower, upper):
    """Shares and capability of a distribution, by name; NaN for what there is not."""
    low, middle, high = distribution.ppf(PERCENTS)
    m, s = distribution.mean(), distribution.std()
    both = np.isfinite(lower) and np.isfinite(upper)
    return {
        "below": distribution.cdf(lower) if np.isfinite(lower) else np.nan,
        "above": distribution.sf(upper) if np.isfinite(upper) else np.nan,
        "outside": distribution.cdf(lower) + distribution.sf(upper),
        "Pp": (upper - lower) / (high - low) if both else np.nan,
        "Ppk": min((upper - middle) / (high - middle), (middle - lower) / (middle - low)),
        "Pp as normal": (upper - lower) / (6 * s) if both else np.nan,
        "Ppk as normal": min(upper - m, m - lower) / (3 * s),
    }


def stand(**limited):
    """A block of which one height varies, without contact."""
    a = tc.Assembly("stand")
    block = a.part("block", tc.Box(10, 20, 10), at=(0, 0, 5))
    ground = a.part("ground", tc.Box(1, 1, 1), fixed=True)
    a.locate(block, cases.translating(0.6))
    a.measure("height", block.point(5, 5, 10), along="z", **limited)
    a.measure("apart", ground.point(0, 0, 1), to=block.point(0, 0, 0), along="z", **limited)
    return a


@pytest.mark.slow
@pytest.mark.parametrize(
    ("absolute", "nominal", "quantities"),
    [
        (None, (0, 4), ("displacement", "distance")),
        (True, (15, 4), ("coordinate", "distance")),
        (False, (0, 0), ("displacement", "deviation of distance")),
    ],
)
def test_measures_are_absolute_or_relative(absolute, nominal, quantities):
    program, found = simulate(stand(absolute=absolute, tolerance=0.4), samples=50, solver="daqp")
    assert program.nominal_measures == pytest.approx(nominal, abs=1e-12)
    assert found["measured"][:, 0] - program.nominal_measures == pytest.approx(
        np.column_stack([found["deviations"][:, 0]] * 2), abs=1e-12
    )
    summary = tc.summarize(tc.run(program, samples=50))
    assert summary["measure_quantity"].values.tolist() == list(quantities)
    assert summary["measure_lower"].values == pytest.approx(np.array(nominal) - 0.2)
    assert summary["measure_upper"].values == pytest.approx(np.array(nominal) + 0.2)


@pytest.mark.slow
@pytest.mark.parametrize("absolute", [True, *nightly(False)])
@pytest.mark.parametrize("sides", [(-0.25, 0.1), (None, 0.1), (-0.25, None)])
def test_limits_are_compared_with_the_measure_as_it_is_said(absolute, sides):
    off = 15.0 if absolute else 0.0
    limits = tuple(None if side is None else side + off for side in sides)
    a = stand()
    a.measure("limited", a.parts[0].point(5, 5, 10), along="z", limits=limits, absolute=absolute)
    summary = tc.summarize(tc.run(compiled(a, solver="daqp"), samples=40_000, seed=3, surfaces=0, fields="none"))
    of = summary["statistic_value"].sel(measure="limited", state="raw")
    expected = truth(stats.norm(0, 0.1), *(side or far for side, far in zip(sides, (-np.inf, np.inf), strict=True)))
    for word, name in {"below": "below limit", "above": "above limit", "outside": "outside limits", "Ppk": "Ppk"}.items():
        value, low, high = of.sel(statistic=name).values
        assert np.isnan(value) == np.isnan(expected[word])
        assert np.isnan(value) or abs(value - expected[word]) <= 2.2 * (high - low)
    assert np.isnan(of.sel(statistic="Pp", interval="estimate")) == (None in sides)


@pytest.mark.parametrize(
    ("limited", "said"),
    [
        ({"limits": (1, 0)}, "limits are (1, 0); expected (lower, upper)"),
        ({"limits": (None, None)}, "expected (lower, upper)"),
        ({"limits": 0.3}, "limits are 0.3; expected"),
        ({"limits": (0, float("nan"))}, "expected (lower, upper)"),
        ({"limits": ("a", 2)}, "expected (lower, upper)"),
        ({"limits": (0, 1), "tolerance": 1}, "both a tolerance and limits"),
        ({"absolute": 1}, "absolute is 1; expected True or False"),
    ],
)
def test_wrong_limits_are_named(limited, said):
    faults = tc.check(stand(**limited))
    assert len(faults) == 2 and all(said in fault and 'measurement "' in fault for fault in faults)


def test_a_function_has_its_own_value():
    a = stand()
    a.measure("own", lambda poses: poses.translation(a.parts[0])[2], absolute=True)
    (fault,) = tc.check(a)
    assert "absolute is for measurements of points" in fault


@pytest.mark.slow
@pytest.mark.parametrize("limits", [(None, 0.5), (-0.25, 0.5), (-1, None)])
def test_limits_come_back_from_an_archive_and_a_document(limits, tmp_path):
    a = stand(limits=limits, absolute=False)
    tc.io.write_model(a, tmp_path / "stand.json")
    tc.run(compiled(a), samples=10, out=tmp_path / "stand.nc").close()
    with tc.open_archive(tmp_path / "stand.nc") as results:
        again = [tc.archive.model_of(results), tc.build(tmp_path / "stand.json").nominal.assembly]
    for model in again:
        assert [(m.limits, m.absolute) for m in model.measures] == [(limits, False)] * 2
        assert [str(m) for m in model.measures] == [str(m) for m in a.measures]


@pytest.mark.slow
def test_summaries_are_printed_as_json_and_csv(tmp_path):
    path = tmp_path / "stand.nc"
    tc.run(compiled(stand(limits=(None, 0.1))), samples=100, seed=2, out=path).close()
    expected = tc.summarize(path)["statistic_value"].sel(measure="height", state="raw", statistic="6 sigma").values
    done = call(tmp_path, "summary", path, "--json")
    found = json.loads(done.stdout)
    assert done.returncode == 0 and found["attrs"]["realizations"] == 100
    of = found["coords"]["statistic"]["data"].index("6 sigma")
    assert found["data_vars"]["statistic_value"]["data"][0][0][of] == expected.tolist()
    lower = found["coords"]["statistic"]["data"].index("below limit")
    assert found["data_vars"]["statistic_value"]["data"][0][0][lower] == [None] * 3
    done = call(tmp_path, "summary", path, "--csv")
    rows = list(csv.reader(done.stdout.splitlines()))
    assert rows[0] == ["measure", "state", "statistic", "estimate", "lower", "upper", "units"]
    (row,) = [row for row in rows if row[:3] == ["height", "raw", "6 sigma"]]
    assert [float(cell) for cell in row[3:6]] == expected.tolist()
    units = {row[2]: row[6] for row in rows if row[:2] == ["height", "raw"]}
    assert (units["6 sigma"], units["variance"], units["5 %"], units["Ppk"], units["kurtosis"]) == (
        "mm",
        "mm^2",
        "mm",
        "1",
        "1",
    )
    done = call(tmp_path, "summary", path, "--csv", "--json")
    assert (done.returncode, done.stdout) == (2, "") and "choose one" in done.stderr
