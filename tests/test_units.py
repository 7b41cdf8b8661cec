"""Units of measurements: inches, micrometres and degrees, and texts of tolerances in other units than mm."""

import numpy as np
import pytest

import tolcontact as tc
from tests.helpers import compiled, nightly
from tolcontact.vocabulary import OUTSIDE


def block(units="mm", angle=None):
    """A block on a table with a measurement of each kind, whose limits are the same lengths in all units."""
    size = tc.declaration.UNITS[units]
    a = tc.Assembly("block", units=units)
    table, part = a.part("table", tc.Box(100, 50, 10), fixed=True), a.part("part", tc.Box(100, 50, 20), at=(0, 0, 10))
    a.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x")), tolerance=0.3)
    a.contact("seat", moving=part.face("-z"), reference=table.face("+z"))
    corner = part.point(100, 50, 20)
    a.measure("height", corner, along="z", tolerance=0.254 / size)
    a.measure("distance", table.point(0, 0, 0), to=corner, along="z", limits=(29.8 / size, 30.3 / size))
    a.measure("gap", tc.Gap(part.point(100, 0, 0), table.face("+z")))
    a.measure("least", tc.Minimum("gap", "height"))
    a.measure("nested", tc.Minimum(tc.Gap(part.point(0, 0, 0), table.face("+z")), tc.Gap(corner, table.face("+z"))))
    a.measure("turn", tc.Angle(part.face("-z"), table.face("+z")), units=angle)
    a.measure("own", lambda poses: poses.position(corner)[2], units="mm")
    return a


@pytest.mark.parametrize("units", ["in", *nightly("um")])
def test_values_limits_and_shares_are_those_of_mm_in_other_units(units, tmp_path):
    factor = np.array([tc.declaration.UNITS[units]] * 5 + [np.pi / 180, 1.0])
    programs = [compiled(block(*given), solver="daqp") for given in ((), (units, "deg"))]
    expected, found = (tc.run(program, samples=300, surfaces=0, fields="none") for program in programs)
    assert found["measure_units"].values.tolist() == [units] * 5 + ["deg", "mm"]
    np.testing.assert_allclose(found["measured"].values * factor, expected["measured"].values, rtol=0, atol=1e-12)
    shares = [tc.summarize(run)["statistic_value"].sel(statistic=OUTSIDE).values for run in (found, expected)]
    np.testing.assert_array_equal(*shares)
    tc.io.write_model(block(units, "deg"), tmp_path / "model.json")
    with tc.run(tmp_path / "model.json", samples=300, solver="daqp") as again:
        np.testing.assert_array_equal(again["measured"], found["measured"])
    worst = [tc.analyses.worst_case(program)["worst"].values for program in programs]
    np.testing.assert_allclose(worst[1] * factor[:, None, None], worst[0], rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(
    ("text", "width"),
    [
        ("±0.005 in", 0.254),
        ('±0.005"', 0.254),
        ("+0.010/-0 inch", 0.254),
        ("±5 um", 0.01),
        ("+0.1/-0.2 mm", 0.3),
        ("±1 cm", 20.0),
    ],
)
def test_a_tolerance_is_written_in_any_unit_of_length(text, width):
    assert tc.Size(50, text).tolerance.width == pytest.approx(width, abs=1e-12)


@pytest.mark.parametrize(
    ("declare", "message"),
    [
        (
            lambda a, point: a.measure("x", point, along="z", units="inch"),
            "units is 'inch'; expected one of: um, mm, cm, m, in, ft",
        ),
        (lambda a, point: a.measure("x", point, along="z", units="deg"), "units is 'deg'; expected one of: um"),
        (
            lambda a, point: a.measure("x", tc.Minimum("gap", "height"), units="um"),
            "units is 'um', but its measurement is in in",
        ),
        (lambda a, point: a.measure("x", tc.Minimum("gap", "own")), "it combines measurements in in and mm"),
    ],
)
def test_units_that_a_value_cannot_have_are_refused(declare, message):
    model = block("in")
    declare(model, model.parts[1].point(0, 0, 0))
    with pytest.raises(tc.ModelError, match=message):
        tc.build(model)
