"""Shares of variance that contributors cause: linear shares, Sobol' indices and Shapley effects.

Linear shares come from regression on the draws of a run. With deviations x (standardized), a measurement y and least squares
y = b0 + b.x + e, the share of a group g of contributors is

    S_g = cov(b_g . x_g, y) / var(y),     and they sum up to R^2 = 1 - var(e) / var(y).

For independent groups S_g is the share of variance that the group explains linearly. Least squares on n realizations with p
contributors explain (1 - R^2) p / (n - 1 - p) of the variance by chance; each share is corrected for this overfitting.
Nonlinear effects of contact are in 1 - R^2, and in no share. With C the covariance of x, a realization changes S_g by 1 / n of

    (b_g.x_g y + cov(x_g, y).(C^-1 x)_g e - S_g y^2) / var(y),     e without the share that a realization has in its own fit.

The interval of a share is the interval of the mean of these influences or, if wider, the same on the logit scale: a share lies
between 0 and 1. Its bounds are apart by the largest influences more, since one more realization of that kind could have been
drawn. A share has no interval if the variance of a contributor of its group comes from few realizations. The residuals of few
realizations, or those with heavy tails, do not tell how much no line explains.

A measure f of independent groups of contributors has the Sobol' indices

    first order  S_i = Var(E[f | x_i]) / Var(f)          mean share that fixing the group would remove
    total        T_i = E[Var(f | all but x_i)] / Var(f)  share that remains if all others are fixed

With A and B two independent sets of draws, and A_i the set A with group i from B (Saltelli et al., 2010; Jansen, 1999)

    S_i = mean(f(B) (f(A_i) - f(A))) / V,    T_i = mean((f(A) - f(A_i))^2) / 2 V,    V = mean(f(A)^2 + f(B)^2) / 2, f centred

For correlated groups neither index is a share. Shapley effects are: each is the variance that a group adds to the variance
explained by the previous groups, averaged over all orders (Owen, 2014; Song, Nelson, Staum, 2016). They add up to 1. If f_m is
a realization that has the groups of A at the first m positions of a random order, with the others redrawn conditional on these,
the group at position m has

    Sh = mean((f(A) - f_m)^2 - (f(A) - f_{m+1})^2) / mean((f(A) - f_0)^2)

Each is a ratio of means over independent base realizations, so its interval is Student's t interval of its influence function,
with the effective degrees of freedom of the spread of the influences. The variance of a measure that contact nearly always
holds at a stop comes from few realizations: from fewer than 100, an index has no interval.
"""

import itertools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy

from tolcontact.statistics.intervals import UNDEFINED, Estimate, effective_count, from_influences

MIN_ROWS, ROWS_PER_CONTRIBUTOR = 200, 5  # fewer realizations give no shares
MIN_RESIDUALS, MAX_KURTOSIS = 1000, 10.0  # realizations, and the kurtosis of their residuals: otherwise R^2 has no interval
MIN_EFFECTIVE = 20  # effective realizations behind the variance of a contributor: with fewer, a share has no interval
MAX_LEVERAGE = 0.9  # of a realization in its own fit
MIN_SHARE = 1e-6  # on the logit scale
MIN_R2 = 0.5  # below this, linear shares do not describe a measurement
MIN_DECISIVE = 100  # effective realizations behind the variance of a measure: with fewer, an index has no interval
CONSTANT = 1e-24  # of the square of the mean: a smaller variance is rounding


class LinearShares(NamedTuple):
    """Shares (group, interval) of the variance of a measurement, and its R^2 (interval,), as estimate, lower and upper."""

    shares: np.ndarray
    r2: np.ndarray


def required_realizations(contributors: int) -> int:
    """Return the smallest number of realizations for an estimate of shares."""
    return max(ROWS_PER_CONTRIBUTOR * (contributors + 1), MIN_ROWS)


