"""Overlaps of the boxes around corners, edges and triangles."""

from collections.abc import Iterator

import numpy as np

from tolcontact.arrays import Array, Bool, Float

BLOCK_PAIRS = 1_000_000


def overlaps(
    lower: Float[Array, "n 3"], upper: Float[Array, "n 3"], low: Float[Array, "m 3"], high: Float[Array, "m 3"]
) -> Bool[Array, "n m"]:
    """Return whether (n, m) boxes from `lower` to `upper` overlap boxes from `low` to `high`."""
    mask = np.ones((len(lower), len(low)), dtype=bool)
    for axis in range(3):
        mask &= (lower[:, axis, None] <= high[:, axis]) & (upper[:, axis, None] >= low[:, axis])
    return mask


def blocks(count: int, width: int) -> Iterator[slice]:
    """Yield blocks of the rows of a table (count, width), each with a limited number of entries."""
    rows = max(BLOCK_PAIRS // max(width, 1), 1)
    for start in range(0, count if width else 0, rows):
        yield slice(start, min(start + rows, count))
