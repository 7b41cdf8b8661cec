"""Which realizations a page shows one by one: the extreme ones of each measure first, then others at random."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.realizations import finished, pieces

EXTREME = 5  # of each measure, on either side
AT_MOST = 300


class Shown(NamedTuple):
    """A realization, and why it is shown."""

    row: int
    why: str


def shown_of(results: xr.DataTree) -> list[Shown]:
    """Realizations in the order of the page, each once; corrected measures decide what is extreme."""
    done = finished(results)
    rows = results.to_dataset().isel({terms.REALIZATION: slice(done)})
    found: dict[int, str] = {}
    for number, measure in enumerate(rows[terms.MEASURE].values):
        for word, own in zip(("smallest", "largest"), _extremes(rows, number), strict=True):
            for row in own:
                found.setdefault(int(row), f"{word} {measure}")
    for row in np.random.default_rng(0).permutation(done)[: AT_MOST + len(found)]:
        if len(found) >= AT_MOST:
            break
        found.setdefault(int(row), "at random")
    return [Shown(row, why) for row, why in list(found.items())[:AT_MOST]]


def _extremes(rows: xr.Dataset, measure: int) -> tuple[np.ndarray, np.ndarray]:
    """The rows with the smallest and with the largest values, the most extreme ones first."""
    kept_rows, kept = np.zeros(0, dtype=int), np.zeros(0)
    start = 0
    for piece in pieces(rows[[terms.MEASURED.name]]):
        values = piece[terms.MEASURED.name].values[:, -1, measure]
        kept = np.concatenate([kept, values])
        kept_rows = np.concatenate([kept_rows, start + np.arange(len(values))])
        start += len(values)
        order = np.argsort(kept, kind="stable")
        order = order[np.isfinite(kept[order])]
        some = np.unique(np.concatenate([order[:EXTREME], order[-EXTREME:]])) if order.size else order
        kept, kept_rows = kept[some], kept_rows[some]
    order = np.argsort(kept, kind="stable")
    return kept_rows[order[:EXTREME]], kept_rows[order[::-1][:EXTREME]]
