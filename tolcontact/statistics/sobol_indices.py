"""Sobol' indices: the shares of a measure's variance that contributors cause, with contact as well as without.

A measure f of independent groups of contributors has the indices

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

import math

import numpy as np

from tolcontact.statistics.intervals import UNDEFINED, Estimate, effective_count, from_influences

MIN_EFFECTIVE = 100  # effective number of realizations behind the variance: with fewer, an index has no interval
CONSTANT = 1e-24  # of the square of the mean: a smaller variance is rounding


def sobol_indices(f: np.ndarray, accuracy: float = 0.0) -> tuple[list[Estimate], list[Estimate]]:
    """Return first-order and total indices of each group, for values f (n, 2 + group) of A, B, and A with each group from B.

    A measure whose spread is below its accuracy has no indices.
    """
    mean = f[:, :2].mean()
    A, B, mixed = f[:, 0] - mean, f[:, 1] - mean, f[:, 2:] - mean
    v = (A**2 + B**2) / 2
    if not np.isfinite(f).all() or not v.mean() > max(CONSTANT * mean**2, accuracy**2):
        return [UNDEFINED] * mixed.shape[1], [UNDEFINED] * mixed.shape[1]
    first_order, total = B[:, None] * (mixed - A[:, None]), (A[:, None] - mixed) ** 2 / 2
    return [ratio(u, v) for u in first_order.T], [ratio(u, v) for u in total.T]


def shapley_effects(f: np.ndarray, positions: np.ndarray, accuracy: float = 0.0) -> list[Estimate]:
    """Return each group's Shapley effect, from f (n, 1 + group) with 0, 1, ... groups of A, at `positions` (n, group)."""
    remaining = (f[:, -1:] - f) ** 2
    if not np.isfinite(f).all() or not remaining[:, 0].mean() > max(CONSTANT * f.mean() ** 2, accuracy**2):
        return [UNDEFINED] * positions.shape[1]
    reductions = np.take_along_axis(remaining[:, :-1] - remaining[:, 1:], positions, axis=1)
    return [ratio(u, remaining[:, 0]) for u in reductions.T]


def missed(f: np.ndarray, linear: np.ndarray, accuracy: float = 0.0) -> Estimate:
    """Return the share of the variance of f (n,) that a prediction (n,) misses; it exceeds 1 if the mean predicts better."""
    mean, errors = f.mean(), f - linear
    f = f - mean
    if not np.isfinite(f).all() or not (f**2).mean() > max(CONSTANT * mean**2, accuracy**2):
        return UNDEFINED
    return ratio((errors - errors.mean()) ** 2, f**2)


def ratio(u: np.ndarray, v: np.ndarray) -> Estimate:
    """Return the mean of u over the mean of v, of the same realizations, with the interval of its influence function."""
    mean_v = v.mean()
    estimate = float(u.mean() / mean_v)
    if effective_count(v) < MIN_EFFECTIVE:
        return Estimate(estimate, math.nan, math.nan)
    return from_influences(estimate, (u - estimate * v) / mean_v)
