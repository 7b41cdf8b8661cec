"""Measurements of faces in analyses, archives and JSON models, and what is refused."""

import json

import numpy as np
import pytest

import tolcontact as tc
from tests.cases.measured import PLANE, ROUND, drilled, hole, ring, seated, shaft, two
from tests.helpers import call, compiled, json_schema


def test_what_an_error_of_gaps_does_to_measures_is_stated():
    results = tc.run(compiled(seated(), solver="daqp"), samples=10, surfaces=0)
    accuracy = dict(zip(results["measure"].values, results["measure_accuracy"].values, strict=True))
    assert accuracy["least"] == pytest.approx(max(accuracy[f"gap {k}"] for k in (0, 2)), rel=0.6)
    assert 1e-8 <= accuracy["clearance"] <= 5e-8 and accuracy["turn"] == pytest.approx(1e-8)


def test_the_accuracy_of_a_measure_depends_on_how_far_apart_the_contact_of_its_part_is():
    """The upper block stands on a foot of 10: at a lever of 200, an error of a gap counts 2 / (10 sqrt 2) times 200 times."""
    model = tc.Assembly("mast")
    table = model.part("table", tc.Box(300, 300, 10), fixed=True)
    plate = model.part("plate", tc.Box(200, 200, 10), at=(50, 50, 10))
    mast = model.part("mast", tc.Box(10, 10, 200), at=(145, 145, 20))
    for part, base in ((plate, table), (mast, plate)):
        model.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=2), tolerance=0.1)
        model.contact(part.name, moving=part.face("-z"), reference=base.face("+z"))
    model.measure("top", mast.point(0, 0, 200), along="x")
    model.measure("edge", plate.point(200, 200, 10), along="z")
    accuracy = compiled(model).accuracies / 1e-8  # of gaps
    assert accuracy == pytest.approx([1 + 2 * 200 / (10 * 2**0.5), 1 + 2 * 100 / 200], rel=0.1), accuracy


def test_measures_at_a_kink_have_no_linear_model():
    """A minimum of equal gaps and an angle from 0 have none; a gap and a signed angle have."""
    program = compiled(seated(), solver="daqp")
    nominal = tc.analyses.sensitivities(program, samples=4).nominal
    kinked = {name for name in nominal["measure"].values if np.isnan(nominal.sel(measure=name)).any()}
    assert kinked == {"clearance", "least", "tilt"}
    assert np.isfinite(nominal.sel(measure=["gap 0", "turn"])).all()
    model = seated()
    few = model.replaced(measures=[measure for measure in model.measures if measure.name in ("clearance", "turn")])
    bound = tc.analyses.worst_case(few, samples=16, solver="daqp").bound
    assert np.isinf(bound.sel(measure="clearance")).all() and np.isfinite(bound.sel(measure="turn", state="raw")).all()
    linear = tc.analyses.contributions(program, samples=64).linear
    assert np.isnan(linear.sel(measure="tilt")).all() and float(linear.sel(measure="turn").sum()) == pytest.approx(1)


def test_a_minimum_away_from_its_kink_has_derivatives():
    model = tc.Assembly("steps")
    table = model.part("table", tc.Box(100, 50, 10), fixed=True)
    block = model.part("block", tc.Box(50, 25, 10), at=(25, 12.5, 10.5))
    model.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=0.1)
    upper, lower = (tc.Gap(block.point(0, 0, z), table.face("+z")) for z in (10, 0))
    model.measure("lower", lower)
    model.measure("least", tc.Minimum(upper, lower))
    nominal = tc.analyses.sensitivities(model, samples=4).nominal.values
    np.testing.assert_array_equal(nominal[0], nominal[1])
    assert np.abs(nominal).max() > 0.5


