"""Insides of `simulation` under the claims of `tests/test_lazy.py`."""

import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tolcontact.simulation.cluster import local_cluster
from tolcontact.simulation.lazy import CHUNK_BLOCKS
from tolcontact.simulation.packing import pack_model, packed_program


@pytest.mark.nightly
@pytest.mark.slow
def test_workers_compute_the_same():
    program = tc.build(cases.ra1(), solver="qpoases")
    found = tc.simulate(program, CHUNK_BLOCKS * 4096 + 100, seed=5).measured
    here = found.values
    with local_cluster(2):
        assert np.array_equal(found.values, here)


def test_the_process_that_asks_does_not_compile_again():
    a = tc.Assembly("asked for once")
    a.measure("corner", a.part("plate", tc.Box(100, 50, 10), fixed=True).point(100, 50, 10), along="z")
    program = tc.build(a)
    tc.simulate(program, 10)
    assert packed_program(pack_model(program)) is program
