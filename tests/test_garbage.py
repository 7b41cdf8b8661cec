"""What nobody refers to any more is collected by the thread that writes the archive."""

import gc
import threading

import pytest

import tolcontact as tc
from tests import cases

COLLECTED_BY = []


class Results:
    """Something in a circle, as results are: only the collector finds it."""

    def __init__(self):
        self.own = self

    def __del__(self):
        COLLECTED_BY.append(threading.current_thread())


def test_garbage_is_collected_by_the_thread_that_writes(tmp_path):
    COLLECTED_BY.clear()
    tc.run(
        cases.ra1(), samples=60_000, solver="daqp", out=tmp_path / "ra1.nc", surfaces=0, progress=lambda _: Results()
    ).close()
    gc.collect()
    assert len(COLLECTED_BY) == 15
    assert set(COLLECTED_BY) == {threading.main_thread()}


@pytest.mark.parametrize("error", [None, LookupError])
def test_collection_is_as_before_after_a_run(error):
    def stop(_):
        assert not gc.isenabled()
        if error:
            raise error

    if error:
        with pytest.raises(error):
            tc.run(cases.ra1(), samples=100, solver="daqp", surfaces=0, progress=stop)
    else:
        tc.run(cases.ra1(), samples=100, solver="daqp", surfaces=0, progress=stop)
    assert gc.isenabled()
