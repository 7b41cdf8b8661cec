"""Barriers: places at which a step ended since bodies would enter each other, though no place of contact shows it.

A guard (see Guard) sees bodies only while they lie in each other, and steps of free bodies end before that. So the place at
which a step would have entered is kept, and the next steps slide along it.
"""

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.contact.bounded_scan import FIRST_BARRIER, BoundedScan
from tolcontact.contact.guard import Guard
from tolcontact.geometry.meeting import Places

MAX_BARRIERS = 4  # of a pair
TOUCHING = 1e-9  # mm: bodies no deeper in each other touch
PROBE_FACTOR = 2.0  # times the depth that the complete test allows: a body that enters if moved back so far touches


def no_barriers(count: int) -> Places:
    """Return the barriers of `count` realizations without any."""
    empty = np.full((count, MAX_BARRIERS), -1), np.full((count, MAX_BARRIERS), np.inf)
    return Places(*empty, *np.zeros((3, count, MAX_BARRIERS, 3)))


def add_barriers(
    scan: BoundedScan,
    guard: Guard,
    X_RM: Float[Array, "n 12"],
    rows: Int[Array, " k"],
    entering: Float[Array, "k 12"],
    entered: BoundedScan,
) -> BoundedScan:
    """Return a scan at X_RM (n, 12) with one more barrier in realizations `rows` (k,), which ended at poses `entering` (k, 12).

    That is the deepest place there, by the scan `entered`, if the scan lacks it, or else how bodies part if they lie in each
    other. It takes the place of the barrier with the largest gap.
    """
    gaps, each = entered.gaps(entering, np.empty((len(rows), 0))), np.arange(len(rows))
    deepest = gaps.argmin(axis=1) if gaps.shape[1] else np.zeros(len(rows), dtype=int)
    is_known = scan.take(rows).holds(np.maximum(entered.labels[each, deepest], 0)[:, None])[:, 0]
    is_shown = (gaps.min(axis=1, initial=np.inf) < -TOUCHING) & ~is_known
    way = guard.ways_out(entering)
    places = entered.places[each, deepest], entered.feet[each, deepest], entered.normals[each, deepest]
    added = [np.where(is_shown[:, None], *vectors) for vectors in zip(places, (way.places, way.feet, way.normals), strict=True)]
    is_new = is_shown | (way.widths > 0)
    if not is_new.any():
        return scan
    rows, added = rows[is_new], [vectors[is_new] for vectors in added]
    barriers = scan.barriers if scan.barriers.labels.size else no_barriers(len(X_RM))
    arms = np.einsum("nij,nkj->nki", pose.rotation(X_RM), barriers.P_m) + pose.translation(X_RM)[:, None] - barriers.P_r
    distances = np.where(barriers.labels < 0, np.inf, (arms * barriers.n_r).sum(axis=2))
    columns = distances[rows].argmax(axis=1)
    for values, vectors in zip(barriers, (FIRST_BARRIER + columns, 0.0, *added), strict=True):
        values[rows, columns] = vectors
    return scan.with_barriers(barriers)


def release(
    scan: BoundedScan, guard: Guard, X_RM: Float[Array, "n 12"], carried: Int[Array, "n slot"]
) -> tuple[BoundedScan, Bool[Array, " n"]]:
    """Return a scan without those barriers among the labels `carried` (n, slot) at which bodies touch nowhere, and where (n,).

    Bodies have turned since such a barrier was found.
    """
    barriers, is_released = scan.barriers, np.zeros(len(X_RM), dtype=bool)
    for label, normals in zip(barriers.labels.T, barriers.n_r.transpose(1, 0, 2), strict=True):
        rows = np.flatnonzero((label >= 0) & (carried == label[:, None]).any(axis=1))
        back = X_RM[rows]
        back[:, 9:] -= PROBE_FACTOR * guard.depth * normals[rows]
        left = rows[~guard.interferes(back)]
        label[left], is_released[left] = -1, True
    return (scan.with_barriers(barriers) if is_released.any() else scan), is_released
