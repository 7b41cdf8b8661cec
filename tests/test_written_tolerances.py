"""Tolerances as drawings write them: what each text means, wherever a declaration takes a tolerance, and what is refused."""

import json

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import tolcontact as tc
from tests.cases import toleranced
from tests.helpers import assembly_of, compiled, json_schema, simulate


def block(zone, **measure):
    """A block on six locators with a tolerance; its height is measured."""
    model = tc.Assembly("block")
    part = model.part("block", tc.Box(100, 50, 10))
    model.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=5), tolerance=zone)
    model.measure("height", part.point(50, 25, 10), along="z", **measure)
    return model


@pytest.mark.parametrize("distribution", ["normal", "uniform", "triangular", "truncated normal"])
def test_unequal_limits_shift_the_mean(distribution):
    """The height at the middle of A1, A2, A3 is a weighted mean of the three; its mean is the middle of the limits, 0.025."""
    _, arrays = simulate(block(tc.Tolerance("+0.1/-0.05", distribution)), samples=2000)
    heights = arrays["measured"][:, 0, 0]
    error = 4 * heights.std() / np.sqrt(len(heights))
    assert abs(heights.mean() - 0.025) < error < 0.003
    _, same = simulate(block(tc.Tolerance(0.15, distribution, shift=0.025)), samples=2000)
    assert np.array_equal(same["measured"], arrays["measured"])


def test_worst_cases_are_the_limits():
    """All of A1, A2 and A3 at a limit lift the middle of the block to that limit."""
    worst = tc.analyses.worst_case(block("+0.4/-0.2"), samples=64).worst.sel(state="raw", measure="height")
    assert worst.values == pytest.approx([-0.2, 0.4], abs=1e-9)


def test_equal_limits_are_the_full_width():
    assert str(block("±0.1")) == str(block(0.2)) == str(block("+0.1/-0.1")) == str(block((-0.1, 0.1)))


def test_a_shift_is_added_to_the_middle_of_the_limits():
    assert tc.Tolerance("+0.1/-0.05", shift=0.1).mean_shift == pytest.approx(0.125)
    assert tc.Tolerance("±0.1", cp=1.5, cpk=1.0).mean_shift == pytest.approx(0.1 / 3)


def test_sizes_have_limits_as_drawings_write_them():
    written_sizes = [tc.Size(8.1, limits) for limits in ("+0.05/-0.02", "+0.05 -0.02", (-0.02, 0.05))]
    assert set(written_sizes) == {tc.Size(8.1, 0.05, -0.02)}
    assert tc.Size(8.1, "±0.05") == tc.Size(8.1, "0.05") == tc.Size(8.1, 0.05)
    assert tc.Size(50, "H7") == tc.Size(50, 0.025, 0.0, tolerance_class="H7")
    assert tc.Size(50, " g6 ") == tc.Size(50, -0.009, -0.025, tolerance_class="g6")
    assert tc.Size(50, "js9", distribution="uniform").tolerance == tc.Size(50, 0.031, distribution="uniform").tolerance


@pytest.mark.parametrize(
    ("model", "advice"),
    [
        (lambda: toleranced.ring_with("bore", tc.Size(10, "h7")), 'its tolerance class is h7, and it is a hole; write "H7"'),
        (lambda: toleranced.block_with("width", tc.Size(50, "JS9")), 'is JS9, and it is no hole; write "js9"'),
    ],
)
def test_classes_of_holes_are_for_holes(model, advice):
    """Writing h7 for a hole is off by the whole width of the zone, and easily overlooked."""
    (fault,) = tc.check(model())
    assert advice in fault


def test_a_bore_with_a_class_varies_about_the_middle_of_its_limits():
    _, by_class = simulate(toleranced.ring_with("bore", tc.Size(10, "F7")), samples=50)
    _, by_limits = simulate(toleranced.ring_with("bore", tc.Size(10, 0.028, 0.013)), samples=50)
    assert np.array_equal(
        by_class["sample/block"] if "sample/block" in by_class else by_class["measured"], by_limits["measured"]
    )


@pytest.mark.parametrize(
    ("size", "message"),
    [
        (tc.Size(10, "t6"), "size: tolerance is 't6'; ISO 286-1 does not define t6 for 10 mm: it is for sizes above 24 mm"),
        (tc.Size(10, "H7/g6"), "size: tolerance is 'H7/g6'; it is a fit of two parts"),
        (tc.Size(10, "+0.1", -0.1), "it states one of two limits"),
        (tc.Size(10, "±0.1", -0.1), "upper is '±0.1', which states both limits; leave lower=-0.1 out"),
        (tc.Size(10, "0.1 thou"), "its unit is thou; expected mm"),
        (tc.Size("10", "H7"), "nominal is '10'; expected a number in mm"),
        (tc.Size(10, (0.1, -0.1)), "swap them"),
        (tc.Size(10, 0.1, -0.1, tolerance_class="H7"), "'H7', which has other limits than +0.1 -0.1; leave it out"),
        (tc.Size(10, 0.1, -0.1, tolerance_class="x"), "tolerance_class is 'x'; expected a number"),
        (tc.Size(10, True), "upper is True; expected a number in mm"),
    ],
)
def test_a_wrong_size_has_one_message(size, message):
    faults = tc.check(toleranced.ring_with("bore", size))
    assert len(faults) == 1
    assert message in faults[0]
    assert 'feature "bore"' in faults[0]
    assert str(size).startswith("size ")


