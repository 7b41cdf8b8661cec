"""Statistics of contact: pairs under load, their reactions, touching points, bodies that penetrate each other.

Also how much a result depends on the objective: offsets of parts from their locators, and changes under other objectives.
"""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.arrays import Array, Bool
from tolcontact.realizations import EXISTS, assembled, column, pieces
from tolcontact.statistics import intervals
from tolcontact.statistics.measure_statistics import changes_of
from tolcontact.statistics.sample import Sample
from tolcontact.vocabulary import ArchiveVariable

MAX_COMBINATIONS = 10  # of pairs under load at the same time
MAX_PAIRS = 20  # of parts, the most frequent ones
MIN_COMPARED = 10  # realizations: with fewer, 6 sigma has no interval
ACCURACY = 1e-6  # mm: a smaller offset is the accuracy of the solver
CLASHES = (terms.CLASHES, terms.CLASH_DEPTH, terms.CLASH_PART, terms.CLASH_OTHER)


def loaded(rows: xr.Dataset) -> np.ndarray:
    """Return the share of realizations with each pair under load, (pair, interval)."""
    counts = np.sum([(piece[terms.CARRYING.name].values > 0).sum(axis=0) for piece in pieces(rows)], axis=0)
    return shares(counts.tolist(), rows.sizes[terms.REALIZATION])


def shares(counts: Sequence[int], total: int) -> np.ndarray:
    """Return the shares (n, interval) of counts (n,) among a number of realizations."""
    return np.array([intervals.proportion_of(count, total) for count in counts]).reshape(-1, len(terms.ESTIMATE))


def reactions(rows: xr.Dataset) -> np.ndarray:
    """Return mean and percentiles of the reaction of each pair, (pair, of_reaction, interval).

    Realizations that cannot be assembled have no reactions, and are left out.
    """
    estimates, (rows,) = [], assembled(rows)
    if EXISTS in rows.coords and not rows[EXISTS].values.any():
        return np.full((rows.sizes[terms.PAIR], 1 + len(terms.REACTION_PERCENTILES), len(terms.ESTIMATE)), np.nan)
    for pair in range(rows.sizes[terms.PAIR]):
        x = Sample.of(column(rows, terms.REACTION, pair=pair))
        estimates.append([intervals.mean(x), *intervals.percentiles(x, terms.REACTION_PERCENTILES)])
    return np.array(estimates).reshape(-1, 1 + len(terms.REACTION_PERCENTILES), len(terms.ESTIMATE))


def combinations(rows: xr.Dataset) -> list[tuple[tuple[str, ...], int]]:
    """Return the most frequent combinations of pairs under load, with their numbers of realizations."""
    names, counts = [str(name) for name in rows[terms.PAIR].values], Counter[tuple[bool, ...]]()
    for piece in pieces(rows):
        masks, times = _unique_rows(piece[terms.CARRYING.name].values > 0)
        counts.update({tuple(mask.tolist()): int(n) for mask, n in zip(masks, times, strict=True)})
    frequent = counts.most_common(MAX_COMBINATIONS)
    return [(tuple(name for name, is_active in zip(names, mask, strict=True) if is_active), n) for mask, n in frequent]


