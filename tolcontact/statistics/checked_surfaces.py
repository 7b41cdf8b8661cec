"""Statistics of the check against the surfaces: what lies between contact points, and contact where faces have ended."""

from typing import Any

import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.labelled import Results, Table
from tolcontact.statistics import intervals
from tolcontact.vocabulary import ArchiveVariable


def surface_values(results: Results, limit: float) -> dict[ArchiveVariable, Any]:
    """Return what the check found, with shares of depths above `limit` [mm]; NaN for archives that lack a variable of it."""
    pairs = results.sizes[terms.PAIR]
    surface = results["surface"].to_dataset() if "surface" in results.children else Table({})

    def depths(variable: ArchiveVariable) -> np.ndarray:
        return surface[variable.name].values if variable.name in surface else np.full((0, pairs), np.nan)

    def checked(variable: ArchiveVariable, value: int) -> np.ndarray:
        return surface[variable.name].values == value if variable.name in surface else np.zeros(0, dtype=bool)

    count = len(checked(terms.CHECKED_REALIZATION, -1)) - int(checked(terms.CHECKED_REALIZATION, terms.UNFINISHED).sum())
    at_random = checked(terms.AT_RANDOM, 1)
    return {
        terms.DEEPEST_SURFACE: _over(np.nanmax, depths(terms.SURFACE_PENETRATION)),
        terms.FARTHEST_BESIDE: _over(np.nanmax, depths(terms.BESIDE)),
        terms.SURFACES_CHECKED: count,
        terms.DEEPEST_FALSE_CONTACT: [_over(np.nanmax, of_pair) for of_pair in depths(terms.FALSE_CONTACT).T],
        terms.PENETRATING_SHARE: _share(depths(terms.SURFACE_PENETRATION), at_random, limit),
        terms.FALSE_CONTACT_SHARE: _share(depths(terms.FALSE_CONTACT), at_random, limit),
        terms.CONTACTS_CHECKED: _over(np.nansum, depths(terms.CONTACTS)),
        terms.CONTACTS_WITHOUT_FACE: _over(np.nansum, depths(terms.CONTACTS_ENDED)),
    }


def _over(reduce: Any, values: np.ndarray) -> float:
    """Return a reduction of the values that are known; NaN if none is."""
    return float(reduce(values)) if np.isfinite(values).any() else np.nan


def _share(depths: np.ndarray, at_random: np.ndarray, limit: float) -> np.ndarray:
    """Return the share of random realizations with a depth (realization, pair) [mm] above the limit in any pair."""
    if not at_random.any() or not np.isfinite(depths).any():
        return np.array(intervals.UNDEFINED)
    return np.array(intervals.proportion((np.nan_to_num(depths[at_random]) > limit).any(axis=1)))