@pytest.mark.parametrize("wrong", ["H7", "abc", (0.1, -0.1), [1, 2, 3], {}, True, np.ones(2), float("nan"), -1, "-0.1"])
def test_a_wrong_tolerance_of_a_location_has_one_message_that_names_the_part(wrong):
    model = block(wrong)
    (fault,) = tc.check(model)
    assert fault.startswith('part "block" (')
    assert "locators: tolerance" in fault
    assert "expected" in fault or "swap" in fault or "write" in fault
    assert "location of block" in str(model)


def test_a_wrong_tolerance_of_a_locator_names_the_locator():
    model = tc.Assembly("a")
    part = model.part("block", tc.Box(1, 1, 1))
    model.locate(part, [tc.Locator("A1", (0, 0, 0), "z", "0.1 thou")], floating=True, tolerance=0.1)
    assert any("locator \"A1\": tolerance is '0.1 thou'; its unit is thou; expected mm" in fault for fault in tc.check(model))


def test_a_measure_has_limits_around_its_nominal_value():
    for tolerance, limits in (
        ("±0.1", (-0.1, 0.1)),
        ("+0.1/-0.05", (-0.05, 0.1)),
        ((-0.05, 0.1), (-0.05, 0.1)),
        (0.2, (-0.1, 0.1)),
    ):
        model = block(0.2, tolerance=tolerance)
        assert tc.check(model) == ()
        assert model.measures[0].bounds(5.0) == pytest.approx((5 + limits[0], 5 + limits[1]))
        assert model.measures[0].width == pytest.approx(limits[1] - limits[0])
    results = tc.run(compiled(block(0.2, tolerance="+0.1/-0.05", absolute=True)), samples=100, surfaces=0)
    summary = tc.summarize(results)
    assert (float(summary.measure_lower[0]), float(summary.measure_upper[0])) == pytest.approx((9.95, 10.1))
    assert tc.io.model_of(results).measures[0].tolerance == (-0.05, 0.1)


@pytest.mark.parametrize("wrong", ["H7", "abc", "±0.1 thou", (0.1, -0.1), (0.1, 0.1), 0, "0", -1, True, {}])
def test_a_wrong_tolerance_of_a_measure_has_one_message_that_names_it(wrong):
    (fault,) = tc.check(block(0.2, tolerance=wrong))
    assert fault.startswith('measurement "height" (')
    assert "tolerance is" in fault


def test_models_as_data_take_the_same_texts(tmp_path):
    tc.io.write_model(toleranced.block_with("width", tc.Size(50, "h7")), tmp_path / "block.json")
    document = json.loads((tmp_path / "block.json").read_text())
    size = document["parts"][0]["features"][2]["tolerances"][0]
    assert (size["upper"], size["lower"], size["tolerance_class"]) == (0.0, -0.025, "h7")
    for key in ("tolerance_class", "lower", "cp", "cpk"):
        del size[key]
    size["upper"] = "h7"
    document["measures"][0]["tolerance"] = "+0.1/-0.05"
    document["measures"][1]["tolerance"] = [-0.1, 0.1]
    document["variables"] = [{"name": "heat", "tolerance": "+20/-10", "drives": {"block.width.size": 0.001}}]
    (tmp_path / "written.json").write_text(json.dumps(document))
    Draft202012Validator(json_schema()).validate(document)
    model = assembly_of(tmp_path / "written.json")
    assert model.features[2].tolerances == (tc.Size(50, "h7"),)
    assert [measure.tolerance for measure in model.measures] == [(-0.05, 0.1), 0.2, None]
    assert model.variables[0].tolerance == tc.Tolerance(30.0, shift=5.0)

    size["upper"] = "j9"
    (tmp_path / "written.json").write_text(json.dumps(document))
    with pytest.raises(tc.TolcontactError, match=r"does not define j9 for 50 mm"):
        assembly_of(tmp_path / "written.json")


def test_models_with_written_tolerances_come_back_from_json(tmp_path):
    model = block("+0.1/-0.05", tolerance="+0.3/-0.1")
    model.variable("heat", "±20", drives={"block.A1": 0.001}, units="K")
    tc.io.write_model(model, tmp_path / "model.json")
    copy = assembly_of(tmp_path / "model.json")
    assert str(copy) == str(model)
    assert copy.locations[0].tolerance == tc.Tolerance(0.15, shift=0.025)


@pytest.mark.parametrize("number", [np.float32(0.5), np.int64(1), np.float64(0.25)])
def test_numbers_of_numpy_are_numbers(number, tmp_path):
    model = block(number, tolerance=number)
    assert tc.check(model) == ()
    tc.io.write_model(model, tmp_path / "model.json")
    assert assembly_of(tmp_path / "model.json").locations[0].tolerance.range == number