def _unique_rows(masks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distinct rows of booleans (row, column), and how often each occurs. They are compared as whole numbers."""
    words = np.zeros((len(masks), max(-(-masks.shape[1] // 64), 1)), dtype=np.uint64)
    words.view(np.uint8)[:, : -(-masks.shape[1] // 8)] = np.packbits(masks, axis=1)
    if words.shape[1] == 1:
        unique, times = np.unique(words, return_counts=True)
    else:
        unique, times = np.unique(words, axis=0, return_counts=True)  # takes ten times as long
    bits = np.unpackbits(unique.reshape(-1, words.shape[1]).view(np.uint8), axis=1)
    return bits[:, : masks.shape[1]].astype(bool), times


class TouchingShares:
    """The share of realizations with contact at each contact point, accumulated over realizations.

    is_counted   (point,): others have no share
    """

    def __init__(self, is_counted: Bool[Array, " point"]) -> None:
        self._counts, self._realizations, self._is_counted = np.zeros(len(is_counted), dtype=np.int64), 0, is_counted

    def add(self, counts: np.ndarray, realizations: int) -> None:
        """Add the counts (point,) of contacts at each point in `realizations` further realizations."""
        self._counts += counts
        self._realizations += realizations

    def values(self) -> tuple[np.ndarray, np.ndarray, int]:
        """Return shares (point,), their intervals (point, bound) and the number of realizations; NaN if there are none."""
        if not self._realizations:
            return np.full(len(self._counts), np.nan), np.full((len(self._counts), len(terms.BOUNDS)), np.nan), 0
        counts, place = np.unique(self._counts, return_inverse=True)
        estimates = np.where(self._is_counted[:, None], shares(counts.tolist(), self._realizations)[place], np.nan)
        return estimates[:, 0], estimates[:, 1:], self._realizations


def touching(results: xr.DataTree) -> xr.Dataset:
    """Return how often each contact point touches in the corrected state, as an archived share with its interval.

    touching   (point, interval): gaps below 1e-4 mm, in at most the first 2048 realizations (fewer above 10 000 points),
               without realizations that are `searched`
    pair       (point) name of its pair
    point      (point, axis) of the moving part, nominal [mm]

    The attribute `realizations` is their number. It is 0, and shares are NaN, if the archive does not keep the poses (or, where
    gaps depend on them, the deviations).
    """
    contact, names = results["contact"].to_dataset(), results.to_dataset()[terms.PAIR].values
    pair_of_point, points = np.zeros(0, dtype=int), np.zeros((0, len(terms.AXES)))  # for a model without contact
    if terms.PAIR_OF_POINT.name in contact:
        pair_of_point, points = contact[terms.PAIR_OF_POINT.name].values, contact[terms.MOVING_POINT.name].values
    values, count = np.full((len(pair_of_point), len(terms.ESTIMATE)), np.nan), 0
    if len(points):
        share, interval, realizations = (contact[variable.name].values for variable in terms.TOUCHING)
        values, count = np.column_stack([share, interval]), int(realizations)
    return xr.Dataset(
        {
            "touching": ((terms.POINT, terms.INTERVAL), values, {"units": "1"}),
            "point": ((terms.POINT, terms.AXIS), points, {"units": "mm"}),
        },
        coords={
            "pair": (terms.POINT, names.astype(str)[pair_of_point]),
            terms.AXIS: list(terms.AXES),
            terms.INTERVAL: list(terms.ESTIMATE),
        },
        attrs={"realizations": count},
    )


def surface_values(results: xr.DataTree, limit: float) -> dict[ArchiveVariable, Any]:
    """Return the results of the surface check, with shares of depths above `limit` [mm]."""
    surface = results["surface"].to_dataset()

    def depths(variable: ArchiveVariable) -> np.ndarray:
        return np.asarray(surface[variable.name].values)

    count = int((surface[terms.CHECKED_REALIZATION.name].values != terms.UNCHECKED).sum())
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
    """Return a reduction of the values that are not NaN; NaN if there are none."""
    return float(reduce(values)) if np.isfinite(values).any() else np.nan


def _share(depths: np.ndarray, at_random: np.ndarray, limit: float) -> np.ndarray:
    """Return the share of random realizations with a depth (realization, pair) [mm] above the limit in any pair."""
    if not at_random.any() or not np.isfinite(depths).any():
        return np.array(intervals.UNDEFINED)
    return np.array(intervals.proportion((np.nan_to_num(depths[at_random]) > limit).any(axis=1)))


def clashes(rows: xr.Dataset) -> tuple[dict[ArchiveVariable, Any], list[str]]:
    """Return the share of realizations with clashes, the counts and depths of pairs of parts, and the names of these pairs.

    A clash is a penetration of bodies. The share counts pairs without declared contact, of all tested realizations. The
    most frequent pairs are those that are the deepest in their realization; their depth [mm] is NaN if none was measured.
    """
    names = [str(name) for name in rows[terms.PART].values]
    clashing, depth, *parts = (column(rows, variable) for variable in CLASHES)
    is_pair = np.all([(index >= 0) & (index < len(names)) for index in parts], axis=0)
    labels, places, counts = np.unique(
        np.column_stack([*parts, clashing == 0])[is_pair].astype(int), axis=0, return_inverse=True, return_counts=True
    )
    depths, order = np.full(len(labels), np.nan), np.argsort(-counts, kind="stable")[:MAX_PAIRS]
    np.fmax.at(depths, places.ravel(), depth[is_pair])
    watched = int((clashing >= 0).sum())
    share = intervals.proportion_of(int((clashing > 0).sum()), watched) if watched else intervals.UNDEFINED
    values = {
        terms.WATCHED: watched,
        terms.CLASH_SHARE: np.array(share),
        terms.CLASH_COUNT: counts[order],
        terms.CLASH_LARGEST_DEPTH: depths[order],
        terms.CLASH_DECLARED: labels[order, 2].astype(np.int8),
    }
    return values, [f"{names[first_part]} / {names[second_part]}" for first_part, second_part, _ in labels[order]]


def offset_values(rows: xr.Dataset) -> dict[ArchiveVariable, Any]:
    """Return percentiles of the offset of each part from its locators, and the shares of large ones."""
    parts, total = rows.sizes[terms.PART], rows.sizes[terms.REALIZATION]
    beyond = np.full((2, parts, len(terms.ESTIMATE)), np.nan)
    offset = np.full((parts, len(terms.OFFSET_PERCENTILES), len(terms.ESTIMATE)), np.nan)
    values = {terms.OFFSET: offset, terms.OFFSET_BEYOND: beyond[0], terms.OFFSET_UNEXPLAINED: beyond[1]}
    if terms.LOCATOR_OFFSET.name not in rows:  # an archive of an earlier version
        return values
    variations, columns = rows[terms.LOCATOR_VARIATION.name].values, [v.name for v in (terms.LOCATOR_OFFSET, terms.GAP_MIN)]
    counts = np.zeros((2, parts), dtype=int)
    for piece in pieces(rows[[*columns, terms.STATUS.name]]):
        offsets, gaps = (np.asarray(piece[name].values) for name in columns)
        depths = np.maximum(-np.fmin.reduce(gaps[:, terms.RAW], axis=1, initial=0), 0)
        is_certified = np.isin(piece[terms.STATUS.name].values, terms.CERTIFIED)
        counts[0] += (offsets > variations + ACCURACY).sum(axis=0)
        counts[1] += ((offsets > variations + depths[:, None] + ACCURACY) & is_certified[:, None]).sum(axis=0)
    for part in np.flatnonzero(np.isfinite(variations)).tolist():
        x = Sample.of(column(rows, terms.LOCATOR_OFFSET, part=part))
        offset[part] = intervals.percentiles(x, list(terms.OFFSET_PERCENTILES.values()))
        beyond[:, part] = shares(counts[:, part].tolist(), total)
    return values


def other_objectives(results: xr.DataTree) -> list[str]:
    """Return the objectives that a run was compared with; empty if it was not."""
    if terms.OBJECTIVES_GROUP not in results.children:
        return []
    return [str(name) for name in results[terms.OBJECTIVES_GROUP].to_dataset()[terms.BY_OBJECTIVE].values[1:]]


def changes_by_objective(results: xr.DataTree) -> dict[ArchiveVariable, Any]:
    """Return the changes of corrected measures if another objective decided, from realizations certified under both."""
    others, measures = other_objectives(results), results.to_dataset().sizes[terms.MEASURE]
    changes = np.full((len(others), measures, len(terms.CHANGES), len(terms.ESTIMATE)), np.nan)
    counts = np.zeros(len(others), dtype=np.int64)
    for k in range(len(others)):
        group = results[terms.OBJECTIVES_GROUP].to_dataset()
        measured, statuses = (group[v.name].values for v in (terms.MEASURED_BY_OBJECTIVE, terms.STATUS_BY_OBJECTIVE))
        both = np.isin(statuses[0], terms.CERTIFIED) & np.isin(statuses[k + 1], terms.CERTIFIED)
        counts[k] = both.sum()
        for measure in range(measures if counts[k] >= MIN_COMPARED else 0):
            baseline, x = (Sample.of(values[both, measure]) for values in (measured[0], measured[k + 1]))
            if np.isfinite(baseline.mean + x.mean):
                changes[k, measure] = changes_of(baseline, x)
    return {terms.BY_OTHER_OBJECTIVE: changes, terms.COMPARED_BY_OBJECTIVE: counts}
