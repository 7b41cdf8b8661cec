"""Populations measured back, as a coordinate measuring machine would: the share of drawn features that lies in its zones.

Points of every feature are displaced as drawn. The datum system of each tolerance is fitted to points of its datum features.
The width of the zone that the feature's own points then need is compared with the allowed one. Spreads are not used.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

import tolcontact as tc
from tolcontact.declaration import OUTSIDE, GeometricTolerance
from tolcontact.declaration.feature_tolerance import INSIDE
from tolcontact.discretization import Nominal, discretize
from tolcontact.features import AxisFeature, FeatureGeometry, FeatureOfSize, Layer, NominalFeature, NominalPattern, PlaneFeature
from tolcontact.features.feature_geometry import Probes
from tolcontact.features.minimum_zone import minimax, minimum_widths
from tolcontact.features.tolerance_kinds import (
    ZONES,
    axis_zone,
    direction_zone,
    flat_axis_zone,
    floats,
    form_zone,
    includes_form,
    slope_zone,
    surface_zone,
    zone_rows,
)
from tolcontact.statistics.intervals import proportion_of
from tolcontact.variation import Draws

MIN_NOTICED = 1e-4  # smallest singular value, relative to the largest, of a motion that datums notice
STATED_SHARE = 0.9973
ROUNDING = 1e-9  # of a width


class MeasuredZone(NamedTuple):
    """The result of measuring one tolerance of a feature.

    stated    the share inside that its rule states; NaN if it states none
    feature   as part.feature, or as part.pattern
    inside    number of features inside; of a pattern, of one member in turn
    drawn     number of drawn features or patterns
    needed    [mm]: width of the zone that 99.73 % of them need
    """

    feature: str
    tolerance: str
    stated: float
    inside: int
    drawn: int
    needed: float


@dataclass(frozen=True)
class Population:
    """Drawn features, measured: an entry for each size and each tolerance of a model.

    stated_share  (zone,) share that the rule from zone to spread states; NaN if it states none
    share, lower, upper  (zone,) estimate of the share inside, and its exact 95 % interval
    needed_width  (zone,) [mm] width of the zone that 99.73 % of the features need
    """

    features: list[str]
    tolerances: list[str]
    stated_share: np.ndarray
    share: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    needed_width: np.ndarray


def measured_back(model: tc.Assembly, samples: int, seed: int = 1) -> Population:
    """Draw `samples` of every feature of a model, and measure them.

    Nested tolerances, and tolerances with a bonus, may have a larger share inside than stated.
    """
    nominal = discretize(model)
    zones = list(_measured_zones(nominal, Draws(nominal), seed=seed, count=samples))
    shares = np.array([proportion_of(zone.inside, zone.drawn) for zone in zones]).reshape(-1, 3)
    return Population(
        [zone.feature for zone in zones],
        [zone.tolerance for zone in zones],
        np.array([zone.stated for zone in zones]),
        *shares.T,
        np.array([zone.needed for zone in zones]),
    )


class _Measurement(NamedTuple):
    """What probes of a feature measure: `rows` (value, 6) of a motion about a centre, and `values` (n, value) [mm] as drawn."""

    rows: np.ndarray
    values: np.ndarray


def _measured_zones(nominal: Nominal, draws: Draws, *, seed: int, count: int) -> Iterator[MeasuredZone]:
    """Measure every tolerance of every feature or pattern on `count` drawn ones.

    Of each drawn pattern one member is judged, in turn: the results are then independent of each other.
    """
    deviations = draws(seed=seed, start=0, stop=count)
    for pattern in nominal.patterns:
        size, columns = pattern.declared.size, [member.size_column for member in pattern.members]
        if size is not None:
            sizes = _in_turn([deviations[:, column] for column in columns if column is not None])
            stated = STATED_SHARE if size.distribution == "normal" and size.cp is None else np.nan
            needed = 2 * np.abs(sizes - (size.upper + size.lower) / 2)
            yield _measured_zone(pattern, str(size), stated, needed, size.upper - size.lower)
        datums = nominal.datums(pattern.part)
        for layer in pattern.layers:
            if layer.controlled.shape[1]:
                system = [
                    [datum for letter in compartment for datum in datums[letter]] for compartment in layer.tolerance.system
                ]
                yield _measured_tolerance(pattern, layer, system, deviations)
            elif layer.tolerance is pattern.form:
                yield _measured_form(pattern, layer, deviations)


def _in_turn(values: Sequence[np.ndarray]) -> np.ndarray:
    """Return the values (n,) of one member of each of n patterns, in turn, from those of all members, each (n,)."""
    rows = np.arange(len(values[0]))
    return np.asarray(np.array(values)[rows % len(values), rows])


def _measured_zone(
    pattern: NominalPattern, tolerance: str, stated: float, needed: np.ndarray, allowed: np.ndarray | float
) -> MeasuredZone:
    inside = needed <= np.asarray(allowed) * (1 + ROUNDING)
    width = float(np.quantile(needed, STATED_SHARE))
    return MeasuredZone(pattern.declared.label, tolerance, stated, int(inside.sum()), len(needed), width)


def _measured_tolerance(
    pattern: NominalPattern, layer: Layer, system: Sequence[Sequence[NominalFeature]], deviations: np.ndarray
) -> MeasuredZone:
    """Measure one tolerance of a feature or pattern in the system of its datum features."""
    tolerance, centre = layer.tolerance, pattern.centre
    primary = system[0][0].geometry if system else None
    has_form = pattern.form is not None and includes_form(tolerance, pattern.members[0].geometry)
    probes = [
        _form_probes(member) if has_form else _zone_probes(tolerance, member.geometry, primary) for member in pattern.members
    ]
    measurements = [
        _measurement(member, *places, deviations, centre) for member, places in zip(pattern.members, probes, strict=True)
    ]
    if has_form:
        measurements = [
            measurement._replace(values=measurement.values + _form_heights(member, deviations))
            for member, measurement in zip(pattern.members, measurements, strict=True)
        ]
    rows = np.vstack([measurement.rows for measurement in measurements])
    motion, free = _fitted_frame(pattern, system, deviations, tolerance.orientation_only)
    residuals = np.hstack([measurement.values for measurement in measurements]) - motion @ rows.T - tolerance.uneven_shift
    # The zones follow the members together in the motions that the datums leave free.
    U, S, _ = np.linalg.svd(rows @ free, full_matrices=False)
    following = U[:, MIN_NOTICED < S]
    residuals = residuals - residuals @ following @ following.T
    needed, allowed, start = [], [], 0
    for member, measurement, (_, directions) in zip(pattern.members, measurements, probes, strict=True):
        end = start + len(measurement.rows)
        of_member = residuals[:, start:end].reshape(len(residuals), *directions.shape[:2])
        has_any_size = has_form and floats(tolerance, member.geometry, zone_rows(tolerance, member.geometry, primary))
        width = np.ptp(of_member[..., 0], axis=1) if has_any_size else _needed_width(tolerance, member.geometry, of_member)
        needed.append(width)
        allowed.append(np.full(len(residuals), float(tolerance.width)))
        if member.size_column is not None:
            allowed[-1] += _bonus(member, tolerance, deviations[:, member.size_column])
        start = end
    stated = _stated_share(pattern, layer)
    return _measured_zone(pattern, f"{tolerance}; {tolerance.rule}", stated, _in_turn(needed), _in_turn(allowed))


def _bonus(feature: NominalFeature, tolerance: GeometricTolerance, size: np.ndarray) -> np.ndarray:
    """Return the growth [mm] of a zone for size deviations of any shape: their departure from the material limit."""
    limits = feature.feature.size
    if limits is None or not tolerance.material:
        return np.zeros_like(size)
    is_inner = isinstance(feature.geometry, FeatureOfSize) and feature.geometry.is_inner
    counts_from_lower = is_inner == (tolerance.material == "M")
    return np.maximum(size - limits.lower if counts_from_lower else limits.upper - size, 0.0)


def _zone_probes(tolerance: GeometricTolerance, feature: FeatureGeometry, primary: FeatureGeometry | None) -> Probes:
    """Return the places and directions in which a feature is measured for a tolerance."""
    if ZONES[tolerance.of][type(feature)] is surface_zone:
        return feature.surface_probes
    places, directions = feature.extremes
    if tolerance.projected is None:
        return places, directions
    assert isinstance(feature, AxisFeature) and isinstance(primary, PlaneFeature)
    outward = feature.axis * np.sign(primary.normal @ feature.axis)
    start = feature.centre + feature.half * outward
    return np.array([start, start + tolerance.projected * outward]), directions


def _needed_width(tolerance: GeometricTolerance, feature: FeatureGeometry, residuals: np.ndarray) -> np.ndarray:
    """Return the width (n,) [mm] of the narrowest zone around what probes measured (n, point, entry) [mm]."""
    return WIDTHS[ZONES[tolerance.of][type(feature)]](tolerance, feature, residuals)


def _width_about_surface(tolerance: GeometricTolerance, feature: FeatureGeometry, residuals: np.ndarray) -> np.ndarray:
    return 2 * np.max([np.linalg.norm(residuals[:, k], axis=1) for k in range(residuals.shape[1])], axis=0)


def _width_about_axis(tolerance: GeometricTolerance, feature: FeatureGeometry, residuals: np.ndarray) -> np.ndarray:
    return 2 * np.max([_lengths(tolerance, feature, residuals[:, k]) for k in range(residuals.shape[1])], axis=0)


def _lengths(tolerance: GeometricTolerance, feature: FeatureGeometry, vectors: np.ndarray) -> np.ndarray:
    """Return the lengths (n,) [mm] of vectors (n, entry) across an axis; in a flat zone those across its planes."""
    if tolerance.zone == "flat" and tolerance.across is not None:
        return np.abs(vectors @ (feature.extremes[1][0] @ np.array(tolerance.across)))
    return np.linalg.norm(vectors, axis=1)


WIDTHS: dict[Callable, Callable[[GeometricTolerance, FeatureGeometry, np.ndarray], np.ndarray]] = {
    surface_zone: _width_about_surface,
    slope_zone: lambda tolerance, feature, residuals: np.ptp(residuals[..., 0], axis=1),
    axis_zone: _width_about_axis,
    flat_axis_zone: _width_about_axis,
    direction_zone: lambda tolerance, feature, residuals: _lengths(tolerance, feature, residuals[:, 1] - residuals[:, 0]),
    form_zone: lambda tolerance, feature, residuals: np.zeros(len(residuals)),
}


def _measured_form(pattern: NominalPattern, layer: Layer, deviations: np.ndarray) -> MeasuredZone:
    """Measure the tolerance by which the form of a feature or pattern is drawn: the least zones of its faces."""
    widths = [
        minimum_widths(member.form.zone, _form_heights(member, deviations))
        for member in pattern.members
        if member.form is not None
    ]
    tolerance = layer.tolerance
    stated = STATED_SHARE if tolerance.cp == 1 else np.nan
    return _measured_zone(pattern, f"{tolerance}; {tolerance.rule}", stated, _in_turn(widths), tolerance.width)


def _form_probes(feature: NominalFeature) -> Probes:
    """Return places all over a face with form, and its normal at each."""
    assert feature.form is not None
    return feature.form.places, feature.form.normals[:, None]


def _form_heights(feature: NominalFeature, deviations: np.ndarray) -> np.ndarray:
    """Return the heights (n, place) [mm] of the form of drawn features at these places."""
    assert feature.form is not None
    return np.asarray(deviations[:, feature.form_columns] @ feature.form.place_heights)


def _stated_share(pattern: NominalPattern, layer: Layer) -> float:
    """Return the share of features inside that the rules state; NaN if they state none."""
    tolerance, tolerances = layer.tolerance, pattern.declared.geometric
    is_shared = any(pattern.owner(direction) is None for direction in layer.added.T)
    has_bonus_beside = tolerance.material and (len(pattern.layers) > 1 or is_shared)
    if all(nested.rule == INSIDE and nested.cp == 1 and nested.cpk is None for nested in tolerances) and not has_bonus_beside:
        return STATED_SHARE
    return np.nan


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


def _tangents(motions: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Return the heights (n, place) of the planes that touch those of a face outside of the material, with the least distance.

    Planes may shift along their normals, and tilt as the face does in `motions` (place, freedom).
    """
    tilts, lengths, _ = np.linalg.svd(motions - motions.mean(axis=0), full_matrices=False)
    tilts = tilts[:, lengths > MIN_NOTICED * max(lengths.max(initial=0.0), 1.0)]
    rows = np.column_stack([np.ones(len(motions)), tilts / np.abs(tilts).max(axis=0, initial=MIN_NOTICED)])
    middle, _ = minimax(rows, heights)
    planes = middle @ rows.T
    return np.asarray(planes + (heights - planes).max(axis=1)[:, None])


