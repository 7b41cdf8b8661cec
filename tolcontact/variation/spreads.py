"""Spreads: how the freedoms of features fill the zones of their tolerances, from the innermost tolerance on."""

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import scipy
from scipy.sparse.csgraph import connected_components

from tolcontact import code_cache
from tolcontact.declaration import GeometricTolerance
from tolcontact.declaration.feature_tolerance import EXTREMES, INSIDE
from tolcontact.declaration.size import Size
from tolcontact.declaration.tolerance import SIDES
from tolcontact.discretization import Nominal
from tolcontact.errors import GeometryFault, ModelError
from tolcontact.features import (
    FeatureOfSize,
    FormField,
    Freedom,
    Layer,
    NominalFeature,
    NominalPattern,
    minimum_zone,
    zone_kernel,
)
from tolcontact.features.freedoms import lot_score
from tolcontact.features.minimum_zone import ZoneMember, minimum_widths
from tolcontact.features.tolerance_kinds import floats, includes_form
from tolcontact.geometry.tolerances import MIN_PART
from tolcontact.variation import zones
from tolcontact.variation.zones import SHARE, MemberZone, chi_share, directions

DIRECTIONS = 1 << 12
ENVELOPED, TINY = 1024, 1e-300  # realizations whose heights are computed at once; mm
FACES = 500  # that are drawn for the mean width of measured ones
MIN_SPREAD, MAX_SPREAD = 1e-6, 1e3  # of the width
INNER_SHARE_TOLERANCE = 1e-3  # share of features that narrower tolerances may leave outside of a wider one, beyond 0.27 %


def equal_form_spread(field: FormField, width: float) -> float:
    """Return the standard deviation [mm] of the coefficients with which 99.73 % of the faces lie inside a zone [mm]."""
    widths = np.maximum(_widths(field), 1e-300)

    def excess(spread: float) -> float:
        return float(chi_share(width / spread / widths, field.modes).mean()) - SHARE

    return float(scipy.optimize.brentq(excess, MIN_SPREAD * width, MAX_SPREAD * width, xtol=1e-12 * width))


def mean_width(field: FormField, spreads: np.ndarray) -> float:
    """Return the mean width [mm] of the minimum zones of faces, with coefficients of standard deviations (mode,) [mm]."""
    if field.means is None:
        mean_length = np.sqrt(2) * scipy.special.poch(field.modes / 2, 0.5)  # of the chi distribution
        return float(spreads[0] * mean_length * _widths(field).mean())
    faces = field.means + spreads * np.random.default_rng(0).normal(size=(FACES, len(spreads)))
    return float(minimum_widths(field.zone, faces @ field.place_heights).mean())


def _widths(field: FormField) -> np.ndarray:
    """Return the widths (direction,) of the minimum zones for unit vectors of coefficients in all directions evenly."""
    zone = tuple((member.indices.tobytes(), member.rows.tobytes()) for member in field.zone)
    return _unit_widths(zone, field.place_heights.T.tobytes(), field.modes)


@functools.lru_cache(64)
def _unit_widths(zone: tuple[tuple[bytes, bytes], ...], heights: bytes, modes: int) -> np.ndarray:
    """Return the widths (direction,) [mm] of minimum zones of a number of modes with heights (place, mode).

    The zone is given by the indices and the rows of its members: equal faces have equal widths. They are kept in the cache
    folder of the user.
    """
    sources = (Path(str(module.__file__)).read_bytes() for module in (minimum_zone, zone_kernel, zones))
    places = np.frombuffer(heights).reshape(-1, modes)
    counts = np.array([DIRECTIONS, *places.shape, len(zone)])
    key = "widths-" + code_cache.digest(*sources, counts, *(content for member in zone for content in member), heights)
    stored = code_cache.load(key)
    if stored is None:
        members = [
            ZoneMember(indices, np.frombuffer(rows).reshape(len(indices), -1))
            for indices, rows in ((np.frombuffer(indices, dtype=int), rows) for indices, rows in zone)
        ]
        stored = minimum_widths(members, directions(modes)[:DIRECTIONS] @ places.T).tobytes()
        code_cache.store(key, stored)
    return np.frombuffer(stored)


