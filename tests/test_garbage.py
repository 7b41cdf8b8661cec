"""Results that nobody refers to any more may be collected, and their files closed, by any thread during a run."""

import gc
import threading

import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tests.helpers import PAPER, compiled, nightly
from tolcontact.archive import ArchiveWriter, Run
from tolcontact.statistics import DisplacementFields
from tolcontact.testing import assert_gaps_recompute


class Results:
    """A circle, as results are: only the collector finds it."""

    def __init__(self, path, collected_by):
        self.own, self.collected_by, self.tree = self, collected_by, xr.open_datatree(path, engine="netcdf4")
        self.tree["measured"].load()

    def __del__(self):
        self.collected_by.add(threading.current_thread())


@pytest.fixture
def left(archive):
    """Results in a list; another thread collects those that are taken out of it, at once."""
    collected_by, done = set(), threading.Event()

    def collect():
        while not done.wait(0.01):
            gc.collect()

    # xarray itself does not bear that one thread closes a file while another one opens one: all are opened before.
    gc.freeze()  # collecting takes no time that the run needs
    files = [Results(archive, collected_by) for _ in range(20)]
    collector = threading.Thread(target=collect)
    collector.start()
    yield files
    done.set()
    collector.join()
    gc.unfreeze()
    assert not files
    assert collector in collected_by


@pytest.mark.slow
def test_files_may_be_closed_by_any_thread_while_rows_are_written(tmp_path, left):
    def drop(rows):
        del left[:10]

    run = tc.run(
        compiled(cases.ra1(), solver="daqp", method=PAPER), samples=9000, out=tmp_path / "ra1.nc", surfaces=256, progress=drop
    )
    run.close()
    assert_gaps_recompute(tmp_path / "ra1.nc")


@pytest.mark.slow
@pytest.mark.parametrize("readings", [20, *nightly(150)])
def test_files_may_be_closed_by_any_thread_while_the_netcdf_library_reads(readings, tmp_path, left):
    program = compiled(cases.stack(), solver="daqp")
    sizes = DisplacementFields(program.nominal, "none").sizes
    writer = ArchiveWriter(tmp_path / "stack.nc", program, Run(1, 1000, "all", 8, "none"), sizes)
    rows, *_ = writer.rows_to_check(1)
    for _ in range(readings):
        del left[:1]
        assert (writer.rows_to_check(1)[0] == rows).all()
