"""Deviations to corrected poses and measures, block by block, on as many threads as there are processors.

A block does not depend on the one before it, nor on the thread that simulates it: the results of a run are the same for any
number of threads, to the last bit.
"""

import os
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from tolcontact.compilation import Program
from tolcontact.contact.resolver import ContactResolver
from tolcontact.mechanics import ENTRIES, round_pairs
from tolcontact.simulation.block import Block
from tolcontact.variation.draws import draw
from tolcontact.vocabulary import BLOCK_ROWS, Status

CURVED_ROWS, LEAST_ROWS = 512, 16
LARGE = 24  # bodies that are coupled; a whole block of more would take longer than some ten seconds


def simulate_blocks(
    program: Program, *, samples: int, seed: int, start: int = 0, block: int | None = None, threads: int | None = None
) -> Iterator[Block]:
    """Realizations `start` to `samples` in blocks (of `block_rows` by default), in order.

    The realization k is the same in any run.

    At most two blocks for each of the `threads` (by default one for each processor) are in memory.
    """
    threads, block = threads or processors(), block or block_rows(program)
    firsts = range(start, samples, block)
    originals = [ContactResolver(program, group) for group in program.groups]
    idle = [[resolver.twin() for resolver in originals] for _ in range(min(2 * threads, len(firsts)))]
    begun: deque[tuple[Future[Block], list[ContactResolver]]] = deque()

    def simulate(first: int, resolvers: list[ContactResolver]) -> Block:
        deviations = draw(program.nominal, seed=seed, start=first, stop=min(first + block, samples))
        return simulate_block(program, deviations, start=first, resolvers=resolvers)

    def finish_one() -> Block:
        future, resolvers = begun.popleft()
        done = future.result()
        idle.append(resolvers)
        return done

    pool = ThreadPoolExecutor(threads)
    try:
        for first in firsts:
            if not idle:
                yield finish_one()
            resolvers = idle.pop()
            for resolver in resolvers:
                resolver.start_over()  # here, where the threads do not wait for each other to make CasADi's objects
            begun.append((pool.submit(simulate, first, resolvers), resolvers))
        while begun:
            yield finish_one()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)  # where all went well none is left; a stopped run does not wait


def block_rows(program: Program) -> int:
    """Realizations that are simulated together: a power of two, and fewer where one of them takes long.

    What it takes grows with the cube of the bodies that contact couples, and with every projection onto curved faces. A block
    should end within seconds: then it is safe, and somebody who waits sees it.
    """
    bodies = max((len(group.group.free) for group in program.groups), default=0)
    rows = BLOCK_ROWS
    if program.method.resolution == "exact" and any(round_pairs(program.nominal, group.group) for group in program.groups):
        rows = CURVED_ROWS
    while rows > LEAST_ROWS and rows * bodies**3 > BLOCK_ROWS * LARGE**3:
        rows //= 2
    return rows


def processors() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def simulate_block(
    program: Program, deviations: np.ndarray, *, start: int = 0, resolvers: list[ContactResolver] | None = None
) -> Block:
    """Raw and corrected states for given deviations (realization, locator) [mm]."""
    if resolvers is None:
        resolvers = [ContactResolver(program, group).twin() for group in program.groups]
    nominal, count = program.nominal, len(deviations)
    placed = program.place(deviations=deviations)
    raw = placed["poses"].reshape(count, len(nominal.parts), ENTRIES)
    measured_raw, relative_raw = _observe(program, raw)

    poses = raw.copy()
    touched, stuck, solved = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool), np.ones(count, dtype=bool)
    doubtful, searched, residual = np.zeros(count, dtype=bool), np.zeros(count, dtype=bool), np.zeros(count)
    iterations, starts, second_answers = (np.zeros(count, dtype=int) for _ in range(3))
    carrying, reaction = np.zeros((count, len(nominal.pairs)), dtype=int), np.zeros((count, len(nominal.pairs)))
    active, gap_min = np.zeros((count, len(nominal.pairs)), dtype=int), np.empty((count, 2, len(nominal.pairs)))
    for resolver in resolvers:
        found = resolver.resolve(raw, relative_raw, deviations)
        rows, state = found.rows, found.state
        poses[np.ix_(rows, resolver.parts)] = state.poses
        gap_min[:, :, resolver.pairs], active[:, resolver.pairs] = found.gap_min, found.active
        touched[rows] = True
        residual[rows] = np.maximum(residual[rows], state.residual)
        stuck[rows] |= state.in_conflict
        solved[rows] &= state.solved
        doubtful[rows] |= state.doubtful
        iterations[rows] = np.maximum(iterations[rows], state.iterations)
        starts[rows] = np.maximum(starts[rows], found.starts)
        searched[rows] |= state.searched
        second_answers[rows] += state.second_answers
        carrying[np.ix_(rows, resolver.pairs)] = found.carrying(resolver.spans)
        reaction[np.ix_(rows, resolver.pairs)] = found.reactions(resolver.spans)
    lost = ~np.isfinite(raw).all(axis=(1, 2))  # gaps that are no numbers touch nothing
    touched[lost], solved[lost], residual[lost] = True, False, np.inf
    measured = measured_raw.copy()
    measured[touched], _ = _observe(program, poses[touched])

    conflict = Status.NOT_ASSEMBLABLE if program.method.resolution == "exact" else Status.NOT_CONVERGED
    status = np.where(solved, np.where(stuck, conflict, Status.RESOLVED), Status.NOT_CONVERGED)
    status = np.where(solved & doubtful, Status.DOUBTFUL, status)
    status = np.where(touched, status, Status.UNTOUCHED)
    return Block(
        start=start,
        deviations=deviations,
        poses=np.stack([raw, poses], axis=1),
        measured=np.stack([measured_raw, measured], axis=1),
        gap_min=gap_min,
        active=active,
        carrying=carrying,
        reaction=reaction,
        status=status.astype(np.int8),
        kkt_residual=residual,
        iterations=iterations,
        starts=starts,
        second_answers=second_answers,
        searched=searched.astype(np.int8),
    )


def _observe(program: Program, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Measures (realization, measure) and X_RM (realization, pair, 12) at poses (realization, part, 12)."""
    seen = program.observe(poses=poses)
    return seen["measured"], seen["relative"].reshape(len(poses), len(program.nominal.pairs), ENTRIES)