@dataclass(frozen=True, eq=False)
class Widening:
    """Factors of the widths of zones, each about its middle, and shifts of the middles.

    factors  (contributor,)
    middle   (contributor,), before the shift, in the units of the contributor
    shifts   (contributor,), in the units of the contributor
    """

    factors: np.ndarray
    middle: np.ndarray
    shifts: np.ndarray

    def limits(self, limit: float, columns: np.ndarray) -> np.ndarray:
        """Return a limit deviation [mm] of sizes after their zones are widened, by their columns (size,)."""
        return np.asarray(limit + (self.factors[columns] - 1.0) * (limit - self.middle[columns]) + self.shifts[columns])


@dataclass(frozen=True, eq=False)
class ComponentZone:
    """The zone of the components of a feature, or of members of a pattern that have components in common.

    No row of `rows` @ (components - middle) is longer than half of the width, enlarged by the bonus.

    columns     of the deviations: the components
    rows        (point, entry, component)
    middle      (component,): nonzero for an unequally disposed zone (UZ)
    width       [mm] without the bonus
    scaled      columns of the components that the tolerance adds to narrower ones: they fill the zone with its bonus
    drawn_width [mm] for which the spreads of these components are computed
    sizes       (point,) columns of sizes, if the zone grows as these depart from `limit` in the direction `growth` (1, -1);
                none for a zone without a bonus
    """

    columns: np.ndarray
    rows: np.ndarray
    middle: np.ndarray
    width: float
    scaled: np.ndarray
    drawn_width: float
    sizes: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=int))
    limit: float = 0.0
    growth: float = 0.0

    def scale(self, deviations: np.ndarray, widening: "Widening") -> np.ndarray:
        """Return the factors (n, scaled) of the scaled components for the bonus of deviations (n, contributor).

        Zones are widened already: the bonus counts from the limit of the widened size, and is not widened.
        """
        sizes, factors = np.unique(self.sizes), widening.factors[self.scaled]
        bonus = np.maximum(self.growth * (deviations[:, sizes] - widening.limits(self.limit, sizes)), 0.0)
        return np.asarray((factors * self.width + bonus.min(axis=1)[:, None]) / (factors * self.drawn_width))


@dataclass(frozen=True, eq=False)
class Envelope:
    """The envelope of perfect form at maximum material of a feature of size (ISO 8015; ASME Y14.5, Rule #1).

    A form that would leave it is scaled until it touches the envelope about the feature's own axis or centre.

    scaled   columns of the coefficients of the form
    heights  (mode, place) [mm] of the form outside the material, for coefficients of 1
    sizes    (1,): column of the size
    limit    its deviation [mm] at maximum material
    growth   1.0 if larger sizes have less material (a hole), else -1.0
    """

    scaled: np.ndarray
    heights: np.ndarray
    sizes: np.ndarray
    limit: float
    growth: float

    def scale(self, deviations: np.ndarray, widening: Widening) -> np.ndarray:
        """Return the factors (n, scaled), 0 to 1, of the form for deviations (n, contributor) of widened zones."""
        highest = np.zeros(len(deviations))
        for start in range(0, len(deviations), ENVELOPED):
            rows = slice(start, start + ENVELOPED)
            heights = np.einsum("nm,mp->np", deviations[rows, self.scaled], self.heights)
            highest[rows] = heights.max(axis=1)
        limits = widening.limits(self.limit, self.sizes)
        room = np.maximum(self.growth * (deviations[:, self.sizes] - limits), 0.0) / 2
        return np.minimum(room / np.maximum(highest[:, None], TINY), 1.0).repeat(len(self.scaled), axis=1)


