"""Solvers print nothing, whatever becomes of their problems, and what users print is not lost."""

import ctypes
import io
import os
import sys
import threading
from contextlib import redirect_stdout

import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import SEATED, compiled, nightly, run, script
from tolcontact.analyses.farthest_pose import muted_c_stdout
from tolcontact.compilation import usable_solvers
from tolcontact.mechanics.quiet import quiet


@pytest.mark.slow
@pytest.mark.parametrize(
    ("solver", "samples"),
    [
        ("daqp", 4),
        ("qpoases", 40),
        *nightly(("qpoases", 300), *((name, 4) for name in usable_solvers() if name not in ("daqp", "qpoases"))),
    ],
)
@pytest.mark.parametrize("case", ["block on six", *nightly("parked")])
def test_solvers_print_nothing(solver, samples, case, capfd):
    a = {"block on six": lambda: cases.block_on_six(1.0), "parked": cases.shaft_in_a_v}[case]()
    tc.run(compiled(a, solver=solver, method=SEATED), samples=samples, seed=1, surfaces=0)
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
    ctypes.CDLL(None).fflush(None)
    assert capfd.readouterr() == ("", "")


def test_only_c_code_is_muted_and_only_while_a_thread_is_inside(capfd):
    library = ctypes.CDLL(None)
    entered, printed = threading.Event(), threading.Event()

    def muted():
        with muted_c_stdout():
            library.puts(b"a solver's line")
            entered.set()
            printed.wait(10)
            library.puts(b"another line")

    worker = threading.Thread(target=muted)
    worker.start()
    entered.wait(10)
    with muted_c_stdout():
        library.puts(b"a second solver's line")
        os.write(1, b"a user's line\n")
    printed.set()
    worker.join()
    library.puts(b"the end")
    library.fflush(None)
    assert capfd.readouterr() == ("a user's line\nthe end\n", "")


def test_what_other_threads_print_is_not_lost(capsys):
    entered, printed = threading.Event(), threading.Event()

    def muffled():
        with quiet():
            print("a plugin's banner")
            entered.set()
            printed.wait(10)
            print("a plugin's error", file=sys.stderr)

    worker = threading.Thread(target=muffled)
    worker.start()
    entered.wait(10)
    print("a user's line")
    printed.set()
    worker.join()
    print("the end")
    assert capsys.readouterr() == ("a user's line\nthe end\n", "")


def test_streams_that_are_replaced_meanwhile_are_left_in_order():
    before, text = sys.stdout, io.StringIO()
    with quiet():
        with redirect_stdout(text), quiet():
            print("muffled")
        print("and this")
    assert sys.stdout is before and not text.getvalue()
    with redirect_stdout(text):
        with quiet():
            pass
        print("heard")
    assert sys.stdout is before and text.getvalue() == "heard\n"


def test_what_a_users_measure_prints_is_not_lost(capsys):
    a = cases.ra1(points=9)

    def tilt(poses):
        print("called")
        return poses.rotation(a.parts[1])[2, 0]

    a.measure("tilt", tilt, units="rad")
    tc.build(a)
    assert capsys.readouterr().out == "called\n"


@pytest.mark.slow
def test_it_runs_without_streams():
    assert run(script("run_without_streams")).returncode == 0


@pytest.mark.slow
def test_printing_goes_on_while_other_threads_come_and_go():
    done = run(script("print_while_muffled"))
    assert done.returncode == 0
    assert done.stdout.split() == [str(k) for k in range(20_000)]