def _fitted_frame(
    pattern: NominalPattern,
    system: Sequence[Sequence[NominalFeature]],
    deviations: np.ndarray,
    orientation_only: Sequence[bool],
) -> tuple[np.ndarray, np.ndarray]:
    """Return the motions (n, 6) of the datum frame about the pattern's centre, and a basis (6, freedom) of its free motions.

    The datum features of each compartment are fitted by least squares, with the motions that the compartments before it leave
    free. A plane by itself is then moved out of the material until no probe of it stands outside of its datum. One with form is
    measured all over, and what is fitted to it first is the plane that touches it.
    """
    centre = pattern.centre
    free = np.diag([1.0] * 3 + [1 / pattern.reach] * 3)
    motion = np.zeros((len(deviations), 6))
    for compartment, is_turned in zip(system, orientation_only, strict=True):
        is_outside = len(compartment) == 1 and _touches_outside(compartment[0])
        has_form = is_outside and compartment[0].form is not None
        probes = [_form_probes(datum) if has_form else datum.geometry.extremes for datum in compartment]
        measurements = [
            _measurement(datum, *places, deviations, centre) for datum, places in zip(compartment, probes, strict=True)
        ]
        rows = np.vstack([measurement.rows for measurement in measurements])
        values = np.hstack([measurement.values for measurement in measurements])
        if has_form:
            residuals = values - motion @ rows.T + _form_heights(compartment[0], deviations)
            values = motion @ rows.T + _tangents(rows @ free, residuals)
        if is_turned:  # what any translation changes is not measured
            seen = scipy.linalg.orth(rows[:, :3])
            rows, values = rows - seen @ (seen.T @ rows), values - values @ seen @ seen.T
        _, S, Vt = np.linalg.svd(rows @ free)
        rank = int((S > MIN_NOTICED * max(S.max(initial=0.0), 1.0)).sum())
        locked, free = free @ Vt[:rank].T, free @ Vt[rank:].T
        residuals = values - motion @ rows.T
        locked_motion, *_ = np.linalg.lstsq(rows @ locked, residuals.T, rcond=None)
        motion = motion + (locked @ locked_motion).T
        if not is_turned and is_outside and not has_form:
            outermost = (values - motion @ rows.T).max(axis=1)
            shift, *_ = np.linalg.lstsq(rows @ locked, np.ones(len(rows)), rcond=None)
            motion = motion + outermost[:, None] * (locked @ shift)
    return motion, free
