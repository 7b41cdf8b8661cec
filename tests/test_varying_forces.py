"""Forces that vary: the deflection F / k of springs in each realization, and what analyses say about them."""

import numpy as np
import pytest

import tolcontact as tc
from tests.cases.frames import STILL, Frame
from tests.helpers import compiled, nightly, realizations

SIZE, STIFFNESS = (60, 40, 10), 2000.0
TURNED = Frame(tc.degrees(30, 20, 10), (3, -4, 5))
PLACES = ((10, 10), (50, 10), (30, 25))


def pads(count, frame=STILL, tolerance=0.0):
    """Pads in a pile, each on three springs, the first on supports, whose shortening is F / k for each pad."""
    a = tc.Assembly("pads", method=tc.Method(objective="seating"))
    ground = None
    for number in range(count):
        pad = a.part(f"pad {number}", tc.Box(*SIZE), **frame.place(0, 0, 10 * number))
        guides = [tc.Locator(f"B{k}", (x, 0, 5), "y", 0) for k, x in enumerate((10, 50))] + [
            tc.Locator("C", (0, 20, 5), "x", 0)
        ]
        feet = [
            tc.Locator(f"A{k}", (*place, 0), "z", tolerance, one_sided=True, stiffness=STIFFNESS / 3)
            for k, place in enumerate(PLACES)
        ]
        a.locate(pad, [*feet, *guides], on=ground)
        ground = pad
    a.measure("top", ground.point(30, 15, 10), along=frame.along(0, 0, 1), tolerance=0.4)
    return a, ground.point(30, 15, 10)


def tops(results):
    return results.measured.sel(state="corrected", measure="top").values


@pytest.mark.parametrize(
    ("count", "frame", "solver"), [(1, TURNED, "qpoases"), (6, STILL, "qpoases"), *nightly((6, STILL, "graph"))]
)
def test_springs_yield_by_the_force_of_each_realization(count, frame, solver):
    """Six bodies have functions of their own for each pair; the force is a constant for these."""
    a, point = pads(count, frame)
    a.force("press", at=point, vector=frame.along(0, 0, -100), tolerance=tc.Tolerance(120, "uniform"))
    results = realizations(compiled(a, solver=solver), samples=40, seed=1)
    force = 100 + results["sample"].deviation.sel(contributor="press").values
    assert np.ptp(force) > 60
    assert tops(results) == pytest.approx(-count * force / STIFFNESS, abs=1e-7)


def test_a_cause_loads_several_forces_in_its_own_units():
    """The warmer, the weaker the springs of two clamps, of 100 and 50 N: by 0.5 and 0.2 N/K."""
    a, point = pads(1)
    for name, size in (("one", 100), ("two", 50)):
        a.force(name, at=point, vector=(0, 0, -size))
    a.variable("warmth", 30, units="K", loads={"one": -0.5, "two": -0.2})
    results = realizations(compiled(a), samples=20)
    warmth = results["sample"].deviation.sel(contributor="warmth").values
    assert tops(results) == pytest.approx(-(150 - 0.7 * warmth) / STIFFNESS, abs=1e-9)
    assert "loads one by -0.5 N per K, two by -0.2 N per K" in str(a)


def test_analyses_name_the_force():
    """Of the height of the pad without tilt, a third of each support's deviation and 1 / k of the force."""
    a, point = pads(1, tolerance=0.03)
    a.force("press", at=point, vector=(0, 0, -100), tolerance=tc.Tolerance(60, "normal"))
    worst = tc.analyses.worst_case(a, samples=64).sel(state="corrected")["worst"].values[0]
    assert worst == pytest.approx([-0.015 - 130 / STIFFNESS, 0.015 - 70 / STIFFNESS], abs=1e-6)
    slopes = tc.analyses.sensitivities(a, samples=16).sel(state="corrected", contributor="press", interval="estimate")
    assert slopes["sensitivity"].values == pytest.approx(-1 / STIFFNESS, abs=1e-9)
    shares = tc.analyses.contributions(a, samples=512).sel(state="corrected", measure="top")
    variances = np.array([0.005**2 / 9] * 3 + [(10 / STIFFNESS) ** 2])
    assert shares["group"].values[-1] == "press"
    lower, upper = shares["total"].sel(group="press").values[1:]
    assert lower < variances[-1] / variances.sum() < upper < lower + 0.2


def test_forces_that_cannot_vary_are_refused_by_name():
    a, point = pads(1)
    a.force("press", at=point, vector=(0, 0, -100))
    a.variable("warmth", 30, units="K", loads={"pres": 1.0})
    assert any('it loads force "pres", which is unknown; the nearest name is "press"' in fault for fault in tc.check(a))
    a, point = pads(1)
    a.parts[0].elastic(E=70e3, nu=0.33)
    a.force("press", at=point, vector=(0, 0, -100), tolerance=10)
    assert any('it loads force "press", and part "pad 0" is elastic' in fault for fault in tc.check(a))
    for option in ("drives", "expands", "loads"):
        with pytest.raises(TypeError, match=f'variable "warmth": {option} is a list; expected a factor for each name'):
            a.variable("warmth", 30, units="K", **{option: ["press"]})


def test_a_tolerance_as_text_is_in_the_units_of_its_variable():
    a, point = pads(1)
    a.force("press", at=point, vector=(0, 0, -100), tolerance="+20/-10 N")
    a.variable("play", "±0.254 mm", units="in", nominal=1.0)
    assert [(v.tolerance.range, v.tolerance.shift) for v in a.variables] == [(30, 5), (pytest.approx(0.02), 0)]
    with pytest.raises(ValueError, match=r'variable "heat": tolerance is .±0.1 in.; its unit is in; expected K'):
        a.variable("heat", "±0.1 in", units="K", expands={a.parts[0]: 1e-5})
