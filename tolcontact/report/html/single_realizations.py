"""The single realizations of a page: extreme realizations of each measure first, then random ones."""

from typing import NamedTuple

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.realizations import finished, pieces

EXTREMES = 5  # of each measure, on either side
MAX_REALIZATIONS = 300


class SingleRealization(NamedTuple):
    """A realization, and the reason to show it."""

    row: int
    reason: str


def single_realizations(results: xr.DataTree) -> list[SingleRealization]:
    """Return realizations in the order of the page, without duplicates; extremes are those of corrected measures."""
    done = finished(results)
    rows = results.to_dataset().isel({terms.REALIZATION: slice(done)})
    reasons: dict[int, str] = {}
    for number, measure in enumerate(rows[terms.MEASURE].values):
        for extreme, extreme_rows in zip(("smallest", "largest"), _extremes(rows, number), strict=True):
            for row in extreme_rows:
                reasons.setdefault(int(row), f"{extreme} {measure}")
    for row in np.random.default_rng(0).permutation(done)[: MAX_REALIZATIONS + len(reasons)]:
        if len(reasons) >= MAX_REALIZATIONS:
            break
        reasons.setdefault(int(row), "at random")
    return [SingleRealization(row, reason) for row, reason in list(reasons.items())[:MAX_REALIZATIONS]]


def _extremes(rows: xr.Dataset, measure: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows with the smallest and with the largest values, the most extreme first."""
    candidate_rows, candidates = np.zeros(0, dtype=int), np.zeros(0)
    start = 0
    for piece in pieces(rows[[terms.MEASURED.name]]):
        values = piece[terms.MEASURED.name].values[:, -1, measure]
        candidates = np.concatenate([candidates, values])
        candidate_rows = np.concatenate([candidate_rows, start + np.arange(len(values))])
        start += len(values)
        order = np.argsort(candidates, kind="stable")
        order = order[np.isfinite(candidates[order])]
        selection = np.unique(np.concatenate([order[:EXTREMES], order[-EXTREMES:]])) if order.size else order
        candidates, candidate_rows = candidates[selection], candidate_rows[selection]
    order = np.argsort(candidates, kind="stable")
    return candidate_rows[order[:EXTREMES]], candidate_rows[order[::-1][:EXTREMES]]
