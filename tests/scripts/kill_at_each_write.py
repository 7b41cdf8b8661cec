"""Kill a run before each of its writes, or each nth, and resume what it left: kill_at_each_write.py FOLDER [n]."""

import itertools
import os
import sys
from pathlib import Path

import tolcontact as tc
from tests import cases
from tests.helpers import contents
from tolcontact.archive import raw_file, writer

writer.ArchiveWriter.checkpoint_interval = 0.0
folder, step = Path(sys.argv[1]), int((*sys.argv, 1)[2])
whole = folder / "whole.nc"
program = tc.build(cases.stack(), solver="daqp")


def run(path, **options):
    tc.run(program, samples=9000, seed=3, out=path, keep="measures", surfaces=4, **options).close()


class Dying(raw_file.LaidOut):
    """A file whose process dies at one of its writes."""

    left = 0

    def _write(self, offset, data):
        Dying.left -= 1
        if Dying.left == 0:
            os._exit(9)
        super()._write(offset, data)


def is_killed(path, write):
    """Whether a run that would die at a write, counted from 1, came so far."""
    child = os.fork()
    if child == 0:
        Dying.left, writer.LaidOut = write, Dying
        run(path)
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
    run(path, resume=True, progress=begun.append)
    assert begun[0] == min(summed + 4096, 9000), f"kill {write}: began at {begun[0]}"
    reached.append(summed)
    for group in (None, "field/middle", "field/upper"):
        assert contents(path, group).identical(contents(whole, group)), f"{group} after kill {write}"


reached = []
run(whole)
for write in itertools.count(1, step):
    path = folder / f"{write}.nc"
    if not is_killed(path, write):
        break
    check_left(path, write)
    check_resumed(path, write)
assert write > 100 and reached == sorted(reached) and set(reached) == {0, 4096, 8192}, (write, reached)
