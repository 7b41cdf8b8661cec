"""Zones of components: what tolerances allow of the components of a feature, and of members of a pattern."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from tolcontact.declaration import GeometricTolerance
from tolcontact.declaration.feature_tolerance import AROUND_ROUND, RUNOUTS
from tolcontact.features import FeatureGeometry, FeatureOfSize, Layer, NominalFeature, NominalPattern, PlaneFeature
from tolcontact.variation.form_spreads import FormedZone
from tolcontact.variation.zones import MemberZone

MIN_PART = 1e-12  # of a component of 1: smaller parts of it in a coordinate are rounding


@dataclass(frozen=True, eq=False)
class ComponentZone:
    """A zone of the components of a feature, or of members of a pattern that have components in common.

    No row of `rows` @ (components - middle) is longer than half of the width, enlarged by the bonus.

    columns     of the deviations: the components
    rows        (point, entry, component)
    middle      (component,): not 0 for a zone that is disposed unevenly
    sizes       (point,) columns of sizes, if the zone grows as these depart from `limit` in the direction `growth` (1, -1)
    """

    columns: np.ndarray
    rows: np.ndarray
    middle: np.ndarray
    width: float
    sizes: np.ndarray | None = None
    limit: float = 0.0
    growth: float = 0.0


@dataclass(frozen=True, eq=False)
class MemberGroup:
    """Members of a pattern that have components in common; one member if no component moves it and others.

    components  (component,) numbers of the components that move these members
    added       (component,) numbers, in the layer, of those among them that it adds
    rows        for each member (point, entry, component)
    """

    members: tuple[NominalFeature, ...]
    components: np.ndarray
    added: np.ndarray
    rows: tuple[np.ndarray, ...]

    @property
    def sizes(self) -> np.ndarray:
        """The columns (member,) of the sizes of the members; empty without sizes."""
        return np.array([member.size_column for member in self.members if member.size_column is not None], dtype=int)


def member_zones(
    pattern: NominalPattern, layer: Layer, basis: np.ndarray, form_spreads: Sequence[np.ndarray]
) -> list[MemberZone]:
    """Return the zones of a layer for the members, as their components (coordinate, component) move what it controls.

    `form_spreads` are the standard deviations (mode,) [mm] of the coefficients of the form of each; empty without form.
    """
    coordinates = layer.controlled @ layer.controlled.T @ basis
    if len(pattern.members) > 1:
        coordinates = np.where(np.abs(coordinates) < MIN_PART, 0.0, coordinates)
    places = pattern.geometry.slices
    if not len(form_spreads) or not includes_form(layer.tolerance, pattern.geometry.members[0]):
        return [MemberZone(rows, coordinates[place]) for rows, place in zip(layer.rows, places, strict=True)]
    return [
        _formed_zone(member, layer.tolerance, rows, coordinates[place], spread)
        for member, rows, place, spread in zip(pattern.members, layer.rows, places, form_spreads, strict=True)
    ]


def includes_form(tolerance: GeometricTolerance, geometry: FeatureGeometry) -> bool:
    """Return whether the zone of a tolerance is one for the surface with its form: not for an axis, or a tangent plane."""
    return not tolerance.tangent and (isinstance(geometry, PlaneFeature) or tolerance.kind in AROUND_ROUND)


def floats(tolerance: GeometricTolerance, geometry: FeatureGeometry, rows: np.ndarray) -> bool:
    """Return whether a zone with these rows may lie anywhere along the normals of the surface, a round one of any size."""
    if isinstance(geometry, PlaneFeature):
        return not rows[..., 0].any()  # it limits tilts alone, and not the offset, the first coordinate of a plane
    return tolerance.kind in RUNOUTS


def _formed_zone(
    member: NominalFeature, tolerance: GeometricTolerance, rows: np.ndarray, coordinates: np.ndarray, spreads: np.ndarray
) -> FormedZone:
    """Return the zone of a surface with form."""
    field, geometry = member.form, member.geometry
    assert field is not None
    offsets = geometry.rows((field.places, field.normals[:, None]))[:, 0]
    heights = spreads * field.place_heights.T
    return FormedZone(rows, coordinates, heights, offsets, floats(tolerance, geometry, rows))


def member_groups(pattern: NominalPattern, layer: Layer, zones: Sequence[MemberZone]) -> Iterator[MemberGroup]:
    """Yield the groups of members that have components in common, in the order of their first members."""
    count = zones[0].coordinates.shape[1]
    inner_count = count - layer.added.shape[1]
    if len(zones) == 1:
        moved = np.ones((1, count), dtype=bool)
    else:
        moved = np.array([(zone.component_rows != 0).any(axis=(0, 1)) for zone in zones])
    remaining = list(range(len(zones)))
    while remaining:
        numbers, components = [remaining[0]], moved[remaining[0]]
        while joined := [k for k in remaining if k not in numbers and (moved[k] & components).any()]:
            numbers, components = sorted([*numbers, *joined]), components | moved[joined].any(axis=0)
        remaining = [k for k in remaining if k not in numbers]
        columns = np.flatnonzero(components)
        rows = tuple(zones[k].component_rows[..., columns] for k in numbers)
        yield MemberGroup(
            tuple(pattern.members[k] for k in numbers), columns, columns[columns >= inner_count] - inner_count, rows
        )


def component_zone(pattern: NominalPattern, layer: Layer, group: MemberGroup, middle: np.ndarray) -> ComponentZone:
    """Return the zone that a layer's tolerance is for the components of a group, of this layer and the narrower ones.

    `middle` (component,) [mm] is that of the zone in all components of these layers (see uneven_shifts).
    """
    tolerance, size, middle = layer.tolerance, pattern.declared.size, middle[group.components]
    columns, rows = pattern.first_column + group.components, np.concatenate(group.rows)
    if size is None or not tolerance.material:
        return ComponentZone(columns, rows, middle, tolerance.width)
    counts_up = _counts_from_lower(group.members[0], tolerance)
    limit, growth = (size.lower, 1.0) if counts_up else (size.upper, -1.0)
    sizes = np.repeat(group.sizes, [len(member) for member in group.rows])
    return ComponentZone(columns, rows, middle, tolerance.width, sizes, limit, growth)


def uneven_shifts(pattern: NominalPattern, layer: Layer, basis: np.ndarray) -> np.ndarray:
    """Return the distance [mm] of the middle of a layer's zone from nominal in each direction of a `basis`, (component,).

    The basis (coordinate, component) holds the directions that the layer and the narrower ones add.
    """
    return np.asarray(layer.tolerance.uneven_shift * (pattern.geometry.offsets @ layer.controlled @ layer.controlled.T @ basis))


def bonus(feature: NominalFeature, tolerance: GeometricTolerance, size: np.ndarray) -> np.ndarray:
    """Return the growth [mm] of a zone for size deviations of any shape: their departure from the material limit."""
    limits = feature.feature.size
    if limits is None or not tolerance.material:
        return np.zeros_like(size)
    return np.maximum(size - limits.lower if _counts_from_lower(feature, tolerance) else limits.upper - size, 0.0)


def _counts_from_lower(feature: NominalFeature, tolerance: GeometricTolerance) -> bool:
    """Return whether a zone grows as the size exceeds its lower limit; else it grows as the size falls below the upper one."""
    is_inner = isinstance(feature.geometry, FeatureOfSize) and feature.geometry.is_inner
    return is_inner == (tolerance.material == "M")
