"""Insides of `simulation` under the claims of `tests/test_threads.py`."""

import numpy as np
import pytest

from tests import cases
from tests.test_threads import BLOCK
from tolcontact import build
from tolcontact.simulation import simulate_blocks
from tolcontact.simulation.threads import PIECE_ROWS, Threads


@pytest.fixture(scope="module")
def program():
    """RA1 with qpOASES, which starts each problem from the answer to the one before."""
    return build(cases.model("ra1"), solver="qpoases")


@pytest.mark.parametrize("samples", [1, PIECE_ROWS, PIECE_ROWS + 1, 1300, BLOCK, BLOCK + 700])
def test_results_are_the_same_for_any_number_of_threads(program, samples):
    expected = list(simulate_blocks(program, samples=samples, seed=1, block=BLOCK, threads=1))
    assert [len(block) for block in expected] == [min(BLOCK, samples - start) for start in range(0, samples, BLOCK)]
    for threads in (2, 7):
        blocks = list(simulate_blocks(program, samples=samples, seed=1, block=BLOCK, threads=threads))
        for actual, block in zip(blocks, expected, strict=True):
            assert actual.start == block.start
            for name, values in vars(block).items():
                np.testing.assert_array_equal(getattr(actual, name), values, err_msg=name)


def test_a_block_is_reduced_once_whoever_simulated_its_pieces(program):
    threads = Threads()
    for _ in range(2):  # with new resolvers, and with these
        starts = list(threads(lambda block: (block.start, len(block)), program, samples=BLOCK + 1000, seed=1, block=BLOCK))
        assert starts == [(0, BLOCK), (BLOCK, 1000)]
