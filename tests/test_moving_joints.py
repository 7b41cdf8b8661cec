"""Joints that contact moves: all of their parts move together, and each of their faces may touch."""

import numpy as np
import pytest

import tolcontact as tc
from tests.cases import stations as cases
from tests.helpers import compiled
from tolcontact.simulation import simulate_block
from tolcontact.vocabulary import CORRECTED, RAW, Status

SIGMA = 0.1


def simulated(line, samples=300, solver="daqp", **options):
    program = compiled(line, solver=solver, **options)
    return program, next(iter(tc.simulate_blocks(program, samples=samples, seed=1)))


def welded(line, **options):
    """Two plates side by side, which are joined as they stand."""
    left = line.part("left", tc.Box(50, 100, 5), **options)
    right = line.part("right", tc.Box(50, 100, 5), at=(50, 0, 0), **options)
    weld = line.station("weld")
    for part in (left, right):
        weld.locate(part, cases.box_scheme(part), tolerance=0)
    return left, right, weld.join("table", left, right)


def stops(left, right):
    return [
        tc.Locator("B1", left.point(10, 0, 2), "y", 0.0),
        tc.Locator("B2", right.point(40, 0, 2), "y", 0.0),
        tc.Locator("C", left.point(0, 50, 2), "x", 0.0),
    ]


@pytest.mark.parametrize("solver", ["daqp", "graph"])
def test_contact_of_one_part_moves_the_whole_joint(solver):
    line = tc.Assembly("press", method=tc.Method(objective="all points"))
    left, right, table = welded(line)
    press = line.station("press")
    floor = line.part("floor", tc.Box(50, 100, 5), at=(50, 0, -5), fixed=True)
    pins = [(left.point(0, 10, 0)), left.point(0, 90, 0), right.point(50, 50, 0)]
    locators = [tc.Locator(f"A{k}", point, "z", 0.0) for k, point in enumerate(pins)]
    press.locate(table, [*locators, *stops(left, right)])
    line.variable("height", 6 * SIGMA, drives={f"press.table.A{k}": 1.0 for k in range(3)})
    press.contact("on the floor", moving=right.face("-z"), reference=floor.face("+z"))
    press.measure("far", left.point(0, 0, 5), along="z")
    press.measure("near", right.point(50, 100, 5), along="z")
    program, block = simulated(line, solver=solver)
    height = block.deviations[:, program.nominal.contributors.index("height")]
    for measure in range(2):
        assert np.abs(block.measured[:, RAW, measure] - height).max() < 1e-12
        assert np.abs(block.measured[:, CORRECTED, measure] - np.maximum(height, 0)).max() < 1e-8
    assert ((block.status == Status.RESOLVED) == (height < 0)).all()


def test_a_joint_seats_itself_on_supports_under_all_of_its_parts():
    """The weight in the middle lies on one of both diagonals: on the higher one."""
    line = tc.Assembly("seat", method=tc.Method(objective="seating"))
    left, right, table = welded(line)
    seat = line.station("seat")
    places = [left.point(0, 0, 0), right.point(50, 0, 0), right.point(50, 100, 0), left.point(0, 100, 0)]
    legs = [tc.Locator(f"leg {k}", point, "z", 6 * SIGMA, one_sided=True) for k, point in enumerate(places)]
    seat.locate(table, [*legs, *stops(left, right)])
    seat.force("weight", at=left.point(50, 50, 2.5), vector=(0, 0, -100))
    seat.measure("middle", right.point(0, 50, 0), along="z")
    program, block = simulated(line, samples=200)
    assert [pair.name for pair in program.nominal.pairs] == ["supports of left in seat", "supports of right in seat"]
    d = block.deviations[:, [program.nominal.contributors.index(f"seat.table.leg {k}") for k in range(4)]]
    expected = np.maximum((d[:, 0] + d[:, 2]) / 2, (d[:, 1] + d[:, 3]) / 2)
    assert (block.status == Status.RESOLVED).all()
    assert np.abs(block.measured[:, CORRECTED, 0] - expected).max() < 1e-4


def test_the_poses_of_a_moved_joint_keep_its_shape():
    line = cases.three_stations(1.0)
    check = line.stations[-1]
    floor = line.part("floor", tc.Box(300, 100, 5), at=(-20, -20, -5), fixed=True)
    a, b = line.parts[:2]
    check.contact("floor", moving=a.face("-z"), reference=floor.face("+z"))
    check.contact(
        "side", moving=b.face("+z"), reference=line.part("lid", tc.Box(300, 100, 5), at=(-20, -20, 20.2), fixed=True).face("-z")
    )
    program, block = simulated(line, samples=40)
    names = [measure.name for measure in program.nominal.measures]
    before, after = (block.measured[:, :, names.index(f"{station} a to b")] for station in ("tack", "check"))
    assert np.abs(after - before).max() < 1e-12
    assert (block.station_status[:, 2] > 0).mean() > 0.5


def whole(objective):
    """The same plate of one part, in an assembly without stations, and its joint of two parts, over a floor under one half."""
    models = []
    for joined in (False, True):
        line = tc.Assembly("plate", method=tc.Method(objective=objective))
        if joined:
            left, right, body = welded(line, fixed=False)
            station, shift = line.station("press"), 50
        else:
            left = right = body = line.part("plate", tc.Box(100, 100, 5), fixed=False)
            station, shift = line, 0
        floor = line.part("floor", tc.Box(49, 100, 5), at=(51, 0, -5), fixed=True)
        pins = [left.point(0, 10, 0), left.point(0, 90, 0), right.point(100 - shift, 50, 0)]
        locators = [tc.Locator(f"A{k}", p, "z", stiffness=1.0 + k) for k, p in enumerate(pins)]
        sides = [tc.Locator("B1", left.point(10, 0, 2), "y"), tc.Locator("B2", right.point(90 - shift, 0, 2), "y")]
        scheme = [*locators, *sides, tc.Locator("C", left.point(0, 50, 2), "x")]
        station.locate(body, scheme, tolerance=6 * SIGMA)
        station.contact("floor", moving=floor.face("+z"), reference=right.face("-z"), points=60)
        station.measure("left", left.point(0, 0, 5), along="z")
        station.measure("right", right.point(100 - shift, 100, 5), along="z")
        models.append(line)
    return models


@pytest.mark.parametrize("objective", ["all points", "active points", "locator stiffness"])
def test_a_joint_moves_as_one_part_of_its_shape_does(objective):
    single, joint = (compiled(model, solver="daqp") for model in whole(objective))
    d = single.draws(seed=1, start=0, stop=100)
    deviations = np.zeros((100, len(joint.nominal.contributors)))
    deviations[:, -6:] = d
    assert [label.rpartition(".")[2] for label in joint.nominal.contributors[-6:]] == ["A0", "A1", "A2", "B1", "B2", "C"]
    expected, actual = simulate_block(single, d).measured, simulate_block(joint, deviations).measured
    assert np.abs(actual - expected).max() < 1e-7
    assert np.abs(expected[:, CORRECTED] - expected[:, RAW]).max() > 0.01
