"""Layers: the directions of a feature that each of its tolerances controls, from the innermost tolerance on; play of datums."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from tolcontact.declaration import Feature, GeometricTolerance
from tolcontact.declaration.feature_tolerance import INSIDE, TRANSLATION, Material, Position
from tolcontact.errors import GeometryFault
from tolcontact.features.datum_frames import RANK_TOLERANCE, DatumFrame, datum_frame
from tolcontact.features.feature_geometry import FeatureOfSize
from tolcontact.features.freedoms import FEATURE, Freedom
from tolcontact.features.nominal_feature import NominalFeature
from tolcontact.features.nominal_pattern import MIN_LENGTH, Layer, NominalPattern
from tolcontact.features.tolerance_kinds import zone_rows
from tolcontact.geometry.tolerances import MIN_PART


def tolerance_layers(
    pattern: NominalPattern, systems: Sequence[Sequence[Sequence[NominalFeature]]], first_column: int
) -> tuple[Layer, ...]:
    """Return a layer for each geometric tolerance of a feature or pattern, from the one that controls fewest directions on.

    `systems` are the datums of each tolerance, compartment by compartment. Raises GeometryFault for tolerances that the feature
    cannot have, or that do not nest.
    """
    zones = [
        (tolerance, *_zone(tolerance, pattern, system, first_column))
        for tolerance, system in zip(pattern.declared.geometric, systems, strict=True)
    ]
    zones.sort(key=lambda zone: (zone[3].shape[1], zone[0].width))
    layers: list[Layer] = []
    controlled_before, column = np.zeros((pattern.count, 0)), first_column
    for tolerance, rows, frame, controlled in zones:
        _check_nesting(tolerance, controlled, layers)
        is_outer = controlled_before.shape[1] > 0
        added = _named_basis(_difference(controlled, controlled_before), pattern, is_outer=is_outer)
        if tolerance.rule == TRANSLATION:
            added = _translations(tolerance, pattern, added, is_outer=is_outer)
        if controlled.shape[1] and not added.shape[1]:
            raise GeometryFault(
                f"{tolerance.kind} {tolerance.width:g} controls nothing that others do not; leave one of them out"
            )
        controlled_before = np.hstack([controlled_before, added])
        layers.append(Layer(tolerance, rows, controlled, added, range(column, column + added.shape[1]), frame))
        column += added.shape[1]
    return tuple(layers)


def _zone(
    tolerance: GeometricTolerance, pattern: NominalPattern, system: Sequence[Sequence[NominalFeature]], columns: int
) -> tuple[tuple[np.ndarray, ...], DatumFrame, np.ndarray]:
    """Return the rows of a zone for each member, its datum frame, and the directions (coordinate, n) that it controls."""
    primary = system[0][0].geometry if system else None
    rows = tuple(zone_rows(tolerance, member, primary) for member in pattern.geometries)
    at_gauge = [[datum.at_gauge(columns) for datum in compartment] for compartment in system]
    frame = datum_frame(at_gauge, pattern.centre, pattern.reach, columns, tolerance.orientation_only)
    is_combined = pattern.declared.combines(tolerance)
    is_limited = system or is_combined  # a combined zone limits the members to each other
    controlled = _controlled(rows, pattern, frame, is_combined=is_combined) if is_limited else np.zeros((pattern.count, 0))
    if any(map(len, rows)) and is_limited and not controlled.shape[1]:
        reason = f"the datum system {tolerance.datums} does not lock any" if system else "a combined zone limits nothing"
        raise GeometryFault(f"{tolerance.kind}: {reason} of what is toleranced; add the datum that does")
    return rows, frame, controlled


def mobile(pattern: NominalPattern, free: np.ndarray, material: Material, start: int, label: str) -> NominalPattern:
    """Return a datum feature with the freedoms of its gauge element, from column `start` on; without any if it has no play.

    The frame of the gauge may be displaced from the datum feature, in the directions that this datum locks, by what the feature
    departs from its boundary: a zone of the width of its own tolerances to the datums before, plus the departure of its size.
    This holds where no mate is modelled; contact decides where one is.

    free      (6, n): displacements about its centre that the datums before it leave free
    material  "M" or "L"
    label     of the freedoms, which their directions follow
    """
    declared, member = pattern.declared, pattern.members[0]
    added, layers = np.zeros((pattern.count, 0)), tuple[Layer, ...]()
    if isinstance(declared, Feature) and isinstance(member.geometry, FeatureOfSize) and member.size_column is not None:
        own = min(
            (tolerance.width for tolerance in declared.geometric if not tolerance.is_form and tolerance.datums), default=0.0
        )
        zone = GeometricTolerance(Position, own, material=material, rule=INSIDE)
        rows, added = (
            zone_rows(zone, member.geometry, None),
            _named_basis(_span(pattern.values @ free), pattern, is_outer=False),
        )
        frame = DatumFrame(np.zeros((6, start)), free, ())
        layers = (Layer(zone, (rows,), added, added, range(start, start + added.shape[1]), frame),)
    motion = np.zeros((pattern.count, start + added.shape[1]))
    motion[:, start:] = added
    freedoms = tuple(
        Freedom(f"{label}: {pattern.freedom_name(direction)}", FEATURE, geometric=layer.tolerance)
        for layer in layers for direction in added.T
    )  # fmt: skip
    return replace(pattern, members=(replace(member, mobility=motion),), layers=layers, freedoms=freedoms, shifts=(), form=None)


def uncontrolled(pattern: NominalPattern, followed: np.ndarray) -> list[str]:
    """Return the names of the freedoms of a pattern that no tolerance limits.

    Those in the span of `followed` (coordinate, n) are left out: the frame of a datum follows them.
    """
    limited = _span(np.hstack([followed, *(layer.controlled for layer in pattern.layers)]))
    rest = _difference(np.eye(pattern.count), limited)
    return [pattern.freedom_name(direction) for direction in _named_basis(rest, pattern, is_outer=True).T]


def _check_nesting(tolerance: GeometricTolerance, controlled: np.ndarray, layers: Sequence[Layer]) -> None:
    """Raise GeometryFault if a tolerance is narrower than one of the tolerances within it."""
    for layer in layers:
        inner = layer.tolerance
        contains = layer.controlled.shape[1] and _difference(layer.controlled, controlled).shape[1] == 0
        if contains and tolerance.width < inner.width and not (tolerance.material or inner.material):
            raise GeometryFault(
                f"{tolerance.kind} {tolerance.width:g} is narrower than {inner.kind} {inner.width:g}, "
                "which it contains; expected orientation within location"
            )


def _translations(tolerance: GeometricTolerance, pattern: NominalPattern, added: np.ndarray, *, is_outer: bool) -> np.ndarray:
    """Return the part of the added directions (coordinate, n) that does not rotate a feature."""
    _, S, Vt = np.linalg.svd(pattern.turns @ added)
    translations = added @ Vt[int((S > RANK_TOLERANCE).sum()) :].T
    if not translations.shape[1]:
        raise GeometryFault(f'{tolerance.kind}: the rule "{tolerance.rule}" leaves nothing, as its datums lock tilts alone')
    return _named_basis(translations, pattern, is_outer=is_outer)


def _controlled(rows: Sequence[np.ndarray], pattern: NominalPattern, frame: DatumFrame, *, is_combined: bool) -> np.ndarray:
    """Return the directions (coordinate, n) that the zone limits and that no free motion of the datum frame changes.

    Combined zones of members move as one, other ones each alone.
    """
    limited = _span(np.asarray(scipy.linalg.block_diag(*(member.reshape(-1, member.shape[-1]).T for member in rows))))
    motions = pattern.values @ frame.free
    if not is_combined:
        motions = scipy.linalg.block_diag(*(motions[place] for place in pattern.slices))
    controlled = _difference(limited, _span(limited @ limited.T @ motions))
    return _named_basis(controlled, pattern, is_outer=False)


def _span(vectors: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (row, n) of columns (row, m)."""
    if not vectors.size:
        return np.zeros((len(vectors), 0))
    U, S, _ = np.linalg.svd(vectors, full_matrices=False)
    return U[:, RANK_TOLERANCE * max(1.0, S.max(initial=0.0)) < S]


