"""A population measured back, as a coordinate measuring machine would: which share of the drawn features lies in its zones.

Points of every feature are displaced as drawn, the datum system of each tolerance is fitted to those of its datum features, and
the width of the zone that the others need is compared with the one allowed. Nothing on the way from zones to spreads is used.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from tolcontact.declaration import GeometricTolerance
from tolcontact.declaration.feature_tolerance import INSIDE, ORIENTATIONS
from tolcontact.discretization import Nominal
from tolcontact.features import NominalFeature
from tolcontact.variation.contributors import bonus
from tolcontact.variation.draws import Draws

NOTICED = 1e-4  # of the largest: a smaller singular value is a freedom that datums do not notice
STATED = 0.9973
ROUNDING = 1e-9  # of a width


class MeasuredZone(NamedTuple):
    """What became of one tolerance of a feature.

    stated    the share inside that its rule states; NaN if it states none
    inside    number of features inside, of
    drawn     so many
    needed    [mm]: width of the zone that 99.73 % of them need
    """

    feature: str
    tolerance: str
    stated: float
    inside: int
    drawn: int
    needed: float


class _Probed(NamedTuple):
    """What is measured of a feature: `rows` (value, 6) of a motion about a centre, and `values` (n, value) [mm]."""

    rows: np.ndarray
    values: np.ndarray


def measured_population(nominal: Nominal, draws: Draws, *, seed: int, count: int) -> Iterator[MeasuredZone]:
    """Every tolerance of every feature, measured on `count` drawn features."""
    deviations = draws(seed=seed, start=0, stop=count)
    for own in nominal.features:
        limits = own.feature.size
        if limits is not None and own.size_column is not None:
            off = deviations[:, own.size_column] - (limits.upper + limits.lower) / 2
            plain = limits.distribution == "normal" and limits.cp is None
            yield _zone(own, str(limits), STATED if plain else np.nan, 2 * np.abs(off), limits.upper - limits.lower)
        others = {each.feature.datum: each for each in nominal.features if each.part == own.part}
        for layer in own.layers:
            if layer.controlled.shape[1]:
                system = [[others[letter] for letter in place] for place in layer.tolerance.system]
                yield _measured(own, layer.tolerance, system, deviations)


def _zone(own: NominalFeature, said: str, stated: float, needed: np.ndarray, allowed: np.ndarray | float) -> MeasuredZone:
    inside = needed <= np.asarray(allowed) * (1 + ROUNDING)
    return MeasuredZone(own.label, said, stated, int(inside.sum()), len(needed), float(np.quantile(needed, STATED)))


def _probed(
    own: NominalFeature, places: np.ndarray, directions: np.ndarray, deviations: np.ndarray, centre: np.ndarray
) -> _Probed:
    """The feature at `places` (point, 3), along `directions` (point, entry, 3)."""
    geometry = own.geometry
    moved = deviations[:, : own.coordinates.shape[1]] @ (geometry.twists @ own.coordinates).T
    displaced = moved[:, None, :3] + np.cross(moved[:, None, 3:], places - geometry.centre)
    arms = np.broadcast_to((places - centre)[:, None], directions.shape)
    rows = np.concatenate([directions, np.cross(arms, directions)], axis=2).reshape(-1, 6)
    return _Probed(rows, np.einsum("npk,pek->npe", displaced, directions).reshape(len(deviations), -1))


def _measured(
    own: NominalFeature, tolerance: GeometricTolerance, system: Sequence[Sequence[NominalFeature]], deviations: np.ndarray
) -> MeasuredZone:
    """One tolerance, in the system of its datum features, each of which takes what those before leave."""
    centre = own.geometry.centre
    to_motion = np.diag([1.0] * 3 + [1 / own.geometry.reach] * 3)
    motion, free = np.zeros((len(deviations), 6)), to_motion
    for place in system:
        probed = [_probed(datum, datum.geometry.places, datum.geometry.directions, deviations, centre) for datum in place]
        rows, values = np.vstack([each.rows for each in probed]), np.hstack([each.values for each in probed])
        _, S, Vt = np.linalg.svd(rows @ free)
        most = S.max(initial=0.0)
        rank = int((S > NOTICED * max(most, 1.0)).sum())
        taken, free = free @ Vt[:rank].T, free @ Vt[rank:].T
        motion = motion + (taken @ np.linalg.lstsq(rows @ taken, (values - motion @ rows.T).T, rcond=None)[0]).T
    places, directions = _places(own, tolerance, system[0][0]), own.geometry.directions
    if tolerance.kind == "profile" and own.geometry.walls is not None:
        places, directions = own.geometry.walls
    probe = _probed(own, places, directions, deviations, centre)
    left = probe.values - motion @ probe.rows.T
    U, S, _ = np.linalg.svd(probe.rows @ free, full_matrices=False)
    open_ = U[:, NOTICED < S]
    left = left - left @ open_ @ open_.T  # the zone follows what the datums leave open
    needed = _needed(own, tolerance, left.reshape(len(left), *directions.shape[:2]))
    allowed = np.full(len(left), float(tolerance.width))
    if tolerance.bonus != "none" and own.size_column is not None:
        allowed += bonus(own, tolerance, deviations[:, own.size_column])
    plain = all(each.rule == INSIDE and each.cp == 1 and each.cpk is None for each in own.feature.geometric)
    plain = plain and not (tolerance.material and (tolerance.bonus == "accepts" or len(own.layers) > 1))
    sure = tolerance.rule in ("truncated", "uniform")
    return _zone(own, f"{tolerance}; {tolerance.rule}", STATED if plain else 1.0 if sure else np.nan, needed, allowed)


def _places(own: NominalFeature, tolerance: GeometricTolerance, primary: NominalFeature) -> np.ndarray:
    """Where it is measured (point, 3): at its extremes, or along what its zone is projected to."""
    geometry = own.geometry
    if tolerance.projected is None:
        return geometry.places
    outward = geometry.axis * np.sign(primary.geometry.axis @ geometry.axis)
    start = geometry.centre + geometry.half * outward
    return np.array([start, start + tolerance.projected * outward])


def _needed(own: NominalFeature, tolerance: GeometricTolerance, left: np.ndarray) -> np.ndarray:
    """The width (n,) [mm] of the least zone for what is measured (n, point, entry)."""
    if tolerance.kind in ORIENTATIONS or (own.geometry.is_plane and "run-out" in tolerance.kind):
        if own.geometry.is_plane:
            return np.asarray(np.ptp(left[..., 0], axis=1))
        return _length(own, tolerance, left[:, 1] - left[:, 0])
    if tolerance.outside is not None:
        left = left - (tolerance.outside - tolerance.width / 2)
    return np.asarray(2 * np.max([_length(own, tolerance, left[:, k]) for k in range(left.shape[1])], axis=0))


def _length(own: NominalFeature, tolerance: GeometricTolerance, vectors: np.ndarray) -> np.ndarray:
    """Lengths (n,) [mm] of vectors (n, entry): across the planes of a flat zone, or all of it."""
    if tolerance.zone == "flat" and tolerance.across is not None and own.geometry.is_axis:
        return np.asarray(np.abs(vectors @ (own.geometry.directions[0] @ np.array(tolerance.across))))
    return np.asarray(np.linalg.norm(vectors, axis=1))
