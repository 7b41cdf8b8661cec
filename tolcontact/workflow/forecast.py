"""What a run will take, announced before it begins: size, time, memory, disk."""

import logging
import time

from tolcontact.archive import bytes_of_rows, size_in_words
from tolcontact.child import peak_memory
from tolcontact.compilation import Program
from tolcontact.simulation import block_rows, simulate_blocks
from tolcontact.vocabulary import BLOCK_ROWS

TRIAL, ENOUGH = 4, 0.25  # realizations of the first trial, and s of the last: what begins takes milliseconds
MANY = 1_000_000
LONG = 60.0  # s: what takes less is not announced

log = logging.getLogger(__name__)


def announce(program: Program, *, samples: int, seed: int, keep: str, threads: int) -> None:
    """Log, as a warning, what `samples` more realizations will take on so many threads, if that is long: from a trial here."""
    if samples < MANY and block_rows(program) == BLOCK_ROWS:
        return
    seconds = _of_one(program, seed) * samples / threads
    if samples >= MANY or seconds > LONG:
        nominal = program.nominal
        points = sum(len(pair.P_m) for pair in nominal.pairs)
        peak = peak_memory()
        memory = "" if peak is None else f", {size_in_words(peak)} of memory"
        log.warning(
            "%d parts, %d contact pairs, %d contact points: %d realizations will take about %s%s, and %s in an archive",
            len(nominal.parts), len(nominal.pairs), points, samples, duration(seconds), memory,
            size_in_words(bytes_of_rows(nominal, keep, samples)),
        )  # fmt: skip


def _of_one(program: Program, seed: int) -> float:
    """How long a realization takes [s]: of more and more, up to a block, until they take long enough."""
    trial = TRIAL
    list(simulate_blocks(program, samples=trial, seed=seed, threads=1))  # what is loaded first takes longer than a block
    while True:
        started = time.perf_counter()
        list(simulate_blocks(program, samples=trial, seed=seed, threads=1))
        took = time.perf_counter() - started
        if took > ENOUGH or trial >= block_rows(program):
            return took / trial
        trial *= 8


def duration(seconds: float) -> str:
    """A time in words."""
    for size, unit in ((86_400, "days"), (3600, "h"), (60, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.0f} {unit}"
    return f"{seconds:.0f} s"
