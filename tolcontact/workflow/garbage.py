"""Garbage is collected by the thread that writes.

Results of before that nobody refers to any more close their netCDF file when they are collected. Python does that in whatever
thread is running, and HDF5 does not survive it while another thread writes.
"""

import contextlib
import gc
from collections.abc import Iterator

YOUNG = 1  # generations that are collected after each block: all of them would take longer than simulating it


@contextlib.contextmanager
def collected_here() -> Iterator[None]:
    """No collection but by `collect`."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def collect() -> None:
    """Collect what was recently left behind."""
    gc.collect(YOUNG)
