"""Insides of `report` under the claims of `tests/test_measurements.py`."""

import numpy as np

import tolcontact as tc
from tests.cases.measured import drilled, hole
from tolcontact.report.annotations import marks_of, marks_of_nominal


def test_lines_show_what_is_measured(tmp_path):
    model, left, right = drilled()
    point = model.measure("point", left.point(1, 2, 3), along="z")
    model.measure("distance", tc.AxisDistance(hole(left), hole(right), across="z"))
    model.measure("gap", tc.Gap(left.point(0, 8, 6), right.face("+z")))
    model.measure("least", tc.Minimum(point, "gap"))
    results = tc.run(model, samples=5, solver="daqp", surfaces=0, out=tmp_path / "run.nc")
    marks = {mark["name"]: mark for mark in marks_of(results).measures}
    nominal = {mark["name"]: mark for mark in marks_of_nominal(tc.build(model).nominal).measures}
    assert all(marks[name]["lines"] == nominal[name]["lines"] and marks[name]["at"] == nominal[name]["at"] for name in marks)
    assert list(marks) == list(nominal)
    assert np.allclose(marks["distance"]["lines"][2], [[0, 0, 0], [30, 0, 0]]) and marks["point"]["points"] == [[1, 2, 3]]
    assert np.allclose(marks["gap"]["lines"], [[[0, 8, 6], [0, 8, 6]]])
    assert marks["least"]["points"] == [[1, 2, 3], [0, 8, 6]]
