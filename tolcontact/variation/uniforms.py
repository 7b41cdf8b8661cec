"""Random numbers between 0 and 1: those of a contributor in realization k depend on the seed, its label and k alone."""

import hashlib

import numpy as np

STREAM = 4096
BITS = 52


def uniform(seed: int, label: str, start: int, stop: int) -> np.ndarray:
    """Numbers strictly between 0 and 1 for realizations `start` to `stop` of one contributor."""
    streams = range(start // STREAM, -(-stop // STREAM))
    drawn = [generator(seed, label, stream).integers(0, 1 << BITS, STREAM) for stream in streams]
    first = start - streams.start * STREAM
    return (np.concatenate(drawn)[first : first + stop - start] + 0.5) * 2.0**-BITS


def generator(seed: int, label: str, stream: int) -> np.random.Generator:
    """Random numbers of their own for each seed, label, and number of a stream (-1 or above)."""
    key = int.from_bytes(hashlib.blake2b(label.encode(), digest_size=8).digest(), "little")
    spawned = (key, stream) if stream >= 0 else (key,)
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=spawned)))
