"""From the zone of a feature to the spread of its components: the share of features that lies inside.

Components c are independent and normal. A feature lies inside if none of the rows of its zone, each a vector linear in c, is
longer than half the width. In the direction u, a random unit vector scaled by the standard deviations, the zone ends at a
distance. The share of features nearer than that is the chi distribution's, so the share inside is its mean over directions. A
quasi-random sequence of directions gives it to some 1e-5, without draws of features, and alike for all kinds of zones.
"""

import functools

import numpy as np
import scipy
from scipy.special import ndtri

SHARE = 0.9973002039367398  # of a normal distribution within three standard deviations
LOG2_DIRECTIONS = 14
CHUNK = 1024  # components that are evaluated at once
MIN_SPREAD = 1e-9  # of the width: a smaller spread counts as 0


def share_inside(rows: np.ndarray, spreads: np.ndarray, width: float) -> float:
    """Return the share of features, with standard deviations (component,), inside a zone of rows (point, entry, component)."""
    varying = np.flatnonzero(spreads > 0)
    if not varying.size or not rows.size:
        return 1.0
    longest = _longest(rows[..., varying], _directions(len(varying)) * spreads[varying])
    return float(scipy.stats.chi.cdf(width / 2 / np.maximum(longest, 1e-300), len(varying)).mean())


def equal_spread(rows: np.ndarray, inner_spreads: np.ndarray, count: int, width: float) -> float:
    """Return the standard deviation of `count` more components with which 99.73 % of features lie inside.

    rows            (point, entry, component) of all components, those with `inner_spreads` first
    inner_spreads   (component,) standard deviations
    """

    def excess(spread: float) -> float:
        return share_inside(rows, np.concatenate([inner_spreads, np.full(count, spread)]), width) - SHARE

    if not rows.size or excess(MIN_SPREAD * width) <= 0:
        return 0.0
    upper = width
    while excess(upper) > 0:  # rows may be short
        upper *= 2
    return float(scipy.optimize.brentq(excess, MIN_SPREAD * width, upper, xtol=1e-9 * width))


def extreme_spread(rows: np.ndarray, inner_spreads: np.ndarray, count: int, width: float) -> float:
    """Return the standard deviation of `count` more components with which 6 sigma of the worst extreme equal the width."""
    inner_count = len(inner_spreads)
    inner_variance = ((rows[..., :inner_count] * inner_spreads) ** 2).sum(axis=-1)
    factors = (rows[..., inner_count : inner_count + count] ** 2).sum(axis=-1)
    variance = (width / 6) ** 2 - inner_variance
    moved = factors > 0
    return float(np.sqrt(max((variance[moved] / factors[moved]).min(initial=np.inf), 0.0))) if moved.any() else 0.0


def is_inside(rows: np.ndarray, components: np.ndarray, width: float | np.ndarray) -> np.ndarray:
    """Return whether features (n,) with components (n, component) lie inside."""
    return _longest(rows, components) <= np.asarray(width) / 2


def _longest(rows: np.ndarray, components: np.ndarray) -> np.ndarray:
    """Return the longest (n,) of the rows (point, entry, component) at components (n, component)."""
    longest = np.zeros(len(components))
    for start in range(0, len(components), CHUNK):
        chunk = slice(start, start + CHUNK)
        squares = (np.einsum("pec,nc->npe", rows, components[chunk]) ** 2).sum(axis=2)
        longest[chunk] = np.sqrt(squares.max(axis=1, initial=0.0))
    return longest


def component_bounds(rows: np.ndarray, width: float) -> np.ndarray:
    """Return bounds (component,) of the absolute components of features inside, with a margin of 5 %."""
    u = _directions(rows.shape[-1])
    longest = _longest(rows, u)
    return 1.05 * np.abs(u / longest[:, None] * width / 2).max(axis=0)


@functools.lru_cache
def _directions(components: int) -> np.ndarray:
    """Return unit vectors (direction, component) in all directions evenly."""
    if components == 1:
        return np.ones((1, 1))
    normal = ndtri(scipy.stats.qmc.Sobol(components, scramble=True, seed=0).random_base2(LOG2_DIRECTIONS))
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)
