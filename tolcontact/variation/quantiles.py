"""Distributions of single contributors, as quantiles of a number between 0 and 1."""

from collections.abc import Callable

import numpy as np
from scipy.special import ndtr, ndtri

from tolcontact.declaration import Tolerance

TAIL = float(ndtr(-3))
# Quantiles of the named distributions for a zone of width 1.
SHAPES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "normal": lambda u: ndtri(u) / 6,
    "uniform": lambda u: u - 0.5,
    "triangular": lambda u: np.where(u < 0.5, np.sqrt(u / 2) - 0.5, 0.5 - np.sqrt((1 - u) / 2)),
    "truncated normal": lambda u: ndtri(TAIL + u * (1 - 2 * TAIL)) / 6,
}


def quantile(tolerance: Tolerance, u: np.ndarray) -> np.ndarray:
    """The deviation [mm] below which a share `u` (0 < u < 1) of parts lies."""
    if not isinstance(tolerance.distribution, str):
        found = np.asarray(tolerance.distribution.ppf(u), dtype=float)
    elif (width := float(tolerance.range or 0.0)) == 0:
        found = np.zeros_like(u)
    else:
        found = np.asarray(width / (tolerance.cp or 1.0) * SHAPES[tolerance.distribution](u))
    return found + tolerance.mean_shift if tolerance.mean_shift else found
