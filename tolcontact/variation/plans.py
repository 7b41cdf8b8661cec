"""Sampling plans: the numbers between 0 and 1 whose quantiles are the deviations.

    monte-carlo       independent of each other
    latin hypercube   256 realizations together fill 256 classes of every contributor, once each (McKay, Beckman, Conover, 1979)
    sobol             256 realizations together are the first points of a Sobol' sequence (Joe, Kuo, 2008; linear matrix
                      scramble), with a random digital shift

With the last two, realizations k 256 to (k + 1) 256 are a replicate: independent of all others, each of its realizations
distributed as one drawn alone. So intervals follow from the means of replicates (Owen, 1997). In any plan the numbers of
realization k depend on the seed, the labels and k alone.
"""

import functools
import hashlib
from collections.abc import Callable, Sequence

import numpy as np
import scipy

from tolcontact.vocabulary import LATIN_HYPERCUBE, MONTE_CARLO, REPLICATE, SOBOL

STREAM = 4096  # numbers of a label that are drawn as one stream
BITS = 52

Numbers = Callable[[str], np.ndarray]  # numbers (realization,) strictly between 0 and 1 of a label


def uniform(seed: int, label: str, start: int, stop: int) -> np.ndarray:
    """Return numbers strictly between 0 and 1 of a label for realizations `start` to `stop`."""
    streams = range(start // STREAM, -(-stop // STREAM))
    integers = np.concatenate([_generator(seed, label, stream).integers(0, 1 << BITS, STREAM) for stream in streams])
    offset = start - streams.start * STREAM
    return (integers[offset : offset + stop - start] + 0.5) * 2.0**-BITS


def _generator(seed: int, label: str, stream: int | None = None) -> np.random.Generator:
    key = int.from_bytes(hashlib.blake2b(label.encode(), digest_size=8).digest(), "little")
    spawn_key = (key,) if stream is None else (key, stream)
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=spawn_key)))


def planned_numbers(plan: str, labels: Sequence[str], seed: int, start: int, stop: int) -> Numbers:
    """Return the numbers of labels for realizations `start` to `stop` by the name of a plan; of others independent numbers."""
    if plan == MONTE_CARLO or not labels:
        return lambda label: uniform(seed, label, start, stop)
    column = {label: k for k, label in enumerate(sorted(labels))}  # the order of declarations does not matter
    replicates = range(start // REPLICATE, -(-stop // REPLICATE))
    points = np.concatenate([_POINTS[plan](seed, replicate, len(column)) for replicate in replicates])
    rows = points[start - replicates.start * REPLICATE :][: stop - start]
    return lambda label: rows[:, column[label]] if label in column else uniform(seed, label, start, stop)


def _latin(seed: int, replicate: int, count: int) -> np.ndarray:
    rng = _generator(seed, LATIN_HYPERCUBE, replicate)
    return scipy.stats.qmc.LatinHypercube(count, rng=rng).random(REPLICATE).clip(2.0**-BITS, 1 - 2.0**-BITS)


def _sobol(seed: int, replicate: int, count: int) -> np.ndarray:
    shift = _generator(seed, SOBOL, replicate).integers(0, 1 << BITS, count)
    return ((_net(seed, count) ^ shift) + 0.5) * 2.0**-BITS


@functools.lru_cache(maxsize=8)
def _net(seed: int, count: int) -> np.ndarray:
    """Return the points (REPLICATE, count) of a Sobol' sequence as whole numbers of BITS bits."""
    points = scipy.stats.qmc.Sobol(count, scramble=True, bits=BITS, rng=_generator(seed, SOBOL)).random(REPLICATE)
    return (points * 2.0**BITS).astype(np.int64)


_POINTS = {LATIN_HYPERCUBE: _latin, SOBOL: _sobol}
