"""Results that nobody refers to any more may be collected, and their files closed, by any thread during a run."""

import gc
import threading

import xarray as xr

import tolcontact as tc
from tests import cases
from tolcontact.testing import assert_gaps_recompute


def test_files_may_be_closed_by_any_thread_while_an_archive_is_written(tmp_path):
    tc.run(cases.stack(), samples=100, seed=3, solver="daqp", out=tmp_path / "left.nc", surfaces=0).close()
    closed_by, done = set(), threading.Event()

    class Results:
        """A circle, as results are: only the collector finds it."""

        def __init__(self):
            self.own, self.tree = self, xr.open_datatree(tmp_path / "left.nc", engine="netcdf4")
            self.tree["measured"].load()

        def __del__(self):
            self.tree.close()
            closed_by.add(threading.current_thread())

    def collect():
        while not done.wait(0.1):
            gc.collect()

    collector = threading.Thread(target=collect)
    collector.start()
    try:
        tc.run(
            cases.ra1(), samples=30_000, solver="daqp", out=tmp_path / "ra1.nc", surfaces=0, progress=lambda _: Results()
        ).close()
    finally:
        done.set()
        collector.join()
    assert collector in closed_by
    assert_gaps_recompute(tmp_path / "ra1.nc")
