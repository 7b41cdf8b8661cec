"""Where and how often contact is: pairs that carry, what they carry, and points that touch."""

from collections import Counter

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.realizations import finished, pieces
from tolcontact.recomputed import ArchivedPair, NotKeptError
from tolcontact.statistics import intervals
from tolcontact.statistics.sample import Sample

TOUCHES = 1e-4  # mm: a point with a smaller gap touches
AT_MOST = 2048  # realizations that points are looked at in
AT_ONCE, IN_ALL = 500_000, 20_000_000  # gaps that are computed at once, and in all
COMBINATIONS = 10  # of pairs that carry together


def carried(rows: xr.Dataset) -> np.ndarray:
    """Share of realizations in which each pair carries, (pair, interval)."""
    counts = np.sum([(piece[terms.CARRYING.name].values > 0).sum(axis=0) for piece in pieces(rows)], axis=0)
    total = rows.sizes[terms.REALIZATION]
    return np.array([intervals.share_of(int(k), total) for k in counts]).reshape(-1, len(terms.ESTIMATE))


def reactions(rows: xr.Dataset) -> np.ndarray:
    """Mean and percentiles of the reaction of each pair over all realizations, (pair, of_reaction, interval)."""
    found = []
    for pair in range(rows.sizes[terms.PAIR]):
        of = rows[[terms.REACTION.name]].isel({terms.PAIR: pair})
        x = Sample(lambda of=of: (np.asarray(piece[terms.REACTION.name].values) for piece in pieces(of)))  # type: ignore[misc]
        found.append([intervals.mean(x), *intervals.percentiles(x, terms.REACTION_PERCENTILES)])
    return np.array(found).reshape(-1, 1 + len(terms.REACTION_PERCENTILES), len(terms.ESTIMATE))


def combinations(rows: xr.Dataset) -> list[tuple[tuple[str, ...], int]]:
    """Which pairs carry together, and in how many realizations: the most frequent ones."""
    names, counts = [str(name) for name in rows[terms.PAIR].values], Counter[tuple[bool, ...]]()
    for piece in pieces(rows):
        found, times = np.unique(piece[terms.CARRYING.name].values > 0, axis=0, return_counts=True)
        counts.update({tuple(own.tolist()): int(n) for own, n in zip(found, times, strict=True)})
    most = counts.most_common(COMBINATIONS)
    return [(tuple(name for name, carries in zip(names, own, strict=True) if carries), n) for own, n in most]


def touching(results: xr.DataTree) -> xr.Dataset:
    """Share of realizations in which each contact point touches, corrected, with its interval, from the archive alone.

    touching   (point, interval): gaps below 1e-4 mm, in the first 2048 realizations at most (fewer of more than 10 000 points),
               those whose points are archived;
               NaN for points without gaps of their own
    pair       (point) name of its pair
    point      (point, axis) of the moving part, nominal [mm]

    The attribute `realizations` is their number; 0 if the archive has no poses (or, where they matter, no deviations).
    """
    rows = {
        str(name): of.isel({terms.STATE: [terms.CORRECTED]} if terms.STATE in of.dims else {})
        for name, of in results.to_dataset().data_vars.items()
    }
    rows |= {str(name): of for name, of in results["sample"].to_dataset().data_vars.items()}
    contact, names = results["contact"].to_dataset(), results.to_dataset()[terms.PAIR].values
    of_point, points = np.zeros(0, dtype=int), np.zeros((0, len(terms.AXES)))  # of a model without contact
    if terms.PAIR_OF_POINT.name in contact:
        of_point, points = contact[terms.PAIR_OF_POINT.name].values, contact[terms.MOVING_POINT.name].values
    some = slice(min(finished(results), AT_MOST, -(-IN_ALL // max(len(of_point), 1))))
    searched = rows[terms.SEARCHED.name].values[some] == 1 if terms.SEARCHED.name in rows else np.zeros(some.stop, dtype=bool)
    values = np.full((len(of_point), len(terms.ESTIMATE)), np.nan)
    count = int((~searched).sum())
    try:
        for number in range(len(names) if count else 0):
            pair = ArchivedPair(results, number)
            places = np.flatnonzero(of_point == number)[pair.places]
            hits = np.zeros(len(places), dtype=int)
            step = max(1, AT_ONCE // max(len(places), 1))
            for start in range(0, some.stop, step):
                part = slice(start, min(start + step, some.stop))
                hits += (pair.gaps(rows, part)[:, -1] < TOUCHES)[~searched[part]].sum(axis=0)
            known, which = np.unique(hits, return_inverse=True)
            values[places] = np.array([intervals.share_of(int(k), count) for k in known])[which]
    except NotKeptError:
        count = 0
    return xr.Dataset(
        {
            "touching": ((terms.POINT, terms.INTERVAL), values if count else np.full_like(values, np.nan), {"units": "1"}),
            "point": ((terms.POINT, terms.AXIS), points, {"units": "mm"}),
        },
        coords={
            "pair": (terms.POINT, names.astype(str)[of_point]),
            terms.AXIS: list(terms.AXES),
            terms.INTERVAL: list(terms.ESTIMATE),
        },
        attrs={"realizations": count},
    )
