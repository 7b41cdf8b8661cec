"""A population measured back, as a coordinate measuring machine would: the share of drawn features that lies in its zones.

Points of every feature are displaced as drawn. The datum system of each tolerance is fitted to points of its datum features.
The width of the zone that the feature's own points then need is compared with the allowed one. Spreads are not used.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import scipy

from tolcontact.declaration import OUTSIDE, GeometricTolerance
from tolcontact.declaration.feature_tolerance import INSIDE
from tolcontact.discretization import Nominal
from tolcontact.features import NominalFeature, PlaneFeature, zone_of
from tolcontact.variation.contributors import bonus
from tolcontact.variation.draws import Draws

MIN_NOTICED = 1e-4  # smallest singular value, relative to the largest, of a motion that datums notice
STATED_SHARE = 0.9973
ROUNDING = 1e-9  # of a width


class MeasuredZone(NamedTuple):
    """The result of measuring one tolerance of a feature.

    stated    the share inside that its rule states; NaN if it states none
    inside    number of features inside
    drawn     number of drawn features
    needed    [mm]: width of the zone that 99.73 % of them need
    """

    feature: str
    tolerance: str
    stated: float
    inside: int
    drawn: int
    needed: float


class _Measurement(NamedTuple):
    """What probes of a feature measure: `rows` (value, 6) of a motion about a centre, and `values` (n, value) [mm] as drawn."""

    rows: np.ndarray
    values: np.ndarray


def measured_population(nominal: Nominal, draws: Draws, *, seed: int, count: int) -> Iterator[MeasuredZone]:
    """Measure every tolerance of every feature on `count` drawn features."""
    deviations = draws(seed=seed, start=0, stop=count)
    for feature in nominal.features:
        size = feature.feature.size
        if size is not None and feature.size_column is not None:
            from_middle = deviations[:, feature.size_column] - (size.upper + size.lower) / 2
            stated = STATED_SHARE if size.distribution == "normal" and size.cp is None else np.nan
            yield _measured_zone(feature, str(size), stated, 2 * np.abs(from_middle), size.upper - size.lower)
        datums = {datum.feature.datum: datum for datum in nominal.features if datum.part == feature.part}
        for layer in feature.layers:
            if layer.controlled.shape[1]:
                system = [[datums[letter] for letter in compartment] for compartment in layer.tolerance.system]
                yield _measured_tolerance(feature, layer.tolerance, system, deviations)


def _measured_zone(
    feature: NominalFeature, tolerance: str, stated: float, needed: np.ndarray, allowed: np.ndarray | float
) -> MeasuredZone:
    inside = needed <= np.asarray(allowed) * (1 + ROUNDING)
    width = float(np.quantile(needed, STATED_SHARE))
    return MeasuredZone(feature.label, tolerance, stated, int(inside.sum()), len(needed), width)


def _measured_tolerance(
    feature: NominalFeature, tolerance: GeometricTolerance, system: Sequence[Sequence[NominalFeature]], deviations: np.ndarray
) -> MeasuredZone:
    """Measure one tolerance of a feature in the system of its datum features."""
    zone = zone_of(tolerance, feature.geometry, system[0][0].geometry)
    places, directions = zone.probes
    measurement = _measurement(feature, places, directions, deviations, feature.geometry.centre)
    motion, free = _fitted_frame(feature, system, deviations, tolerance.orientation_only)
    residuals = measurement.values - motion @ measurement.rows.T
    # The zone follows the feature in the motions that the datums leave free.
    U, S, _ = np.linalg.svd(measurement.rows @ free, full_matrices=False)
    following = U[:, MIN_NOTICED < S]
    residuals = residuals - residuals @ following @ following.T
    needed = zone.needed_width(residuals.reshape(len(residuals), *directions.shape[:2]))
    allowed = np.full(len(residuals), float(tolerance.width))
    if tolerance.bonus != "none" and feature.size_column is not None:
        allowed += bonus(feature, tolerance, deviations[:, feature.size_column])
    return _measured_zone(feature, f"{tolerance}; {tolerance.rule}", _stated_share(feature, tolerance), needed, allowed)


def _stated_share(feature: NominalFeature, tolerance: GeometricTolerance) -> float:
    """Return the share of features inside that the rules state; NaN if they state none."""
    has_bonus_beside = tolerance.material and (tolerance.bonus == "accepts" or len(feature.layers) > 1)
    tolerances = feature.feature.geometric
    if all(nested.rule == INSIDE and nested.cp == 1 and nested.cpk is None for nested in tolerances) and not has_bonus_beside:
        return STATED_SHARE
    return 1.0 if tolerance.rule in ("truncated", "uniform") else np.nan


def _measurement(
    feature: NominalFeature, places: np.ndarray, directions: np.ndarray, deviations: np.ndarray, centre: np.ndarray
) -> _Measurement:
    """Measure drawn features at `places` (point, 3) along `directions` (point, entry, 3); motions turn about `centre` (3,)."""
    geometry = feature.geometry
    motions = deviations[:, : feature.coordinates.shape[1]] @ (geometry.twists @ feature.coordinates).T
    displacements = motions[:, None, :3] + np.cross(motions[:, None, 3:], places - geometry.centre)
    arms = np.broadcast_to((places - centre)[:, None], directions.shape)
    rows = np.concatenate([directions, np.cross(arms, directions)], axis=2).reshape(-1, 6)
    return _Measurement(rows, np.einsum("npk,pek->npe", displacements, directions).reshape(len(deviations), -1))


def _touches_outside(datum: NominalFeature) -> bool:
    return isinstance(datum.geometry, PlaneFeature) and datum.feature.association == OUTSIDE


def _fitted_frame(
    feature: NominalFeature,
    system: Sequence[Sequence[NominalFeature]],
    deviations: np.ndarray,
    orientation_only: Sequence[bool],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the motions (n, 6) of the datum frame about the feature's centre, and a basis (6, freedom) of its free motions.

    The datum features of each compartment are fitted by least squares, with the motions that the compartments before it leave
    free. A plane by itself is then moved out of the material until no probe of it stands outside of its datum.
    """
    centre = feature.geometry.centre
    free = np.diag([1.0] * 3 + [1 / feature.geometry.reach] * 3)
    motion = np.zeros((len(deviations), 6))
    for compartment, is_turned in zip(system, orientation_only, strict=True):
        measurements = [_measurement(datum, *datum.geometry.extremes, deviations, centre) for datum in compartment]
        rows = np.vstack([measurement.rows for measurement in measurements])
        values = np.hstack([measurement.values for measurement in measurements])
        if is_turned:  # what any translation changes is not measured
            seen = scipy.linalg.orth(rows[:, :3])
            rows, values = rows - seen @ (seen.T @ rows), values - values @ seen @ seen.T
        _, S, Vt = np.linalg.svd(rows @ free)
        rank = int((S > MIN_NOTICED * max(S.max(initial=0.0), 1.0)).sum())
        locked, free = free @ Vt[:rank].T, free @ Vt[rank:].T
        residuals = values - motion @ rows.T
        locked_motion, *_ = np.linalg.lstsq(rows @ locked, residuals.T, rcond=None)
        motion = motion + (locked @ locked_motion).T
        if not is_turned and len(compartment) == 1 and _touches_outside(compartment[0]):
            outermost = (values - motion @ rows.T).max(axis=1)
            shift, *_ = np.linalg.lstsq(rows @ locked, np.ones(len(rows)), rcond=None)
            motion = motion + outermost[:, None] * (locked @ shift)
    return motion, free
