"""Simulation in blocks of realizations, on all processors, with results that do not depend on them. A chapter of the guide.

Realizations are simulated in blocks of 4096. Blocks are smaller if a realization takes long: 512 with curved faces in an exact
resolution, and fewer with more than 24 coupled bodies. One thread draws, places, corrects and measures a block. There are as
many threads as processors that the process may use. Blocks are returned in order. If the last block of a run is not full, it
is divided into pieces of at most 512 realizations, so that several threads share it.

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

`tc.simulate_blocks` returns plain NumPy arrays and writes nothing: use it to compute your own statistics block by block.
`tc.run` writes the same numbers into an archive.

## Reproducibility

The results of a run are the same to the last bit for any number of processors, on the same machine with the same versions: a
block depends only on the seed and on its position in the run.

>>> one = np.concatenate([block.measured for block in tc.simulate_blocks(program, samples=5000, seed=1, threads=1)])
>>> bool((one == np.concatenate([block.measured for block in blocks])).all())
True

The solvers `qpoases`, `osqp` and `highs` start each QP from the previous one within a block, or a piece of the last block. The
last digits of their results therefore depend on the realizations in the same block, and so on the number of realizations.

## Many processes, many machines

`tolcontact run MODEL --workers 8` simulates in eight processes of this machine. Only this command can reach them: they require
temporary credentials, and serve their dashboard to this machine alone. `--scheduler tcp://HOST:8786` simulates on the workers
of a running dask scheduler. `tc.run(..., client=client)` simulates on the workers of any client of `dask.distributed` (the
extra `dask`). Start the scheduler and each worker in a separate shell:

    dask scheduler
    dask worker tcp://HOST:8786 --nthreads 1

A worker receives the discretized model, not its script or its files. It compiles the model once, and simulates shards: several
blocks that take about a second together. The main process writes their results in order. At most four shards per worker are in
progress, so memory does not grow with the number of realizations. The results equal the results of one process to the last
bit, if the workers have the same versions (others are refused) and the same kind of processor. If a worker is lost, others
simulate its shards. If the scheduler restarts within a minute, its shards are submitted again. If the main process ends early,
`--resume` continues the run with any number of workers. For workers that you start yourself, set
`DASK_DISTRIBUTED__NANNY__PRE_SPAWN_ENVIRON__MALLOC_TRIM_THRESHOLD_=100000000`: with dask's default they take 50 % longer
(`--workers` sets it for you). The study in `studies/scale` measures the overhead and the limits of a cluster. Workers run the
Python code that clients send: whoever can reach a scheduler can run code as its owner, on a shared machine any user. So give
the scheduler certificates, and its workers and clients the same certificates:

    dask scheduler --protocol tls --tls-ca-file ca.pem --tls-cert own.pem --tls-key own.key
    dask worker tls://HOST:8786 --nthreads 1 --tls-ca-file ca.pem --tls-cert own.pem --tls-key own.key

    export DASK_DISTRIBUTED__COMM__TLS__CA_FILE=ca.pem
    export DASK_DISTRIBUTED__COMM__TLS__CLIENT__CERT=own.pem DASK_DISTRIBUTED__COMM__TLS__CLIENT__KEY=own.key
    tolcontact run MODEL --scheduler tls://HOST:8786

`tc.simulate` and `tc.study` (see `tolcontact.workflow`) return lazy datasets of realizations, which dask computes. Workers can
then write their results in parallel (`to_zarr`), so no single writer limits them.

All analyses also accept a `client`, and `--workers` or `--scheduler` on the command line. The searches (`worst_case`, `tails`,
`allocate`, `relocate`) simulate several hundred realizations at once: workers save time if a realization takes a millisecond or
more.

## Time and memory

From draws to measures, on one thread, RA1 takes 11 to 13 us per realization with `daqp` and 25 to 30 us with `qpoases`; RA2,
with 3000 contact points, 21 to 26 us and 56 us. That is 17 and 21 times (with `qpoases` 7 and 10 times) as fast as NumPy with
a loop over a QP solver (see `studies/speed`). A million realizations of RA1 take 10 to 15 s on two processors and 550 MB;
their summary or report takes 450 MB. Memory does not grow with the number of realizations: at most two blocks per thread are in
memory, and statistics read the archive in pieces. A run of a million realizations or more, or of more than a minute, announces
its time, memory and disk space before it starts. A run of more than 30 days, or with more memory than available, is refused.
"""

from tolcontact.simulation.block import Block, outcomes, simulate_block
from tolcontact.simulation.threads import block_rows, map_blocks, processors, simulate_blocks

__all__ = ["Block", "block_rows", "map_blocks", "outcomes", "processors", "simulate_block", "simulate_blocks"]
