"""Solvers print nothing, whatever becomes of their problems, and what users print is not lost."""

import ctypes
import os

import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import SEATED, SEATED_ON_POINTS, compiled, nightly, realizations, run, script
from tolcontact.compilation import usable_solvers


@pytest.mark.slow
@pytest.mark.parametrize(
    ("solver", "samples", "method"),
    [
        ("daqp", 4, SEATED_ON_POINTS),
        ("qpoases", 40, SEATED_ON_POINTS),  # it fails to solve some of these problems
        *nightly(("qpoases", 300, SEATED), *((name, 4, SEATED) for name in usable_solvers() if name != "qpoases")),
    ],
)
@pytest.mark.parametrize("case", ["block on six", *nightly("parked")])
def test_solvers_print_nothing(solver, samples, method, case, capfd):
    a = {"block on six": lambda: cases.block_on_six(1.0), "parked": cases.shaft_in_a_v}[case]()
    realizations(compiled(a, solver=solver, method=method), samples=samples, seed=1)
    assert capfd.readouterr() == ("", "")


def test_the_worst_case_prints_nothing(capfd):
    """HiGHS prints a line of its own at an integer program of the shift."""
    a = tc.Assembly("a block on a table")
    table = a.part("table", tc.Box(100, 50, 10), fixed=True)
    block = a.part("block", tc.Box(50, 25, 10), at=(40, 12.5, 10))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=0.5)
    a.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
    a.measure("height", block.point(50, 0, 10), along="z")
    a.measure("shift", block.point(0, 0, 10), along="x")
    tc.analyses.worst_case(a, solver="daqp")
    if os.name == "posix":
        ctypes.CDLL(None).fflush(None)
    assert capfd.readouterr() == ("", "")


def test_what_a_users_measure_prints_is_not_lost(capsys):
    a = cases.ra1(points=9)

    def tilt(poses):
        print("called")
        return poses.rotation(a.parts[1])[2, 0]

    a.measure("tilt", tilt, units="rad")
    compiled(a)
    assert capsys.readouterr().out == "called\n"


@pytest.mark.slow
def test_it_runs_without_streams():
    assert run(script("run_without_streams")).returncode == 0
