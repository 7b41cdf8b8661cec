"""Insides of `mechanics` under the claims of `tests/test_quiet.py`."""

import io
import sys
import threading
from contextlib import redirect_stdout
from pathlib import Path

import pytest

from tests.helpers import run, script
from tolcontact.mechanics.quiet import quiet


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


@pytest.mark.slow
def test_printing_goes_on_while_other_threads_come_and_go():
    done = run(script(Path(__file__).with_name("print_while_muffled")))
    assert done.returncode == 0
    assert done.stdout.split() == [str(k) for k in range(20_000)]