def envelopes(nominal: Nominal) -> list[Envelope]:
    """Return the envelopes of features whose form is drawn and has to stay inside."""
    return [
        Envelope(np.array(member.form_columns), member.form.place_heights, np.array([column]), *_departure(member, size, "M"))
        for pattern in nominal.patterns
        if pattern.declared.is_enveloped and not pattern.is_gauge and (size := pattern.declared.size) is not None
        for member in pattern.members
        if member.form is not None and (column := member.size_column) is not None
    ]


def _departure(member: NominalFeature, size: Size, material: str) -> tuple[float, float]:
    """Return the deviation [mm] of a size at a material limit, "M" or "L", and 1.0 or -1.0: how it departs from the limit."""
    is_inner = isinstance(member.geometry, FeatureOfSize) and member.geometry.is_inner
    return (size.lower, 1.0) if is_inner == (material == "M") else (size.upper, -1.0)


def fill_zones(nominal: Nominal) -> tuple[list[Freedom], list[ComponentZone], dict[str, float]]:
    """Return the freedoms of a model with their spreads, the zones that components fill, and mean widths of forms.

    The widths [mm] are widths of minimum zones, by feature. Raises ModelError if a rule cannot be applied to a feature.
    """
    freedoms, component_zones, mean_widths = list(nominal.freedoms), list[ComponentZone](), dict[str, float]()
    for pattern in nominal.patterns:
        spreads_of_forms = []
        for member in pattern.members:
            if member.form is None or pattern.form is None:
                continue
            form, means = member.form, np.zeros(member.form.modes) if member.form.means is None else member.form.means
            spreads = form.spreads  # as measured, else equal for all modes
            if spreads is None:
                spreads = np.full(form.modes, equal_form_spread(form, pattern.form.width) / pattern.form.cp)
            for column, spread, mean in zip(member.form_columns, spreads, means, strict=True):
                freedoms[column] = replace(freedoms[column], spread=float(spread), mean=float(mean))
            mean_widths[member.label] = mean_width(form, spreads)
            spreads_of_forms.append(spreads)
        try:
            component_zones += _fill_layers(pattern, spreads_of_forms, freedoms)
        except GeometryFault as fault:
            place = f'part "{pattern.declared.part.name}": {pattern.declared.designation}'
            raise ModelError(nominal.assembly.name, [f"{place}: {fault}"]) from fault
    return freedoms, component_zones, mean_widths


def _fill_layers(
    pattern: NominalPattern, spreads_of_forms: Sequence[np.ndarray], freedoms: list[Freedom]
) -> Iterator[ComponentZone]:
    """Give the freedoms of a pattern's layers their spreads, and yield the zones that they fill.

    `spreads_of_forms` are the standard deviations (mode,) [mm] of the form of each member; empty without form.
    """
    basis, spreads, columns = np.zeros((pattern.count, 0)), np.zeros(0), np.zeros(0, dtype=int)
    for layer in pattern.layers:
        tolerance, inner_count, count = layer.tolerance, len(spreads), layer.added.shape[1]
        if not count:
            continue
        if not tolerance.width and inner_count:
            raise GeometryFault(f"{tolerance.kind}: a zone of width 0 is its bonus alone; leave out the tolerances within it")
        basis, columns = np.hstack([basis, layer.added]), np.concatenate([columns, layer.columns])
        members = _member_zones(pattern, layer, basis, spreads_of_forms)
        width = float(tolerance.width) or 1.0  # for which spreads are computed: the bonus scales them
        spread = (zones.extreme_spread if tolerance.rule == EXTREMES else zones.equal_spread)(members, spreads, count, width)
        _check_inner_share(tolerance, [member.take(inner_count) for member in members], spreads, width)
        _check_rule(pattern, tolerance)
        spreads = np.concatenate([spreads, np.full(count, spread / tolerance.cp)])
        # The middle of the zone, in each component.
        middles = np.asarray(tolerance.uneven_shift * (pattern.offsets @ layer.controlled @ layer.controlled.T @ basis))
        means, lots = middles[inner_count:].copy(), np.zeros(count)
        for group, components in _groups(members):
            added, rows = components[components >= inner_count], [members[k].component_rows[..., components] for k in group]
            zone = ComponentZone(
                columns[components], np.concatenate(rows), middles[components], tolerance.width, columns[added], width
            )
            sizes = [pattern.members[k].size_column for k in group]
            if tolerance.material and pattern.declared.size is not None and None not in sizes:
                # The zone grows as the sizes of its members depart from the material limit.
                limit, growth = _departure(pattern.members[group[0]], pattern.declared.size, tolerance.material)
                size_of_point = np.repeat(np.array(sizes, dtype=int), [len(members[k].rows) for k in group])
                zone = replace(zone, sizes=size_of_point, limit=limit, growth=growth)
            yield zone
            if tolerance.cpk is not None:
                means[added[:1] - inner_count] += SIDES[tolerance.side] * (3 * spread * (1 - tolerance.cpk / tolerance.cp))
                lots[added[:1] - inner_count] = lot_score(tolerance)
        for column, mean, middle, lot in zip(layer.columns, means, middles[inner_count:], lots, strict=True):
            freedoms[column] = replace(
                freedoms[column], spread=spread / tolerance.cp, mean=float(mean), middle=float(middle), lot=float(lot)
            )


