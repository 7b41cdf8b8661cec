"""Insides of `analyses` under the claims of `tests/test_quiet.py`."""

import ctypes
import os
import threading

from tests.helpers import posix_only
from tolcontact.analyses.farthest_pose import muted_c_stdout


@posix_only
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
