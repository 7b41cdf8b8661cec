"""Sample: tolerances become deviations of the locators.

The draw of a locator in realization k depends on the seed, the locator's label and k alone: not on blocks, on other
locators, or on the order in which they were declared.
"""

import hashlib
from collections.abc import Callable

import numpy as np
from scipy.special import ndtr, ndtri

from tolcontact.declaration import Tolerance
from tolcontact.discretization import Nominal
from tolcontact.errors import ModelError

STREAM = 4096
TAIL = float(ndtr(-3))
# Quantiles of the named distributions for a zone of width 1.
SHAPES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "normal": lambda u: ndtri(u) / 6,
    "uniform": lambda u: u - 0.5,
    "triangular": lambda u: np.where(u < 0.5, np.sqrt(u / 2) - 0.5, 0.5 - np.sqrt((1 - u) / 2)),
    "truncated normal": lambda u: ndtri(TAIL + u * (1 - 2 * TAIL)) / 6,
}
_BITS = 52


def draw(nominal: Nominal, *, seed: int, start: int, stop: int) -> np.ndarray:
    """Deviations (realization, locator) [mm] of realizations `start` to `stop`, columns as `nominal.locators`.

    Raises ModelError for a distribution that yields non-finite deviations.
    """
    deviations = np.empty((stop - start, len(nominal.locators)))
    for column, (label, tolerance) in enumerate(zip(nominal.locators.labels, nominal.locators.tolerances, strict=True)):
        deviations[:, column] = quantile(tolerance, _uniform(seed, label, start, stop))
        if not np.isfinite(deviations[:, column]).all():
            raise ModelError(
                nominal.assembly.name,
                [f'locator "{label}": its distribution, {tolerance}, yields non-finite deviations'],
            )
    return deviations


def quantile(tolerance: Tolerance, u: np.ndarray) -> np.ndarray:
    """The deviation [mm] below which a share `u` (0 < u < 1) of parts lies."""
    if not isinstance(tolerance.distribution, str):
        return np.asarray(tolerance.distribution.ppf(u), dtype=float)
    width = float(tolerance.range or 0.0)
    if width == 0:
        return np.zeros_like(u)
    return np.asarray(width * SHAPES[tolerance.distribution](u))


def _uniform(seed: int, label: str, start: int, stop: int) -> np.ndarray:
    """Numbers strictly between 0 and 1 for realizations `start` to `stop` of one locator."""
    key = int.from_bytes(hashlib.blake2b(label.encode(), digest_size=8).digest(), "little")
    streams = range(start // STREAM, -(-stop // STREAM))
    drawn = [
        np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(key, stream)))).integers(
            0, 1 << _BITS, STREAM
        )
        for stream in streams
    ]
    first = start - streams.start * STREAM
    return (np.concatenate(drawn)[first : first + stop - start] + 0.5) * 2.0**-_BITS
