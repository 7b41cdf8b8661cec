"""Forecasts of time, memory and disk space before a run or an analysis begins."""

import logging
import time

import numpy as np

from tolcontact.archive import bytes_of_rows, size_in_words
from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.simulation import block_rows, simulate_blocks
from tolcontact.system.machine import machine_memory, peak_memory
from tolcontact.texts import duration
from tolcontact.vocabulary import BLOCK_ROWS

log = logging.getLogger(__name__)

FIRST_TRIAL_ROWS = 4
MIN_TRIAL_SECONDS = 0.25  # a shorter trial measures the start of a block
MIN_ANNOUNCED_ROWS = 1_000_000
MIN_ANNOUNCED_SECONDS = 60.0
MAX_SECONDS = 30 * 86_400.0


def announce(program: Program, *, samples: int, seed: int, keep: str, threads: int) -> None:
    """Log a warning with the time and space that `samples` more realizations need on `threads` threads, if that is much.

    Raises OptionError if the run would take more than 30 days.
    """
    if samples < MIN_ANNOUNCED_ROWS and block_rows(program) == BLOCK_ROWS:
        return
    seconds = _checked_seconds(program, samples, seed, threads)
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


def check_affordable(program: Program, *, samples: int, seed: int, threads: int, kept: int | None = None) -> None:
    """Raise OptionError if `samples` realizations, with `kept` stored numbers each, would take too much time or memory.

    By default the numbers are deviations, and measures in both states.
    """
    numbers = kept or len(program.nominal.contributors) + 2 * len(program.nominal.measures)
    needed, memory = np.dtype(float).itemsize * samples * numbers, machine_memory()
    if needed > memory:
        raise OptionError(
            f"{samples} realizations need {size_in_words(needed)} of memory, and this machine has {size_in_words(memory)}; "
            "ask for fewer samples"
        )
    if samples >= MIN_ANNOUNCED_ROWS:
        _checked_seconds(program, samples, seed, threads)


def _checked_seconds(program: Program, samples: int, seed: int, threads: int) -> float:
    """Return the time [s] that `samples` realizations need on `threads` threads. Raises OptionError above 30 days."""
    seconds = _seconds_per_realization(program, samples, seed) / threads
    if seconds * samples > MAX_SECONDS:
        raise OptionError(
            f"{samples} realizations would take about {duration(seconds * samples)}; ask for at most "
            f"{int(MAX_SECONDS / seconds)}, which take {duration(MAX_SECONDS)}"
        )
    return seconds * samples


def _seconds_per_realization(program: Program, samples: int, seed: int) -> float:
    """Return the time per realization [s], from trials of growing size, at most a block.

    Small trials overestimate it: they suffice if `samples` realizations are quick nevertheless.
    """
    trial = FIRST_TRIAL_ROWS
    list(simulate_blocks(program, samples=trial, seed=seed, threads=1))  # loading takes longer than a block
    while True:
        started = time.perf_counter()
        list(simulate_blocks(program, samples=trial, seed=seed, threads=1))
        seconds = time.perf_counter() - started
        is_quick = seconds / trial * samples < MIN_ANNOUNCED_SECONDS
        if is_quick or seconds > MIN_TRIAL_SECONDS or trial >= block_rows(program):
            return seconds / trial
        trial *= 8