def test_measurements_keep_in_archives_and_json(tmp_path):
    model, left, right = drilled()
    model.measure("distance", tc.AxisDistance(hole(left), hole(right), across="z"), tolerance=0.3)
    model.measure("turn", tc.Angle(hole(left), right.face("+z"), about="y"))
    model.measure("flush", tc.Flush(left.point(0, 8, 6), right.face("+z")))
    model.measure("x", tc.AxisDistance(hole(left), hole(right), along="x"))
    model.measure("rims", tc.Clearance(left.face(tc.select.Cylinder(radius=9.0)), right.face(tc.select.Cylinder(radius=9.0))))
    model.measure("least", tc.Minimum("distance", tc.Mean(tc.Gap(left.point(0, 8, 6), right.face("+z")), "x"), "rims"))
    results = tc.run(compiled(model, solver="daqp"), samples=20, surfaces=0, out=tmp_path / "run.nc")
    rebuilt = tc.io.model_of(results)
    assert [measure.of.names for measure in rebuilt.measures] == [measure.of.names for measure in model.measures]
    again = tc.run(compiled(rebuilt, solver="daqp"), samples=20, surfaces=0)
    np.testing.assert_array_equal(again["measured"], results["measured"])
    kinds = ["distance of axes", "angle", "flush", "distance of axes", "clearance", "minimum"]
    assert results["measure_quantity"].values.tolist() == kinds
    assert results["measure_units"].values.tolist() == ["mm", "rad", "mm", "mm", "mm", "mm"]
    boxes = seated()
    tc.io.write_model(boxes, tmp_path / "model.json")
    entries = json.loads((tmp_path / "model.json").read_text())["measures"]
    assert entries[0]["of"]["kind"] == "clearance" and entries[-3]["of"]["measurements"][-1] == "clearance"
    found = tc.run(tmp_path / "model.json", samples=20, solver="daqp", surfaces=0)
    np.testing.assert_array_equal(found["measured"], tc.run(compiled(boxes, solver="daqp"), samples=20, surfaces=0)["measured"])
    assert {"gap", "angle", "minimum"} <= {
        entry["properties"]["kind"].get("const")
        for entry in json_schema()["$defs"].values()
        if "kind" in entry.get("properties", {})
    }


def faults_of(build):
    with pytest.raises((tc.ModelError, TypeError, ValueError)) as refused:
        assembly = tc.Assembly("bad")
        table = assembly.part("table", tc.Box(100, 50, 10), fixed=True)
        pin = assembly.part("pin", shaft(), at=(20, 20, 30), fixed=True)
        assembly.measure("earlier", table.point(0, 0, 0), along="z")
        build(assembly.measure, table, pin)
        tc.build(assembly)
    return str(refused.value)


def nested(depth, measurement):
    return tc.Sum(nested(depth - 1, measurement), measurement) if depth else measurement


