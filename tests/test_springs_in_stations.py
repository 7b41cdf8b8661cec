"""Springs in assemblies that are built in steps: clamps that are released, and joints on springs."""

import numpy as np
import pytest

import tolcontact as tc
from tests.helpers import simulate
from tests.test_springy_locators import AT, LENGTH, PLACES, SEATED, STIFFNESS, by_stiffness_matrix, scheme
from tolcontact.vocabulary import CORRECTED, Status

LOADS = {"clamp": 400.0, "release": 80.0}


def test_a_bar_springs_back_on_its_locators_when_a_clamp_is_released():
    line = tc.Assembly("line", method=SEATED)
    bar = line.part("bar", tc.Box(LENGTH, 20, 10))
    for name, load in LOADS.items():
        station = line.station(name)
        station.locate(bar, scheme())
        station.force(f"load of {name}", at=bar.point(AT, 10, 0), vector=(0, 0, -load))
        station.measure(f"end in {name}", bar.point(LENGTH, 10, 0), along="z")
    _, run = simulate(line, samples=50)
    assert (run["status"] == Status.RESOLVED).all()
    for k, load in enumerate(LOADS.values()):
        expected = [by_stiffness_matrix(deviations, load)[0][1] for deviations in run["deviations"][:, 7 * k : 7 * k + 3]]
        assert run["measured"][:, CORRECTED, k] == pytest.approx(expected, abs=1e-10)


def test_a_pad_springs_back_under_a_joint_when_a_clamp_is_released():
    """The joint floats on the pad of one of its blocks, which carries the force of each station by its stiffness."""
    line = tc.Assembly("line", method=SEATED)
    base = line.part("base", tc.Box(400, 300, 50), fixed=True)
    lower = line.part("lower", tc.Box(100, 60, 20), at=(100, 100, 50))
    upper = line.part("upper", tc.Box(100, 60, 20), at=(100, 100, 70))
    weld = line.station("weld")
    for block in (lower, upper):
        weld.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=0.2)
    stack = weld.join("stack", lower, upper)
    for name, load in LOADS.items():
        station = line.station(name)
        sides = {"B1": ((10, 0, 0), "y"), "B2": ((90, 0, 0), "y"), "C": ((0, 30, 0), "x")}
        held = [tc.Locator(side, lower.point(*p), along, 0.2) for side, (p, along) in sides.items()]
        station.locate(stack, held, floating=True)
        station.contact(f"pad of {name}", moving=lower.face("-z"), reference=base.face("+z"), stiffness=2000)
        station.force(f"load of {name}", at=lower.point(50, 30, 0), vector=(0, 0, -load))
        station.measure(f"middle in {name}", lower.point(50, 30, 0), along="z")
    _, run = simulate(line, samples=20)
    assert (run["status"] == Status.RESOLVED).all()
    for k, load in enumerate(LOADS.values()):
        assert run["measured"][:, CORRECTED, k] == pytest.approx(-load / 2000, abs=1e-6)


def test_a_joint_on_springs_keeps_its_shape_and_is_in_balance():
    """Two bars are welded as their locators left them; the rail then lies on three springs at points of both."""
    line = tc.Assembly("line", method=SEATED)
    left = line.part("left", tc.Box(200, 20, 10))
    right = line.part("right", tc.Box(200, 20, 10), at=(200, 0, 0))
    weld = line.station("weld")
    sides = [("B1", (50, 0, 0), "y"), ("B2", (150, 0, 0), "y"), ("B3", (100, 0, 10), "y"), ("C", (0, 10, 0), "x")]
    for bar in (left, right):
        ends = [tc.Locator(f"A{x}", (x, 10, 0), "z", 0.3) for x in (10, 190)]
        weld.locate(bar, [*ends, *(tc.Locator(*side, 1e-9) for side in sides)])
    rail = weld.join("rail", left, right)

    def place(x, y=10, z=0):
        return left.point(x, y, z) if x < 200 else right.point(x - 200, y, z)

    check = line.station("check")
    springs = [
        tc.Locator(f"S{k}", place(x), "z", 0.6, one_sided=k == 1, stiffness=stiffness)
        for k, (x, stiffness) in enumerate(zip(PLACES, STIFFNESS, strict=True))
    ]
    ends = [("B1", place(50, 0), "y"), ("B2", place(350, 0), "y"), ("B3", place(199, 0, 10), "y"), ("C", place(0), "x")]
    check.locate(rail, [*springs, *(tc.Locator(*end, 1e-9) for end in ends)])
    check.force("load", at=place(AT), vector=(0, 0, -80))
    check.measure("end", place(LENGTH), along="z")
    _, run = simulate(line, samples=50)
    assert (run["status"] == Status.RESOLVED).all()
    forces = run["reaction"][:, [1, 0, 2]]
    assert forces.sum(axis=1) == pytest.approx(80, abs=1e-4)
    assert forces @ PLACES == pytest.approx(80 * AT, rel=1e-4)
    welded = run["deviations"][:, [0, 1, 6, 7]]  # heights of the four ends, of which each spring meets a line
    lines = [(welded[:, 0], welded[:, 1], 10.0), (welded[:, 2], welded[:, 3], 210.0)]

    def shape(x):
        low, high, start = lines[int(x >= 200)]
        return low + (high - low) * (x - start) / 180

    met = run["deviations"][:, 12:15] - np.column_stack([shape(x) for x in PLACES])
    expected = [by_stiffness_matrix(deviations, 80.0)[0][1] for deviations in met] + shape(LENGTH)
    assert run["measured"][:, CORRECTED, 0] == pytest.approx(expected, abs=1e-4)
