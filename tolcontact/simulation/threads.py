"""Blocks of realizations on as many threads as there are processors, in order.

A block does not depend on previous blocks, nor on the thread that simulates it: the results of a run are the same for any
number of threads, to the last bit. If the last block of a run is not full, it is simulated in pieces, so that several threads
share a small run. Pieces do not depend on each other, either.
"""

import contextlib
import functools
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np

from tolcontact.compilation import Program
from tolcontact.contact import ContactResolver
from tolcontact.mechanics import curved_pairs
from tolcontact.simulation.block import Block, simulate_block
from tolcontact.system.machine import processors
from tolcontact.vocabulary import BLOCK_ROWS

CURVED_ROWS, MIN_ROWS = 512, 16
PIECE_ROWS = 512  # at most; a thread needs several milliseconds to start
MAX_BODIES = 24  # coupled bodies: a whole block of more bodies would take longer than about ten seconds

T = TypeVar("T")
Sampler = Callable[..., np.ndarray]  # (seed=, start=, stop=) -> deviations (realization, contributor), such as Draws
Resolvers = list[ContactResolver]  # one for each group of a program; they serve one block at a time


class ProgramFunction(ABC):
    """A function of blocks that also needs their program, and receives it in the process that simulates them."""

    @abstractmethod
    def __call__(self, program: Program, block: Block) -> Any: ...


def simulate_blocks(
    program: Program,
    *,
    samples: int,
    seed: int,
    start: int = 0,
    block: int | None = None,
    threads: int | None = None,
    draws: Sampler | None = None,
) -> Iterator[Block]:
    """Yield realizations `start` to `samples` of a `seed` in blocks (of `block` rows, by default `block_rows`), in order.

    `for block in tc.simulate_blocks(tc.build("model.py"), samples=1000, seed=1): print(len(block.status))`

    Realization k is the same in any run. Its deviations come from `draws`, by default from the program's draws. At most two
    blocks for each of the `threads` (by default one for each processor) are in memory.
    """
    return map_blocks(
        lambda result: result, program, samples=samples, seed=seed, start=start, block=block, threads=threads, draws=draws
    )


def map_blocks(
    function: Callable[[Block], T],
    program: Program,
    *,
    samples: int,
    seed: int,
    start: int = 0,
    block: int | None = None,
    threads: int | None = None,
    draws: Sampler | None = None,
    unused: list[Resolvers] | None = None,
) -> Iterator[T]:
    """Yield the result of `function` for each block of `simulate_blocks`, in order; it is called in the simulating thread.

    A ProgramFunction is called with the program, too. Resolvers are taken from the list `unused` if it has any, and put back
    at the end.
    """
    if isinstance(function, ProgramFunction):
        function = functools.partial(function, program)
    threads, block = threads or processors(), block or block_rows(program)
    starts = range(start, samples, block)
    count = len(starts[:-1]) + sum(len(_pieces(begin, samples, block)) for begin in starts[-1:])
    idle = _available([] if unused is None else unused, program, min(2 * threads, count))
    running: deque[tuple[Future[Any], Resolvers, bool]] = deque()

    def simulate(rows: range, resolvers: Resolvers) -> Block:
        deviations = (draws or program.draws)(seed=seed, start=rows.start, stop=rows.stop)
        return simulate_block(program, deviations, start=rows.start, resolvers=resolvers)

    def finish_block(earlier: Sequence[Future[Block]], rows: range, resolvers: Resolvers) -> T:
        last = simulate(rows, resolvers)  # the pool has started all earlier pieces, so none waits for this thread
        return function(Block.joined([*(piece.result() for piece in earlier), last]) if earlier else last)

    def finish_one() -> Iterator[T]:
        future, resolvers, ends_block = running.popleft()
        result = future.result()
        idle.append(resolvers)
        if ends_block:
            yield result

    pool = ThreadPoolExecutor(threads)
    try:
        for begin in starts:
            earlier: list[Future[Any]] = []
            pieces = _pieces(begin, samples, block)
            for rows in pieces:
                if not idle:
                    yield from finish_one()
                resolvers = idle.pop()
                for resolver in resolvers:
                    resolver.start_over()  # in this thread, so that threads do not wait to construct CasADi objects
                task = functools.partial(finish_block, tuple(earlier)) if rows is pieces[-1] else simulate
                earlier.append(pool.submit(task, rows, resolvers))
                running.append((earlier[-1], resolvers, rows is pieces[-1]))
        while running:
            yield from finish_one()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)  # after success none is left; an aborted run does not wait
        if unused is not None:
            unused.extend(idle)


def _pieces(begin: int, samples: int, block: int) -> list[range]:
    """Return the realizations of each piece of the block that starts at `begin`. A full block is one piece."""
    rows = range(begin, min(begin + block, samples))
    count = 1 if len(rows) == block else -(-len(rows) // PIECE_ROWS)
    return [rows[len(rows) * piece // count : len(rows) * (piece + 1) // count] for piece in range(count)]


class Threads:
    """`map_blocks` in threads of this process; several threads may call it. Resolvers of a program are made once."""

    def __init__(self) -> None:
        self._program: Program | None = None
        self._unused: list[Resolvers] = []

    def __call__(self, function: Callable[[Block], T], program: Program, **options: Any) -> Iterator[T]:
        """Yield the results of `map_blocks`, for its options."""
        if self._program is not program:
            self._program, self._unused = program, []
        return map_blocks(function, program, unused=self._unused, **options)


def _available(unused: list[Resolvers], program: Program, count: int) -> list[Resolvers]:
    """Return the resolvers of `count` blocks: unused ones, which other threads may take at the same time, and new ones."""
    resolvers: list[Resolvers] = []
    with contextlib.suppress(IndexError):
        while len(resolvers) < count:
            resolvers.append(unused.pop())
    originals = [ContactResolver(program, group) for group in program.groups] if len(resolvers) < count else []
    return resolvers + [[resolver.twin() for resolver in originals] for _ in range(count - len(resolvers))]


def block_rows(program: Program) -> int:
    """Return the number of realizations in a block: a power of two, and smaller if a realization takes long.

    The time of a realization grows with the number of coupled bodies, for most solvers with its cube, and with projections
    onto curved faces. A block should take seconds at most: then it is stored, and visible as progress.
    """
    bodies = max((len(group.group.free) for group in program.groups), default=0)
    rows = BLOCK_ROWS
    if program.method.is_exact and any(curved_pairs(program.nominal, group.group) for group in program.groups):
        rows = CURVED_ROWS
    growth = program.solver.growth
    while rows > MIN_ROWS and rows * bodies**growth > BLOCK_ROWS * MAX_BODIES**growth:
        rows //= 2
    return rows