BAD = {
    "unknown measure": (lambda m, a, b: m("x", tc.Minimum("earlier", "later")), 'unknown measurement "later"; those declared'),
    "a cycle": (
        lambda m, a, b: (m("x", tc.Minimum("earlier", "y")), m("y", tc.Maximum("x", "earlier"))),
        'measurement "x" (test_measurements.py:',
    ),
    "itself": (lambda m, a, b: m("x", tc.Sum("x", "earlier")), 'unknown measurement "x"'),
    "one measurement": (lambda m, a, b: m("x", tc.Minimum("earlier")), "expected two or more"),
    "three": (lambda m, a, b: m("x", tc.Difference(*["earlier"] * 3)), "expected two"),
    "unlike units": (
        lambda m, a, b: m("x", tc.Sum("earlier", tc.Angle(a.face("+z"), b.face(ROUND)))), "mm and rad; expected the same units",
    ),
    "other units": (lambda m, a, b: m("x", tc.Angle(a.face("+z"), b.face(ROUND)), units="grad"), "in rad; leave units out"),
    "one part": (lambda m, a, b: m("x", tc.Angle(a.face("+z"), a.face("+x"))), 'within part "table"'),
    "no axis": (lambda m, a, b: m("x", tc.AxisDistance(a.face("+z"), b.face(ROUND))), "table +z is a plane, which has no axis"),
    "parallel plane": (
        lambda m, a, b: m("x", tc.AxisDistance(b.face(ROUND), a.feature("s", a.face("+z")), across="x")), "has no axis",
    ),
    "parallel about": (
        lambda m, a, b: m("x", tc.Angle(a.face("+z"), b.face(ROUND), about="z")), "is parallel to the direction that",
    ),
    "no direction": (lambda m, a, b: m("x", tc.Angle(a.face("+z"), b.face(ROUND), about=(0, 0, 0))), "about is (0, 0, 0); "),
    "both": (
        lambda m, a, b: m("x", tc.AxisDistance(b.face(ROUND), b.face(ROUND), along="x", across="z")), "give one of them",
    ),
    "no face": (lambda m, a, b: m("x", tc.Clearance(a.face("+z"), b.point(0, 0, 0))), "second is a Point; expected part.face"),
    "no station": (lambda m, a, b: m("x", tc.Gap(a.face("+z"), b.face(ROUND))), "station is a Face; it takes a point"),
    "no measurement": (lambda m, a, b: m("x", tc.Minimum("earlier", 3)), "int is no measurement"),
    "nested": (lambda m, a, b: m("x", nested(9, tc.Gap(a.point(0, 0, 0), b.face(ROUND)))), "nested more than 8 deep"),
    "no triangles": (lambda m, a, b: m("x", tc.Gap(a.point(0, 0, 0), b.face("+x"))), "no triangle"),
    "everywhere": (lambda m, a, b: m("x", tc.Angle(a.face(), b.face(ROUND))), "more than one surface"),
    "beside": (
        lambda m, a, b: m("x", tc.Clearance(a.face("+x"), b.face("-z"))), "do not face each other",
    ),
    "nowhere": (
        lambda m, a, b: m("x", tc.Clearance(a.face("+z", tc.select.Inside((60, 30, 0), (100, 50, 20))), b.face("-z"))),
        "lie nowhere over each other",
    ),
    "along": (lambda m, a, b: m("x", tc.Gap(a.point(0, 0, 0), b.face(ROUND)), along="z"), "leave out to and along"),
    "absolute": (lambda m, a, b: m("x", tc.Gap(a.point(0, 0, 0), b.face(ROUND)), absolute=True), "leave it out"),
    "two parts": (lambda m, a, b: tc.stations(a.point(0, 0, 0), b.point(0, 0, 0), 3), "not points of one part"),
    "one station": (lambda m, a, b: tc.stations(a.point(0, 0, 0), a.point(1, 0, 0), 1), "a whole number from 2"),
    "a stranger": (
        lambda m, a, b: m("x", tc.Gap(tc.Assembly("o").part("other", PLANE).point(0, 0, 0), a.face("+z"))),
        'unknown part "other"',
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_each_bad_measurement_gets_one_message(case):
    build, expected = BAD[case]
    message = faults_of(build)
    assert expected in message
    assert message.count("\n") <= 1 + (case == "a cycle")


def test_a_plane_that_no_axis_pierces_is_refused():
    assembly, first, second = two(ring(), ring(), at=(30, 0, 0), first_rotation=(0, 0, 0))
    assembly.measure("x", tc.AxisDistance(hole(first), hole(second), across="x"))
    with pytest.raises(tc.ModelError, match="parallel to the plane that is to cut it; choose another direction across"):
        tc.build(assembly)


def refused(folder):
    """What `check` says of a model, in one line."""
    done = call(folder, "check", "model.json")
    assert done.returncode == 2 and "Traceback" not in done.stderr
    return " ".join((done.stdout + done.stderr).split())


@pytest.mark.parametrize(
    ("entry", "expected"),
    [
        ({"kind": "gape", "face": 1}, "a point, or a measurement whose kind is one of gap, flush, clearance"),
        ({"kind": "gap", "station": {"part": "table", "position": [0, 0, 0]}}, "it has no 'face'"),
        ({"kind": "minimum", "measurements": ["later", "gap 0"]}, 'unknown measurement "later"'),
        ({"kind": "minimum", "measurements": [{"kind": "point"}, "gap 0"]}, "the name of a measurement, or a measurement"),
        ({"kind": "angle", "first": {"part": "table"}, "second": {"part": "nobody"}}, "the name of a part"),
    ],
)
def test_entries_of_strangers_are_refused(tmp_path, entry, expected):
    tc.io.write_model(seated(), tmp_path / "model.json")
    document = json.loads((tmp_path / "model.json").read_text())
    document["measures"][1]["of"] = entry
    (tmp_path / "model.json").write_text(json.dumps(document))
    assert expected in refused(tmp_path)


def test_deep_nesting_is_refused(tmp_path):
    tc.io.write_model(seated(), tmp_path / "model.json")
    document = json.loads((tmp_path / "model.json").read_text())
    for _ in range(100):
        document["measures"][-1]["of"] = {"kind": "sum", "measurements": [document["measures"][-1]["of"], "turn"]}
    (tmp_path / "model.json").write_text(json.dumps(document))
    assert "nested too deeply" in refused(tmp_path)