def _check_inner_share(tolerance: GeometricTolerance, members: Sequence[MemberZone], spreads: np.ndarray, width: float) -> None:
    """Raise GeometryFault if narrower tolerances, with spreads (component,), leave too many features outside of the zone."""
    share = zones.share_inside(members, spreads, width)
    if share < zones.SHARE - INNER_SHARE_TOLERANCE:
        raise GeometryFault(
            f"{tolerance.kind} {tolerance.width:g}: the narrower tolerances within it leave "
            f"{100 * (1 - share):.2g} % of the features outside already; make these narrower, or it wider"
        )


def _check_rule(pattern: NominalPattern, tolerance: GeometricTolerance) -> None:
    """Raise GeometryFault for a rule that form excludes."""
    form, rule = pattern.form, tolerance.rule
    if form is not None and rule != INSIDE and includes_form(tolerance, pattern.geometries[0]):
        raise GeometryFault(
            f'{tolerance.kind}: the rule "{rule}" is for features that keep their shape, and the form of this one is '
            f'drawn; choose "{INSIDE}", or give its {form.kind} form=None'
        )


def _member_zones(
    pattern: NominalPattern, layer: Layer, basis: np.ndarray, spreads_of_forms: Sequence[np.ndarray]
) -> list[MemberZone]:
    """Return the zones of a layer for the members, as their components (coordinate, component) move what it controls."""
    coordinates = layer.controlled @ layer.controlled.T @ basis
    if len(pattern.members) > 1:
        coordinates = np.where(np.abs(coordinates) < MIN_PART, 0.0, coordinates)
    tolerance = layer.tolerance
    rigid_zones = [MemberZone(rows, coordinates[place]) for rows, place in zip(layer.rows, pattern.slices, strict=True)]
    if not spreads_of_forms or not includes_form(tolerance, pattern.geometries[0]):
        return rigid_zones
    members = list[MemberZone]()
    for member, zone, spreads in zip(pattern.members, rigid_zones, spreads_of_forms, strict=True):
        form, geometry = member.form, member.geometry
        assert form is not None
        offsets = geometry.rows((form.places, form.normals[:, None]))[:, 0]
        heights, is_floating = spreads * form.place_heights.T, floats(tolerance, geometry, zone.rows)
        members.append(replace(zone, heights=heights, offsets=offsets, floats=is_floating))
    return members


def _groups(members: Sequence[MemberZone]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the indices of members that have components in common, and these components, in the order of the first members.

    A group is one member if no component moves it and others.
    """
    moved = np.array([(member.component_rows != 0).any(axis=(0, 1)) for member in members])
    if len(members) == 1:
        moved[:] = True
    _, labels = connected_components(moved.astype(int) @ moved.astype(int).T)
    for label in range(labels.max() + 1):
        group = np.flatnonzero(labels == label)
        yield group, np.flatnonzero(moved[group].any(axis=0))
