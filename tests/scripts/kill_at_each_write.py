"""Kill a run before each of its writes, or each nth, and resume what it left: kill_at_each_write.py FOLDER [n [stations]].

The writes counted are those of the interpreter to an open archive, whoever makes them: a profile function sees every call.
"""

import itertools
import os
import signal
import sys
from pathlib import Path

import tolcontact as tc
from tests import cases
from tests.cases import stations
from tests.helpers import contents
from tolcontact.archive import Run
from tolcontact.workflow.runs import write_archive

folder, step = Path(sys.argv[1]), int((*sys.argv, 1)[2])
whole = folder / "whole.nc"
program = tc.build(stations.rail() if "stations" in sys.argv else cases.stack(), solver="daqp")


settings = Run(seed=3, samples=9000, keep="measures", surfaces=4, fields="some", checkpoint_interval=0.0)


def die_at(path, write):
    """Let this process die at a write to a file, counted from 1."""
    left = itertools.count(write - 1, -1)

    def profile(_, event, function):
        is_write = event == "c_call" and getattr(function, "__name__", "") == "write"
        if is_write and str(getattr(function.__self__, "name", "")) == str(path) and next(left) == 0:
            os.kill(os.getpid(), signal.SIGKILL)

    sys.setprofile(profile)


def is_killed(path, write):
    """Whether a run that would die at a write, counted from 1, came so far."""
    child = os.fork()
    if child == 0:
        die_at(path, write)
        write_archive(path, program, settings)
        os._exit(0)
    return os.waitpid(child, 0)[1] != 0


def check_left(path, write):
    """What a killed run left is what an undisturbed one has there."""
    with tc.open_archive(path) as left, tc.open_archive(whole) as undisturbed:
        done = left["status"].values != -1
        assert (left["measured"].values[done] == undisturbed["measured"].values[done]).all(), f"rows after kill {write}"


def check_resumed(path, write):
    """Resumed it comes to the same, and goes on after the last checkpoint."""
    with tc.open_archive(path) as left:
        summed = max(0, left["summed_rows"].values.max())
    begun = []
    write_archive(path, program, settings, progress=begun.append, is_resumed=True)
    assert begun[0] == min(summed + 4096, 9000), f"kill {write}: began at {begun[0]}"
    reached.append(summed)
    for group in (None, *(f"field/{part.name}" for part in program.nominal.last_parts)):
        assert contents(path, group).identical(contents(whole, group)), f"{group} after kill {write}"


reached = []
write_archive(whole, program, settings)
for write in itertools.count(1, step):
    path = folder / f"{write}.nc"
    if not is_killed(path, write):
        break
    check_left(path, write)
    check_resumed(path, write)
assert write > 100 and reached == sorted(reached) and set(reached) == {0, 4096, 8192}, (write, reached)
