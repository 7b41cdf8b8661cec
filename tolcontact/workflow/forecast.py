"""Forecasts: the time, memory and disk space of a long run, announced before it begins."""

import logging
import time

from tolcontact.archive import bytes_of_rows, size_in_words
from tolcontact.child import peak_memory
from tolcontact.compilation import Program
from tolcontact.simulation import block_rows, simulate_blocks
from tolcontact.vocabulary import BLOCK_ROWS

FIRST_TRIAL_ROWS = 4
MIN_TRIAL_SECONDS = 0.25  # a shorter trial measures the start of a block
MIN_ANNOUNCED_ROWS = 1_000_000
MIN_ANNOUNCED_SECONDS = 60.0

log = logging.getLogger(__name__)


def announce(program: Program, *, samples: int, seed: int, keep: str, threads: int) -> None:
    """Log a warning with the time and space that `samples` more realizations need on `threads` threads, if that is much."""
    if samples < MIN_ANNOUNCED_ROWS and block_rows(program) == BLOCK_ROWS:
        return
    seconds = _seconds_per_realization(program, seed) * samples / threads
    if samples >= MIN_ANNOUNCED_ROWS or seconds > MIN_ANNOUNCED_SECONDS:
        nominal = program.nominal
        points = sum(len(pair.P_m) for pair in nominal.pairs)
        peak = peak_memory()
        memory = "" if peak is None else f", {size_in_words(peak)} of memory"
        log.warning(
            "%d parts, %d contact pairs, %d contact points: %d realizations will take about %s%s, and %s in an archive",
            len(nominal.parts), len(nominal.pairs), points, samples, duration(seconds), memory,
            size_in_words(bytes_of_rows(nominal, keep, samples)),
        )  # fmt: skip


def _seconds_per_realization(program: Program, seed: int) -> float:
    """Return the time of a realization [s], from trials of growing size, at most a block."""
    trial = FIRST_TRIAL_ROWS
    list(simulate_blocks(program, samples=trial, seed=seed, threads=1))  # loading takes longer than a block
    while True:
        started = time.perf_counter()
        list(simulate_blocks(program, samples=trial, seed=seed, threads=1))
        seconds = time.perf_counter() - started
        if seconds > MIN_TRIAL_SECONDS or trial >= block_rows(program):
            return seconds / trial
        trial *= 8


def duration(seconds: float) -> str:
    """Return a time in words."""
    for size, unit in ((86_400, "days"), (3600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"
