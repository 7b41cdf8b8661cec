"""From the zone of a feature to the spread of its components: which share of features lies inside.

Components c are independent and normal. A feature lies inside if none of the rows of its zone, each a vector linear in c, is
longer than half the width. In the direction u, a random unit vector scaled by the standard deviations, the zone ends at a
distance; how many features are nearer is the chi distribution's share. So the share inside is the mean over directions, which a
quasi-random sequence takes to some 1e-5 of it: no draws of features, and the same for all kinds of zones.
"""

import functools

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtri
from scipy.stats import chi, qmc

SHARE = 0.9973002039367398  # of a normal distribution within three standard deviations
DIRECTIONS = 14  # powers of two
TOGETHER = 1024  # of them at once
NEVER = 1e-9  # of the width: a smaller spread is none


def share_inside(rows: np.ndarray, sds: np.ndarray, width: float) -> float:
    """The share of features, with standard deviations (component,), inside a zone of rows (point, entry, component)."""
    varying = np.flatnonzero(sds > 0)
    if not varying.size or not rows.size:
        return 1.0
    longest = _longest(rows[..., varying], _directions(len(varying)) * sds[varying])
    return float(chi.cdf(width / 2 / np.maximum(longest, 1e-300), len(varying)).mean())


def equal_spread(rows: np.ndarray, known: np.ndarray, count: int, width: float) -> float:
    """The standard deviation of `count` more components with which 99.73 % of features lie inside.

    rows (point, entry, component) of all components, of which the first have standard deviations `known` (component,).
    """

    def excess(s: float) -> float:
        return share_inside(rows, np.concatenate([known, np.full(count, s)]), width) - SHARE

    if not rows.size or excess(NEVER * width) <= 0:
        return 0.0
    high = width
    while excess(high) > 0:  # rows may be short
        high *= 2
    return float(brentq(excess, NEVER * width, high, xtol=1e-9 * width))


def extreme_spread(rows: np.ndarray, known: np.ndarray, count: int, width: float) -> float:
    """The standard deviation of `count` more components with which six of the worst extreme's equal the width."""
    first = len(known)
    given = ((rows[..., :first] * known) ** 2).sum(axis=-1)
    more = (rows[..., first : first + count] ** 2).sum(axis=-1)
    left = (width / 6) ** 2 - given
    return float(np.sqrt(max((left[more > 0] / more[more > 0]).min(initial=np.inf), 0.0))) if (more > 0).any() else 0.0


def is_inside(rows: np.ndarray, components: np.ndarray, width: float | np.ndarray) -> np.ndarray:
    """Whether features (n,) with components (n, component) lie inside."""
    return np.asarray(_longest(rows, components) <= np.asarray(width) / 2)


def _longest(rows: np.ndarray, components: np.ndarray) -> np.ndarray:
    """The longest (n,) of the rows (point, entry, component) at components (n, component)."""
    found = np.zeros(len(components))
    for first in range(0, len(components), TOGETHER):
        some = slice(first, first + TOGETHER)
        squares = (np.einsum("pec,nc->npe", rows, components[some]) ** 2).sum(axis=2)
        found[some] = np.sqrt(squares.max(axis=1, initial=0.0))
    return found


def reach(rows: np.ndarray, width: float) -> np.ndarray:
    """How far (component,) components of features inside may be from 0, each by itself; a little more than that."""
    u = _directions(rows.shape[-1])
    longest = _longest(rows, u)
    return np.asarray(1.05 * np.abs(u / longest[:, None] * width / 2).max(axis=0))


@functools.lru_cache
def _directions(components: int) -> np.ndarray:
    """Unit vectors (direction, component), evenly all around."""
    if components == 1:
        return np.ones((1, 1))
    normal = ndtri(qmc.Sobol(components, scramble=True, seed=0).random_base2(DIRECTIONS))
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))
