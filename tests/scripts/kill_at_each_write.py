"""Kill a run at each call of its writer, or each nth, and resume what it left: kill_at_each_write.py FOLDER [n [stations]].

A profile function counts the calls in the modules that write an archive or its journal.
"""

import itertools
import os
import signal
import sys
import threading
from pathlib import Path

from tests import cases
from tests.cases import stations
from tests.helpers import compiled, contents
from tolcontact.archive import Run, locked_archive
from tolcontact.workflow.runs import write_archive

folder, step = Path(sys.argv[1]), int((*sys.argv, 1)[2])
whole = folder / "whole.nc"
CHECKPOINT = 4096  # realizations from one to the next
program = compiled(stations.rail() if "stations" in sys.argv else cases.one_dimensional(2), solver="daqp")


WRITERS = ("archive/writer.py", "archive/journal.py", "archive/variables.py", "tolcontact/replacing.py")
settings = Run(seed=3, samples=8200, keep="measures", surfaces=4, fields="some", checkpoint_interval=0.0)


def die_at(write):
    """Let this process die at a call that writes an archive or its journal, counted from 1: of whatever their modules call."""
    left = itertools.count(write - 1, -1)

    def profile(frame, event, _):
        if event in ("call", "c_call") and frame.f_code.co_filename.endswith(WRITERS) and next(left) == 0:
            os.kill(os.getpid(), signal.SIGKILL)

    threading.setprofile(profile)
    sys.setprofile(profile)


def is_killed(path, write):
    """Whether a run that would die at a write, counted from 1, came so far."""
    child = os.fork()
    if child == 0:
        die_at(write)
        write_archive(path, program, settings)
        os._exit(0)
    return os.waitpid(child, 0)[1] != 0


def resumed(path):
    """Where a killed run goes on, after the realizations of its last checkpoint; it comes to the same as an undisturbed one."""
    begun = []
    with locked_archive(path, resume=True):
        write_archive(path, program, settings, progress=begun.append, is_resumed=path.exists())
    for group in (None, *(f"field/{part.name}" for part in program.nominal.last_parts)):
        assert contents(path, group).identical(contents(whole, group)), f"{group} of {path.name}"
    assert not [file.name for file in folder.iterdir() if file.name.startswith(".")], f"left by {path.name}"
    return (begun[0] - 1) // CHECKPOINT * CHECKPOINT


def reached_at(write):
    """The last checkpoint of a run that is killed at a write; None for a run that ends before it."""
    path = folder / f"{write}.nc"
    return resumed(path) if is_killed(path, write) else None


def fill_between(first, last):
    """Kill between two writes as well, as long as a checkpoint that lies between theirs was never the last one."""
    if last - first > 1 and reached[last] - reached[first] > CHECKPOINT:
        middle = (first + last) // 2
        reached[middle] = reached_at(middle)
        fill_between(first, middle)
        fill_between(middle, last)


write_archive(whole, program, settings)
reached = {}
for write in itertools.count(1, step):
    checkpoint = reached_at(write)
    if checkpoint is None:
        break
    reached[write] = checkpoint
for first, last in itertools.pairwise(list(reached)):
    fill_between(first, last)
order = [reached[write] for write in sorted(reached)]
assert write > 100 and order == sorted(order) and set(order) == {0, CHECKPOINT, 2 * CHECKPOINT}, (write, reached)