def _difference(basis: np.ndarray, subtracted: np.ndarray) -> np.ndarray:
    """Return a basis of the part of a span that is orthogonal to another span; both are given by orthonormal columns."""
    return _span(basis - subtracted @ (subtracted.T @ basis))


def _named_basis(directions: np.ndarray, pattern: NominalPattern, *, is_outer: bool) -> np.ndarray:
    """Return unit vectors with the same span as `directions` (coordinate, n), along coordinates where the span has any.

    Directions of the outer tolerance of a pattern are along its common motions first. The remaining vectors are projections of
    the coordinates, in their order, made orthogonal (Gram-Schmidt), so that the basis depends on the span alone.
    """
    projector, count = directions @ directions.T, directions.shape[1]
    coordinates = np.eye(pattern.count)
    spanned = np.flatnonzero(np.diag(projector) > 1 - 1e-6)
    if len(spanned) == count:
        return coordinates[:, spanned]
    motions = pattern.common_motions if is_outer and len(pattern.members) > 1 else np.zeros((pattern.count, 0))
    lengths = np.linalg.norm(motions, axis=0)
    motions = motions[:, lengths > MIN_LENGTH] / lengths[lengths > MIN_LENGTH]
    within = np.linalg.norm(projector @ motions - motions, axis=0) < RANK_TOLERANCE
    candidates = np.hstack([motions[:, within], coordinates[:, spanned], projector])
    basis, rank = np.zeros((pattern.count, count)), 0
    for candidate in candidates.T:
        remainder = candidate
        for _ in range(2):  # twice is enough to be orthogonal to rounding
            remainder = remainder - basis[:, :rank] @ (basis[:, :rank].T @ remainder)
        if (length := np.linalg.norm(remainder)) > RANK_TOLERANCE:
            basis[:, rank] = np.where(np.abs(remainder) < MIN_PART * length, 0.0, remainder / length)
            rank += 1
        if rank == count:
            break
    return basis[:, :rank]
