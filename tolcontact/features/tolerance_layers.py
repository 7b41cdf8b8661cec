"""Layers: the freedoms of a feature that each of its tolerances controls, and the frames of datum systems (ISO 5459)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from tolcontact.declaration import Feature, GeometricTolerance
from tolcontact.declaration.feature_tolerance import TRANSLATIONS
from tolcontact.errors import GeometryFault
from tolcontact.features.feature_geometry import FeatureGeometry
from tolcontact.features.tolerance_kinds import zone_of

MIN_NOTICED = 1e-4  # smallest singular value, relative to the largest, of a displacement that a datum notices
RANK_TOLERANCE = 1e-4  # smallest singular value of an independent direction: shapes of single precision are no better


class Datum(NamedTuple):
    """A datum feature, and its coordinates (coordinate, column) for deviations of 1."""

    geometry: FeatureGeometry
    coordinates: np.ndarray


class DatumFrame(NamedTuple):
    """The frame of a datum system, for displacements (tau, rho) about one centre.

    motion   (6, column) of the frame for deviations of 1
    free     (6, freedom): displacements that none of the datums notices
    """

    motion: np.ndarray
    free: np.ndarray


@dataclass(frozen=True, eq=False)
class Layer:
    """The freedoms of a feature that one tolerance controls beyond the tolerances within it.

    rows        (point, component, coordinate) of its zone (see tolerance_kinds.Zone)
    controlled  (coordinate, n): orthonormal directions that its datums lock
    added       (coordinate, k): directions that no narrower tolerance controls and that its rule draws; each is a contributor
    frame       of its datum system
    """

    tolerance: GeometricTolerance
    rows: np.ndarray
    controlled: np.ndarray
    added: np.ndarray
    frame: DatumFrame


def datum_frame(system: Sequence[Sequence[Datum]], centre: np.ndarray, reach: float, columns: int) -> DatumFrame:
    """Return the frame of datums in their precedence: each takes what it notices of the freedoms left by those before it.

    The datums of one compartment count together, by least squares of their coordinates. Angles are weighed by `reach` [mm].
    """
    to_twist = np.diag([1.0] * 3 + [1 / reach] * 3)
    motion, free = np.zeros((6, columns)), np.eye(6)
    for compartment in system:
        values = np.vstack([datum.geometry.about(centre) for datum in compartment]) @ to_twist
        coordinates = np.vstack([datum.coordinates for datum in compartment])
        U, S, Vt = np.linalg.svd(values @ free)
        largest = S.max(initial=0.0)
        rank = int((S > MIN_NOTICED * max(largest, 1e-300)).sum()) if largest > MIN_NOTICED else 0
        if rank:
            inverse = Vt[:rank].T @ (U[:, :rank] / S[:rank]).T
            motion = motion + free @ inverse @ (coordinates - values @ motion)
        free = free @ Vt[rank:].T
    return DatumFrame(to_twist @ motion, to_twist @ free)


def tolerance_layers(
    feature: Feature, geometry: FeatureGeometry, datums: Mapping[str | None, Datum], columns: int
) -> tuple[Layer, ...]:
    """Return a layer for each geometric tolerance of a feature, from the one that controls fewest freedoms on.

    `datums` are by their letters. Raises GeometryFault for tolerances that the feature cannot have, or that do not nest.
    """
    candidates = [_layer(tolerance, geometry, datums, columns) for tolerance in feature.geometric]
    candidates.sort(key=lambda layer: (layer.controlled.shape[1], layer.tolerance.width))
    layers: list[Layer] = []
    controlled_before = np.zeros((len(geometry.names), 0))
    for candidate in candidates:
        tolerance, controlled = candidate.tolerance, candidate.controlled
        _check_nesting(candidate, layers)
        added = _along_coordinates(_difference(controlled, controlled_before), geometry)
        if tolerance.rule in TRANSLATIONS:
            added = _translations(tolerance, geometry, added)
        if controlled.shape[1] and not added.shape[1]:
            raise GeometryFault(
                f"{tolerance.kind} {tolerance.width:g} controls nothing that others do not; leave one of them out"
            )
        controlled_before = np.hstack([controlled_before, added])
        layers.append(replace(candidate, added=added))
    return tuple(layers)


def _layer(tolerance: GeometricTolerance, geometry: FeatureGeometry, datums: Mapping[str | None, Datum], columns: int) -> Layer:
    """Return the layer of a tolerance by itself, to which nothing is added yet."""
    absent = [letter for compartment in tolerance.system for letter in compartment if letter not in datums]
    if absent:
        raise GeometryFault(f"{tolerance.kind} refers to datum {absent[0]}, which could not be made; mend its feature first")
    system = [[datums[letter] for letter in compartment] for compartment in tolerance.system]
    rows = zone_of(tolerance, geometry, system[0][0].geometry if system else None).rows
    frame = datum_frame(system, geometry.centre, geometry.reach, columns)
    nothing = np.zeros((len(geometry.names), 0))
    controlled = _controlled(rows, geometry, frame) if system else nothing
    if len(rows) and system and not controlled.shape[1]:
        raise GeometryFault(
            f"{tolerance.kind}: the datum system {tolerance.datums} does not lock any of what is toleranced; "
            "add the datum that does"
        )
    return Layer(tolerance, rows, controlled, nothing, frame)


def _check_nesting(outer: Layer, layers: Sequence[Layer]) -> None:
    """Raise GeometryFault if a tolerance is narrower than one of the tolerances within it."""
    tolerance = outer.tolerance
    for layer in layers:
        inner = layer.tolerance
        contains = layer.controlled.shape[1] and _difference(layer.controlled, outer.controlled).shape[1] == 0
        if contains and tolerance.width < inner.width and not (tolerance.material or inner.material):
            raise GeometryFault(
                f"{tolerance.kind} {tolerance.width:g} is narrower than {inner.kind} {inner.width:g}, "
                "which it contains; expected orientation within location"
            )


def _translations(tolerance: GeometricTolerance, geometry: FeatureGeometry, added: np.ndarray) -> np.ndarray:
    """Return the part of the added directions (coordinate, n) that does not turn the feature."""
    turns = geometry.twists[3:] @ added * geometry.reach
    _, S, Vt = np.linalg.svd(turns)
    translations = added @ Vt[int((S > RANK_TOLERANCE).sum()) :].T
    if not translations.shape[1]:
        raise GeometryFault(f'{tolerance.kind}: the rule "{tolerance.rule}" leaves nothing, as its datums lock tilts alone')
    return _along_coordinates(translations, geometry)


def _controlled(rows: np.ndarray, geometry: FeatureGeometry, frame: DatumFrame) -> np.ndarray:
    """Return the directions (coordinate, n) that the zone limits and that no free motion of the datum frame changes."""
    limited = _span(rows.reshape(-1, rows.shape[-1]).T)
    return _difference(limited, _span(limited @ limited.T @ geometry.values @ frame.free))


def _span(vectors: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (row, n) of columns (row, m)."""
    if not vectors.size:
        return np.zeros((len(vectors), 0))
    U, S, _ = np.linalg.svd(vectors, full_matrices=False)
    return U[:, RANK_TOLERANCE * max(1.0, S.max(initial=0.0)) < S]


def _difference(basis: np.ndarray, subtracted: np.ndarray) -> np.ndarray:
    """Return a basis of the part of a span that is orthogonal to another span; both are given by orthonormal columns."""
    return _span(basis - subtracted @ (subtracted.T @ basis))


def _along_coordinates(directions: np.ndarray, geometry: FeatureGeometry) -> np.ndarray:
    """Return unit vectors along coordinates if they have the same span as `directions`; else `directions`."""
    projector = directions @ directions.T
    spanned = np.flatnonzero(np.diag(projector) > 1 - 1e-6)
    return np.eye(len(geometry.names))[:, spanned] if len(spanned) == directions.shape[1] else directions


def freedom_names(geometry: FeatureGeometry, added: np.ndarray) -> list[str]:
    """Return the names of added directions (coordinate, k): of the coordinates that they are along, or "mixed 1", ..."""
    coordinates = np.abs(added).argmax(axis=0)
    is_along = np.abs(added).max(axis=0, initial=0) > 1 - 1e-6
    return [
        geometry.names[coordinate] if along else f"mixed {number + 1}"
        for number, (coordinate, along) in enumerate(zip(coordinates, is_along, strict=True))
    ]
