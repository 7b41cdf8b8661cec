"""Statistics of the check against the surfaces: what lies between contact points, and contact where faces have ended."""

from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.statistics import intervals
from tolcontact.vocabulary import ArchiveVariable


def surface_values(results: xr.DataTree, limit: float) -> dict[ArchiveVariable, Any]:
    """Return the results of the check, with shares of depths above `limit` [mm]."""
    surface = results["surface"].to_dataset()

    def depths(variable: ArchiveVariable) -> np.ndarray:
        return np.asarray(surface[variable.name].values)

    count = int((surface[terms.CHECKED_REALIZATION.name].values != terms.UNFINISHED).sum())
    at_random = surface[terms.AT_RANDOM.name].values == 1
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
