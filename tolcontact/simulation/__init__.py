"""Simulate: realizations in blocks, on all processors, with the same results for any number of them. A chapter of the guide.

Realizations are simulated in blocks of 4096. Blocks are smaller if a realization takes long: 512 with curved faces in an exact
resolution, and fewer with more than 24 coupled bodies. Each block is drawn, placed, corrected and measured by one of as many
threads as the process may use processors, and handed over in order.

>>> import numpy as np
>>> import tolcontact as tc
>>> stand = tc.Assembly("stand")
>>> table = stand.part("table", tc.Box(100, 50, 10), fixed=True)
>>> block = stand.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
>>> location = stand.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=1)
>>> pair = stand.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
>>> height = stand.measure("height", block.point(50, 0, 10), along="z")
>>> program = tc.build(stand)
>>> blocks = list(tc.simulate_blocks(program, samples=5000, seed=1))
>>> [len(block) for block in blocks]
[4096, 904]
>>> blocks[0].measured.shape  # (realization, state, measure); the states are raw and corrected
(4096, 2, 1)

`tc.simulate_blocks` gives plain NumPy arrays and writes nothing: use it to run your own statistics on realizations as they
pass. `tc.run` writes the same numbers into an archive.

## Reproducibility

The results of a run are the same to the last bit for any number of processors, on the same machine with the same versions:
a block depends on the seed and on its place alone.

>>> one = np.concatenate([block.measured for block in tc.simulate_blocks(program, samples=5000, seed=1, threads=1)])
>>> bool((one == np.concatenate([block.measured for block in blocks])).all())
True

The solvers `qpoases`, `osqp` and `highs` start each QP from the one before, and forget it at the end of a block. So the last
digits of their results depend on which realizations share a block, and thereby on the number of realizations.

## Many processes, many machines

`tolcontact run MODEL --workers 8` simulates in eight processes of this machine, `--scheduler tcp://HOST:8786` on the workers of
a running dask scheduler, `tc.run(..., client=client)` on those of any client of `dask.distributed` (the extra `dask`). In two
shells, and one for each further worker:

    dask scheduler
    dask worker tcp://HOST:8786 --nthreads 1

A worker gets the discretized model, not its script or its files, compiles it once, and simulates shards of some blocks, about a
second each; this process writes what they give, in order. Four shards for each worker are under way at most, so memory does
not grow with the number of realizations. Results are those of one process to the last bit, if workers have the same versions
(others are refused) and the same kind of processor. Shards of a worker that is lost are simulated by others, and a scheduler
that comes back within a minute gets again what it forgot. Whatever ends this process, `--resume` goes on, with any number of
workers. Give workers of your own `DASK_DISTRIBUTED__NANNY__PRE_SPAWN_ENVIRON__MALLOC_TRIM_THRESHOLD_=100000000`: with dask's
own value they take half as long again (those of `--workers` have it). What a cluster costs and what limits it is in
`studies/scale`. Workers run Python code that clients send: a scheduler belongs in a network that one trusts.

`tc.simulate` and `tc.study` (see `tolcontact.workflow`) make lazy datasets of realizations, for dask to compute: workers then
write themselves what they simulate (`to_zarr`), and no single writer limits them.

All analyses take a `client` as well, and `--workers` or `--scheduler` on the command line. What searches try at once
(`worst_case`, `tails`, `allocate`, `relocate`) is some hundred realizations: workers gain where one of them takes a millisecond
or more.

## Time and memory

From draws to measures, on one thread, RA1 takes 11 to 13 us for a realization with `daqp` and 25 to 30 us with `qpoases`;
RA2, with 3000 contact points, 21 to 26 us and 56 us. That is 17 and 21 times (with `qpoases` 7 and 10 times) as fast as
NumPy with a loop over a QP solver (see `studies/speed`). A million realizations of RA1 take 10 to 15 s on two processors
and 500 MB. Memory does not grow with the number of realizations: at most two blocks for each thread are kept. A run of a
million realizations or more, or of slow ones that will take more than a minute, announces its time, memory and disk space
before it starts.
"""

from tolcontact.simulation.block import Block, outcomes
from tolcontact.simulation.blocks import simulate_block
from tolcontact.simulation.threads import block_rows, map_blocks, processors, simulate_blocks

__all__ = ["Block", "block_rows", "map_blocks", "outcomes", "processors", "simulate_block", "simulate_blocks"]
