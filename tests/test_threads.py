"""Threads: the same results for any number of them, to the last bit, also where several share a block."""

import numpy as np
import pytest

from tests import cases
from tolcontact import build
from tolcontact.simulation import map_blocks, simulate_blocks

BLOCK = 2048


@pytest.fixture(scope="module")
def program():
    """RA1 with qpOASES, which starts each problem from the answer to the one before."""
    return build(cases.model("ra1"), solver="qpoases")


def test_a_later_start_gives_the_same_blocks(program):
    everything = list(simulate_blocks(program, samples=BLOCK + 700, seed=1, block=BLOCK, threads=2))
    (rest,) = simulate_blocks(program, samples=BLOCK + 700, seed=1, block=BLOCK, start=BLOCK, threads=2)
    for name, values in vars(everything[1]).items():
        np.testing.assert_array_equal(getattr(rest, name), values, err_msg=name)


@pytest.mark.parametrize("failing_start", [0, 500])
def test_an_error_in_any_piece_ends_the_run(program, failing_start):
    def failing(*, seed, start, stop):
        if start == failing_start:
            raise ValueError("no draws")
        return program.draws(seed=seed, start=start, stop=stop)

    with pytest.raises(ValueError, match="no draws"):
        list(map_blocks(len, program, samples=1000, seed=1, block=BLOCK, threads=2, draws=failing))
