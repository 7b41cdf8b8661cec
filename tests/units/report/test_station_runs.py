"""Insides of `report` under the claims of `tests/test_station_runs.py`."""

import numpy as np

import tolcontact as tc
from tests.cases import stations as cases
from tolcontact.report.model_tables import model_tables


def test_declarations_of_stations_may_stand_in_any_order():
    line = cases.rail()
    a, b, c = line.parts
    weld, check = line.stations
    spare = line.part("spare", tc.Box(100, 5, 10), at=(60, -5, 10), fixed=True)
    check.contact("after", moving=c.face("-x"), reference=b.face("+x"), points=10, within=20)
    weld.contact("before", moving=b.face("-y"), reference=spare.face("+y"), points=30)
    weld.measure("late", a.point(100, 0, 10), along="z", tolerance=0.25)
    results = tc.run(line, samples=20, solver="daqp", surfaces=0)
    assert results.measure.values.tolist() == ["step", "late", "flush"]
    assert results.pair.values.tolist() == ["lap", "before", "after"]
    tables = {table.title: table.rows for table in model_tables(results)}
    points = np.bincount(results["contact"].pair_of_point.values)
    assert [(row[0], row[3]) for row in tables["Contact pairs"]] == list(zip(results.pair.values, points, strict=True))
    assert [(row[0], row[-1]) for row in tables["Measurements"]] == [("step", None), ("late", 0.125), ("flush", None)]
    assert [part.name for part in tc.build(line).nominal.scenes[0].assembly.parts] == ["a", "b", "spare"]
