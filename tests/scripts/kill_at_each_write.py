"""Kill a run at each of its writes, and resume what it left: kill_at_each_write.py FOLDER before|after.

Told "before", it is killed before a write reaches the file, told "after", behind it.
"""

import itertools
import os
import sys
from pathlib import Path

import netCDF4

import tolcontact as tc
from tests import cases
from tests.helpers import contents

WRITES = 12
folder, before = Path(sys.argv[1]), sys.argv[2] == "before"
whole = folder / "whole.nc"
program = tc.build(cases.stack(), solver="daqp")


def run(path, **options):
    tc.run(program, samples=9000, seed=3, out=path, keep="measures", surfaces=4, **options).close()


class Dying(netCDF4.Dataset):
    """A file whose process dies at one of its writes."""

    left = 0

    def sync(self):
        Dying.left -= 1
        if before and Dying.left == 0:
            os._exit(9)
        super().sync()
        if Dying.left == 0:
            os._exit(9)


def is_killed(path, write):
    """Whether a run that would die at a write, counted from 1, came so far."""
    child = os.fork()
    if child == 0:
        Dying.left, netCDF4.Dataset = write, Dying
        run(path)
        os._exit(0)
    return os.waitpid(child, 0)[1] != 0


def check_left(path, write):
    """What a killed run left is what an undisturbed one has there."""
    with tc.open_archive(path) as left, tc.open_archive(whole) as undisturbed:
        done = left["status"].values != -1
        assert (left["measured"].values[done] == undisturbed["measured"].values[done]).all(), f"rows after kill {write}"


def check_resumed(path, write):
    """Resumed it comes to the same, and does not begin anew."""
    begun = []
    run(path, resume=True, progress=begun.append)
    assert begun[0] > 4096 or write <= 2, f"kill {write}: began at {begun[0]}"
    for group in (None, "field/middle", "field/upper"):
        assert contents(path, group).identical(contents(whole, group)), f"{group} after kill {write}"


run(whole)
for write in itertools.count(1):
    path = folder / f"{write}.nc"
    if not is_killed(path, write):
        break
    check_left(path, write)
    check_resumed(path, write)
assert write == WRITES + 1, write - 1
