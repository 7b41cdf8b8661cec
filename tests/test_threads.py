"""Threads: the same results for any number of them, to the last bit, also where several share a block."""

import numpy as np
import pytest

from tests import cases
from tolcontact import build
from tolcontact.simulation import map_blocks, simulate_blocks
from tolcontact.simulation.threads import PIECE_ROWS, Threads

BLOCK = 2048


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


def test_a_later_start_gives_the_same_blocks(program):
    everything = list(simulate_blocks(program, samples=BLOCK + 700, seed=1, block=BLOCK, threads=2))
    (rest,) = simulate_blocks(program, samples=BLOCK + 700, seed=1, block=BLOCK, start=BLOCK, threads=2)
    for name, values in vars(everything[1]).items():
        np.testing.assert_array_equal(getattr(rest, name), values, err_msg=name)


def test_a_block_is_reduced_once_whoever_simulated_its_pieces(program):
    threads = Threads()
    for _ in range(2):  # with new resolvers, and with these
        starts = list(threads(lambda block: (block.start, len(block)), program, samples=BLOCK + 1000, seed=1, block=BLOCK))
        assert starts == [(0, BLOCK), (BLOCK, 1000)]


@pytest.mark.parametrize("failing_start", [0, 500])
def test_an_error_in_any_piece_ends_the_run(program, failing_start):
    def failing(*, seed, start, stop):
        if start == failing_start:
            raise ValueError("no draws")
        return program.draws(seed=seed, start=start, stop=stop)

    with pytest.raises(ValueError, match="no draws"):
        list(map_blocks(len, program, samples=1000, seed=1, block=BLOCK, threads=2, draws=failing))
