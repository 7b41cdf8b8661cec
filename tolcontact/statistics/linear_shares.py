"""Linear shares of variance: the contributors to the variance of a measurement, by regression on the draws of the run.

With deviations x (standardized), a measurement y and least squares y = b0 + b.x + e, the share of a group g of contributors is

    S_g = cov(b_g . x_g, y) / var(y),     and they sum up to R^2 = 1 - var(e) / var(y).

For independent groups S_g is the share of variance that the group explains linearly. Least squares on n realizations with p
contributors explain (1 - R^2) p / (n - 1 - p) of the variance by chance; each share is corrected for this overfitting.
Nonlinear effects of contact are in 1 - R^2, and in no share. Intervals use the delete-one-block jackknife with Student's t.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from tolcontact.statistics import intervals

BLOCKS = 20  # of the jackknife
ROWS_PER_CONTRIBUTOR = 5  # fewer realizations give no shares
MIN_R2 = 0.5  # below this, linear shares do not describe a measurement


class LinearShares(NamedTuple):
    """Shares (group, interval) of the variance of a measurement, and its R^2 (interval,), as estimate, lower and upper."""

    shares: np.ndarray
    r2: np.ndarray


def required_realizations(contributors: int) -> int:
    """Return the smallest number of realizations for an estimate of shares."""
    return max(ROWS_PER_CONTRIBUTOR * (contributors + 1), 10 * BLOCKS)


def joined_columns(
    owners: Sequence[str], sets: Sequence[Sequence[int] | np.ndarray], columns: np.ndarray
) -> dict[str, np.ndarray]:
    """Return some columns (k,) by group: all columns of an owner, and the columns of a set, are in the same group.

    owners   of all columns; the name of a group lists the owners of its columns
    """
    first_column: dict[str, int] = {}
    links = [[first_column.setdefault(owner, column), column] for column, owner in enumerate(owners)]
    links += [[int(joined[0]), int(column)] for joined in sets for column in joined[1:]]
    graph = scipy.sparse.coo_array(
        (np.ones(len(links)), np.array(links, dtype=int).reshape(-1, 2).T), shape=(len(owners), len(owners))
    )
    _, labels = scipy.sparse.csgraph.connected_components(graph, directed=False)
    members: dict[int, list[int]] = {}
    for column in columns.tolist():
        members.setdefault(int(labels[column]), []).append(column)
    return {" + ".join(dict.fromkeys(owners[k] for k in group)): np.array(group) for group in members.values()}


def linear_shares(x: np.ndarray, y: np.ndarray, groups: Sequence[np.ndarray]) -> list[LinearShares | None]:
    """Return the shares of groups of columns of `x` (n, contributor) for each column of `y` (n, measure).

    The result is None for a column of `y` that does not vary or is not finite. Raises ValueError for too few realizations.
    """
    n, count = x.shape
    if n < required_realizations(count):
        raise ValueError(f"{n} realizations of {count} contributors; expected at least {required_realizations(count)}")
    x = (x - x.mean(axis=0)) / x.std(axis=0)
    is_sound = np.isfinite(y).all(axis=0)
    y = np.where(is_sound, y, 0.0)
    y = y - y.mean(axis=0)
    scale = np.abs(y).max(axis=0)
    varies = is_sound & (scale > 0)
    y = y / np.where(varies, scale, 1.0)
    # Sums of products of 1, x and y over each block, (block, 1 + contributor + measure, 1 + contributor + measure).
    moments = np.array([z.T @ z for z in np.array_split(np.column_stack([np.ones(n), x, y]), BLOCKS)])
    total = moments.sum(axis=0)
    membership = np.zeros((len(groups), count))
    for k, group in enumerate(groups):
        membership[k, group] = 1
    estimates = _shares(total, count, membership)
    replicates = np.array([_shares(total - block, count, membership) for block in moments])
    half = intervals.student(BLOCKS - 1) * np.sqrt((BLOCKS - 1) * replicates.var(axis=0))
    values = np.stack([estimates, estimates - half, estimates + half], axis=-1)
    return [LinearShares(values[k, :-1], values[k, -1]) if varies[k] else None for k in range(y.shape[1])]


def _shares(moments: np.ndarray, count: int, membership: np.ndarray) -> np.ndarray:
    """Return shares (measure, group + 1) from moments; the last one is R^2 of each measure."""
    n = moments[0, 0]
    means = moments[0, 1:] / n
    covariance = moments[1:, 1:] / n - np.outer(means, means)
    of_x, with_y, of_y = covariance[:count, :count], covariance[:count, count:], covariance[count:, count:].diagonal()
    slopes = np.linalg.lstsq(of_x, with_y, rcond=1e-10)[0]
    with np.errstate(invalid="ignore", divide="ignore"):
        explained = (slopes * with_y / of_y).T  # (measure, contributor)
        by_chance = (1 - explained.sum(axis=1, keepdims=True)) / (n - 1 - count)
    adjusted = explained - by_chance
    return np.column_stack([adjusted @ membership.T, adjusted.sum(axis=1)])
