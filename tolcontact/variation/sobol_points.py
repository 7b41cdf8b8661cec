"""Scrambled Sobol' points in few dimensions, as `scipy.stats.qmc.Sobol` gives them, whose import takes longer than a summary.

Sobol', USSR Computational Mathematics and Mathematical Physics 7 (1967); direction numbers by Joe and Kuo (2008);
the scrambling is Matoušek's (1998): a random lower triangular matrix of bits, and a random shift.
"""

import numpy as np

from tolcontact.arrays import Array, Float, Int

BITS = 30
# Of each dimension after the first: the inner coefficients of its primitive polynomial, and its initial direction numbers.
DIMENSIONS = (
    ((), (1,)),
    ((1,), (1, 3)),
    ((0, 1), (1, 3, 1)),
    ((1, 0), (1, 1, 1)),
    ((0, 0, 1), (1, 1, 3, 3)),
    ((1, 0, 0), (1, 3, 5, 13)),
)
MAX_DIMENSIONS = 1 + len(DIMENSIONS)


def scrambled_points(count: int, dimensions: int, rng: np.random.Generator) -> Float[Array, "count dimension"]:
    """Return the leading points of a randomly scrambled sequence in the unit cube, of at most MAX_DIMENSIONS."""
    powers = np.int64(1) << np.arange(BITS)
    shift = _random_bits(rng, (dimensions, BITS)) @ powers
    matrix = np.tril(_random_bits(rng, (dimensions, BITS, BITS)))
    matrix[:, range(BITS), range(BITS)] = 1
    directions = _direction_bits(dimensions)  # the most significant bit comes first, as in the rows of the matrix
    scrambled = np.einsum("dab,djb->dja", matrix, directions) % 2 @ powers[::-1]
    numbers = shift[None]
    for direction in scrambled.T:
        if len(numbers) >= count:
            break
        # In the order of the Gray code, the points that one more bit gives are the mirrored ones of before.
        numbers = np.concatenate([numbers, numbers[::-1] ^ direction])
    return numbers[:count] / 2.0**BITS


def _random_bits(rng: np.random.Generator, shape: tuple[int, ...]) -> Int[Array, "..."]:
    return rng.integers(2, size=shape, dtype=np.uint32).astype(np.int64)


def _direction_bits(dimensions: int) -> Int[Array, "dimension direction bit"]:
    """Return the bits of the direction numbers of each dimension, the most significant one first."""
    numbers = [[1] * BITS]
    for coefficients, initial in DIMENSIONS[: dimensions - 1]:
        degree, of_dimension = len(initial), list(initial)
        for _ in range(degree, BITS):
            number = of_dimension[-degree] ^ (of_dimension[-degree] << degree)
            for k, coefficient in enumerate(coefficients, start=1):
                number ^= coefficient * of_dimension[-k] << k
            of_dimension.append(number)
        numbers.append(of_dimension)
    aligned = np.array(numbers, dtype=np.int64) << np.arange(BITS - 1, -1, -1)
    return aligned[:, :, None] >> np.arange(BITS - 1, -1, -1) & 1