def joined_columns(
    owners: Sequence[str], sets: Sequence[Sequence[int] | np.ndarray], columns: np.ndarray
) -> dict[str, np.ndarray]:
    """Return some columns (k,) by group: all columns of an owner, and the columns of a set, are in the same group.

    owners   of all columns; the name of a group lists the owners of its columns, and has a number, as in "a + b (2)", if
             another group or owner already has that name
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
    groups: dict[str, np.ndarray] = {}
    for group in members.values():
        name, *others = dict.fromkeys(owners[k] for k in group)
        if others:
            name = _free_name(" + ".join([name, *others]), {*owners, *groups})
        groups[name] = np.array(group)
    return groups


def _free_name(name: str, names: set[str]) -> str:
    """Return a name that is not among `names`: the name itself, or with the first free number."""
    if name not in names:
        return name
    return next(numbered for k in itertools.count(2) if (numbered := f"{name} ({k})") not in names)


def linear_shares(x: np.ndarray, y: np.ndarray, groups: Sequence[np.ndarray]) -> list[LinearShares | None]:
    """Return the shares of groups of columns of `x` (n, contributor) for each column of `y` (n, measure).

    The result is None for a column of `y` that does not vary or is not finite. Raises ValueError for too few realizations.
    """
    n, count = x.shape
    if n < required_realizations(count):
        raise ValueError(f"{n} realizations of {count} contributors; expected at least {required_realizations(count)}")
    x = (x - x.mean(axis=0)) / x.std(axis=0)
    inverse = np.linalg.pinv(x.T @ x / n, rcond=1e-10, hermitian=True)
    normalized = x @ inverse
    independent = 1 - np.minimum((normalized * x).sum(axis=1) / n + 1 / n, MAX_LEVERAGE)
    # The members of each group, and of all of them.
    members = [*groups, np.arange(count)]
    columns, rows = np.concatenate(members), np.repeat(np.arange(len(members)), [len(group) for group in members])
    membership = scipy.sparse.csr_array((np.ones(len(columns)), (rows, columns)), shape=(len(members), count))
    sizes = membership.sum(axis=1)
    is_rare = membership @ np.array([effective_count(column**2) < MIN_EFFECTIVE for column in x.T]) > 0
    shares: list[LinearShares | None] = []
    for values in y.T:
        centred = values - values.mean() if np.isfinite(values).all() else np.zeros(n)
        if not (scale := np.abs(centred).max()) > 0:
            shares.append(None)
            continue
        centred = centred / scale
        with_y, variance = x.T @ centred / n, (centred**2).mean()
        slopes = inverse @ with_y
        residuals = centred - x @ slopes
        explained = membership @ (slopes * with_y) / variance
        estimates = explained - sizes * (1 - explained[-1]) / (n - 1 - count)
        fitted, through_slopes = (membership @ (matrix * row).T for matrix, row in ((x, slopes), (normalized, with_y)))
        influences = (fitted * centred + through_slopes * residuals / independent - estimates[:, None] * centred**2) / variance
        found = np.array([_with_interval(*pair) for pair in zip(estimates, influences, strict=True)])
        found[is_rare, 1:] = math.nan
        if n < MIN_RESIDUALS or not n * (residuals**4).sum() < MAX_KURTOSIS * (residuals**2).sum() ** 2:
            found[-1, 1:] = math.nan
        shares.append(LinearShares(found[:-1], found[-1]))
    return shares


def _with_interval(share: float, influences: np.ndarray) -> Estimate:
    """Return a share, with the interval that the influences of realizations (n,) give it."""
    influences = influences - influences.mean()
    _, lower, upper = from_influences(0.0, influences)
    lower, upper = lower + influences.min() / len(influences), upper + influences.max() / len(influences)
    error = min(max(upper, -lower, MIN_SHARE), 0.5)  # nearer to 0 or 1 than by its error, the logit scale has no meaning
    inner = min(max(share, error), 1 - error)
    least, most = scipy.special.expit(scipy.special.logit(inner) + np.array([lower, upper]) / (inner * (1 - inner)))
    return Estimate(float(share), float(min(share + lower, least)), float(max(min(share + upper, 1.0), most, share)))


def sobol_indices(f: np.ndarray, accuracy: float = 0.0) -> tuple[list[Estimate], list[Estimate]]:
    """Return first-order and total indices of each group, for values f (n, 2 + group) of A, B, and A with each group from B.

    A measure whose spread is below its accuracy has no indices.
    """
    mean = f[:, :2].mean()
    A, B, mixed = f[:, 0] - mean, f[:, 1] - mean, f[:, 2:] - mean
    v = (A**2 + B**2) / 2
    if not _varies(f, v, mean, accuracy):
        return [UNDEFINED] * mixed.shape[1], [UNDEFINED] * mixed.shape[1]
    first_order, total = B[:, None] * (mixed - A[:, None]), (A[:, None] - mixed) ** 2 / 2
    return [_ratio(u, v) for u in first_order.T], [_ratio(u, v) for u in total.T]


def shapley_effects(f: np.ndarray, positions: np.ndarray, accuracy: float = 0.0) -> list[Estimate]:
    """Return each group's Shapley effect, from f (n, 1 + group) with 0, 1, ... groups of A, at `positions` (n, group)."""
    remaining = (f[:, -1:] - f) ** 2
    if not _varies(f, remaining[:, 0], f.mean(), accuracy):
        return [UNDEFINED] * positions.shape[1]
    reductions = np.take_along_axis(remaining[:, :-1] - remaining[:, 1:], positions, axis=1)
    return [_ratio(u, remaining[:, 0]) for u in reductions.T]


def missed(f: np.ndarray, linear: np.ndarray, accuracy: float = 0.0) -> Estimate:
    """Return the share of the variance of f (n,) that a prediction (n,) misses; it exceeds 1 if the mean predicts better."""
    mean, errors = f.mean(), f - linear
    f = f - mean
    return _ratio((errors - errors.mean()) ** 2, f**2) if _varies(f, f**2, mean, accuracy) else UNDEFINED


def _varies(f: np.ndarray, squares: np.ndarray, mean: float, accuracy: float) -> bool:
    """Return whether values are finite, and their variance, the mean of `squares`, is more than rounding and accuracy."""
    return bool(np.isfinite(f).all() and squares.mean() > max(CONSTANT * mean**2, accuracy**2))


def _ratio(u: np.ndarray, v: np.ndarray) -> Estimate:
    """Return the mean of u over the mean of v, of the same realizations, with the interval of its influence function."""
    mean_v = v.mean()
    estimate = float(u.mean() / mean_v)
    if effective_count(v) < MIN_DECISIVE:
        return Estimate(estimate, math.nan, math.nan)
    return from_influences(estimate, (u - estimate * v) / mean_v)
