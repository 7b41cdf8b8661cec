"""Limits at which contact stops a measure: what lies beyond does not depend on solver, frame or resolution."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import tolcontact as tc
from tests import cases
from tests.helpers import compiled, nightly

CLEARANCE, DEVIATION = 0.15, 0.1
SOLVERS = ("daqp", *nightly("qpoases", "osqp", "proxqp", "highs", "piqp"))
FRAMES = {
    "upright": cases.Frame(),
    "moved and turned": cases.Frame(turn=(0.3, 0.5, 0.7), shift=(1000.0, 700.0, -300.0)),
}


def clipped(frame, lever):
    """A block between a table and a ceiling: its height is max(0, min(v, CLEARANCE)), also that of a point far away."""
    a = tc.Assembly("clipped")
    table = a.part("table", tc.Box(100, 50, 10), fixed=True, **frame.place(0, 0, 0))
    ceiling = a.part("ceiling", tc.Box(100, 50, 10), fixed=True, **frame.place(0, 0, 20 + CLEARANCE))
    block = a.part("block", tc.Box(50, 25, 10), **frame.place(25, 12.5, 10))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=0)
    cause = tc.Tolerance(distribution=stats.norm(0, DEVIATION))
    a.variable("v", cause, drives={f"block.A{k}": 1.0 for k in (1, 2, 3)})
    a.contact("under", moving=block.face("-z"), reference=table.face("+z"), points=12)
    a.contact("over", moving=block.face("+z"), reference=ceiling.face("-z"), points=12, within=5)
    along = frame.along(0, 0, 1)
    stops = {"both stops": (0.0, CLEARANCE), "lower": (0.0, None), "upper": (None, CLEARANCE)}
    for name, limits in (stops | {"inside": (0.0, 0.1), "below": (-0.1, 0.05)}).items():
        a.measure(name, block.point(25 + lever, 12.5, 0), along=along, limits=limits)
    return a


@pytest.mark.slow
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("resolution", ["linearized", "exact"])
@pytest.mark.parametrize(("frame", "lever"), [("moved and turned", 0.0), *nightly(("upright", 0.0), ("upright", 3000.0))])
def test_what_lies_beyond_a_stop_is_nothing(solver, resolution, frame, lever):
    method = tc.Method(resolution=resolution, objective="all points")
    with tc.run(
        compiled(clipped(FRAMES[frame], lever), solver=solver, method=method), samples=2000, surfaces=0, fields="none"
    ) as run:
        summary, height = tc.summarize(run), run["measured"].sel(state="corrected", measure="lower").values
        v = run["sample"]["deviation"].sel(contributor="v").values
    clip = np.clip(v, 0, CLEARANCE)
    assert np.abs(height - clip).max() < 1e-8 * max(1.0, lever / 10)
    expected = {
        "both stops": 0.0, "lower": 0.0, "upper": 0.0, "inside": (clip > 0.1).mean(), "below": (clip > 0.05).mean(),
    }  # fmt: skip
    shares = summary.statistic_value.sel(state="corrected", statistic="outside limits", interval="estimate")
    assert {name: float(shares.sel(measure=name)) for name in expected} == expected
    stops = {"both stops": "lower and upper", "lower": "lower", "upper": "upper", "inside": "lower", "below": ""}
    assert dict(zip(summary.measure.values, summary.measure_stops.values, strict=True)) == stops
    ppk = summary.statistic_value.sel(state="corrected", statistic="Ppk", interval="estimate")
    assert np.isnan(ppk.sel(measure=["both stops", "lower", "upper"])).all()
    assert float(ppk.sel(measure="inside")) == pytest.approx((0.1 - np.median(clip)) / (CLEARANCE - np.median(clip)), abs=1e-6)


def test_a_value_of_many_realizations_on_a_limit_is_inside():
    """Without contact: measured parts with a deviation of -0.2, 0 or 0.2, and limits on these values."""
    a = tc.Assembly("steps")
    block = a.part("block", tc.Box(10, 10, 10))
    a.locate(block, cases.translating(0.6))
    a.population(pd.DataFrame({"z": np.repeat([-0.2, 0.0, 0.2], [20, 50, 30])}), {"block.Z": "z"})
    for name, limits in {"on": (-0.2, 0.2), "upper": (None, 0.0), "within": (-0.2, 0.1)}.items():
        a.measure(name, block.point(5, 5, 10), along="z", limits=limits)
    run = tc.run(compiled(a, solver="daqp"), samples=500, surfaces=0, fields="none")
    v = run["sample"]["deviation"].sel(contributor="block.Z").values
    shares = tc.summarize(run).statistic_value.sel(state="corrected", statistic="outside limits", interval="estimate")
    assert shares.sel(measure=["on", "upper", "within"]).values.tolist() == [0.0, (v > 0).mean(), (v > 0).mean()]


def test_the_accuracy_of_a_measure_grows_with_its_lever():
    accuracies = [float(compiled(clipped(FRAMES["upright"], lever), solver="daqp").accuracies[0]) for lever in (0.0, 3000.0)]
    assert accuracies[0] == pytest.approx(1e-8, rel=0.5) and 50 < accuracies[1] / accuracies[0] < 500
