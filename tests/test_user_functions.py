"""Functions of users: whatever they do ends in one message, and nothing of it stays."""

import os
import signal
import sys
import warnings
from pathlib import Path

import casadi
import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tolcontact.user_functions import FunctionError, called


def leave_a_mess():
    os.chdir("/")
    sys.stdout = None
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    np.seterr(all="raise")
    warnings.simplefilter("error")
    sys.setrecursionlimit(100)
    sys.path.clear()
    return 3


def state():
    handler = signal.getsignal(signal.SIGINT)
    return Path.cwd(), sys.stdout, handler, np.geterr(), list(warnings.filters), sys.getrecursionlimit(), list(sys.path)


@pytest.mark.parametrize("ending", [leave_a_mess, lambda: [leave_a_mess(), 1 / 0]], ids=["returns", "fails"])
def test_a_users_function_leaves_nothing_behind(ending):
    before = state()
    try:
        assert called(ending) == 3
    except FunctionError as error:
        assert str(error) == "failed with ZeroDivisionError: division by zero"
    assert state() == before


def raise_own():
    raise type("Own", (BaseException,), {})("a\nb")


@pytest.mark.parametrize("function, words", [
    (lambda poses: sys.exit(0), r"ended the program with sys\.exit\(0\)"),
    (lambda poses: raise_own(), "failed with Own: a$"),
    (lambda poses: casadi.SX.sym("x"), r"returned an expression of symbols of its own \(x\); expected poses alone"),
    (lambda poses: "text", "failed with NotImplementedError"),
], ids=["exit", "own", "symbol", "text"])  # fmt: skip
def test_whatever_a_measurement_does_is_one_fault(function, words):
    model = cases.stack()
    model.measure("own", function, units="mm")
    with pytest.raises(tc.ModelError, match=f'measurement "own" .*: its function {words}'):
        tc.build(model)


def test_a_function_declares_nothing():
    model = cases.stack()
    model.measure("own", lambda poses: model.part("late", tc.Box(1, 1, 1)), units="mm")
    with pytest.raises(tc.ModelError, match=r"declares something while .*; declare it before, in assembly\(\)"):
        tc.build(model)
    assert "late" not in [part.name for part in model.parts]
