"""Layers: the freedoms of a feature that each of its tolerances controls, and the frames of datum systems (ISO 5459)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy

from tolcontact.declaration import OUTSIDE, DatumTargets, Feature, GeometricTolerance, Part, Pattern
from tolcontact.declaration.feature_tolerance import TRANSLATION
from tolcontact.declaration.toleranced import Toleranced
from tolcontact.errors import GeometryFault
from tolcontact.features.datum_planes import Lean, TangentPlane, free_directions
from tolcontact.features.feature_geometry import FeatureGeometry, PlaneFeature
from tolcontact.features.form_field import FormField
from tolcontact.features.pattern_geometry import MIN_LENGTH, PatternGeometry
from tolcontact.features.tolerance_kinds import zone_rows

Declared = Feature | Pattern | DatumTargets
MIN_NOTICED = 1e-4  # smallest singular value, relative to the largest, of a displacement that a datum notices
MIN_LEAN = 1e-9  # mm of extremes of a plane, for deviations of 1
MIN_PART = 1e-12  # of a unit vector: smaller entries are rounding
RANK_TOLERANCE = 1e-4  # smallest singular value of an independent direction: shapes of single precision are no better


class Datum(NamedTuple):
    """A datum feature, its coordinates (coordinate, column) for deviations of 1, and its form with the columns of that."""

    feature: Feature
    geometry: FeatureGeometry
    coordinates: np.ndarray
    form: FormField | None = None
    form_columns: range = range(0)


class DatumFrame(NamedTuple):
    """The frame of a datum system, for displacements (tau, rho) about one centre.

    motion   (6, column) of the frame for deviations of 1; the last columns are for shifts of 1 mm by its leans
    free     (6, freedom): displacements that none of the datums notices
    leans    of its planes, in the order of their columns; each has one for each of its coordinates
    """

    motion: np.ndarray
    free: np.ndarray
    leans: tuple[Lean, ...]

    def felt(self, effect: np.ndarray) -> "DatumFrame":
        """Return this frame without the leans that change nothing of `effect` (coordinate, 6) of its motion."""
        starts = self.motion.shape[1] - np.cumsum([len(lean.coordinates) for lean in reversed(self.leans)])[::-1]
        columns = int(min(starts, default=self.motion.shape[1]))
        felt = np.abs(effect @ self.motion).max(axis=0, initial=0.0) > MIN_LEAN
        felt[:columns] = True
        for lean, start in reversed([*zip(self.leans, starts, strict=True)]):
            if felt[start : start + len(lean.coordinates)].any():
                felt[lean.sources] = True
        leans = list[Lean]()
        for lean, start in zip(self.leans, starts, strict=True):
            if len(own := np.flatnonzero(felt[start : start + len(lean.coordinates)])):
                leans.append(lean.taken(np.flatnonzero(felt[:start]), own))
        return DatumFrame(self.motion[:, felt], self.free, tuple(leans))


@dataclass(frozen=True, eq=False)
class Layer:
    """The freedoms of a feature or pattern that one tolerance controls beyond the tolerances within it.

    rows        for each member (point, component, coordinate of the member) of its zone (see tolerance_kinds)
    controlled  (coordinate, n): orthonormal directions that its datums lock
    added       (coordinate, k): directions that no narrower tolerance controls and that its rule draws; each is a contributor
    frame       of its datum system
    """

    tolerance: GeometricTolerance
    rows: tuple[np.ndarray, ...]
    controlled: np.ndarray
    added: np.ndarray
    frame: DatumFrame

    def followed(self, geometry: PatternGeometry) -> np.ndarray:
        """Return how the feature follows the frame (coordinate, column), in what this layer adds."""
        return np.asarray(self.added @ self.added.T @ geometry.values @ self.frame.motion)


def datum_frame(
    system: Sequence[Sequence[Datum]], centre: np.ndarray, reach: float, columns: int, orientation_only: Sequence[bool]
) -> DatumFrame:
    """Return the frame of datums in their precedence: each takes what it notices of the freedoms left by those before it.

    Compartments that are `orientation_only` notice no translations (ISO 5459, "><"). The datums of one compartment count
    together, by least squares of their coordinates. A plane by itself is then moved to where it touches its feature outside of
    the material (ISO 5459), unless its association is by least squares. Angles are weighed by `reach` [mm].
    """
    to_twist = np.diag([1.0] * 3 + [1 / reach] * 3)
    motion, free, leans = np.zeros((6, columns)), np.eye(6), list[Lean]()
    for compartment, is_turned in zip(system, orientation_only, strict=True):
        values = np.vstack([datum.geometry.about(centre) for datum in compartment]) @ to_twist
        coordinates = np.vstack([padded(datum.coordinates, motion.shape[1]) for datum in compartment])
        features = values, coordinates
        selection = np.eye(len(values))
        if is_turned:
            selection = scipy.linalg.null_space(values[:, :3].T, rcond=RANK_TOLERANCE)
            values, coordinates = selection.T @ values, selection.T @ coordinates
        U, S, Vt = np.linalg.svd(values @ free)
        largest = S.max(initial=0.0)
        rank = int((S > MIN_NOTICED * max(largest, 1e-300)).sum()) if largest > MIN_NOTICED else 0
        if rank:
            inverse = Vt[:rank].T @ (U[:, :rank] / S[:rank]).T
            motion = motion + free @ inverse @ (coordinates - values @ motion)
            lean = _lean(compartment, features[1] - features[0] @ motion, features[0] @ free, is_turned=is_turned)
            if lean is not None:
                leans.append(lean)
                plane = compartment[0].geometry
                assert isinstance(plane, PlaneFeature)
                motion = np.hstack([motion, lean.motions(free @ inverse @ selection.T, plane)])
        free = free @ Vt[rank:].T
    return DatumFrame(to_twist @ motion, to_twist @ free, tuple(leans))


def _lean(compartment: Sequence[Datum], residuals: np.ndarray, turns: np.ndarray, *, is_turned: bool) -> Lean | None:
    """Return where the plane of a compartment lies beside that by least squares; None if it does not lie elsewhere.

    residuals   (coordinate, column): what the datum leaves of the coordinates of its feature
    turns       (coordinate, n): how the motions that the datums before leave free change these
    """
    (datum, *others) = compartment
    geometry = datum.geometry
    if others or not isinstance(geometry, PlaneFeature) or datum.feature.association != OUTSIDE:
        return None
    if datum.form is not None:
        heights = geometry.rows((datum.form.places, datum.form.normals[:, None]))[:, 0]
        leaning, free = np.where(np.abs(residuals) < MIN_PART, 0.0, residuals), free_directions(turns[1:])
        return TangentPlane(
            datum.feature.datum, geometry.rows(geometry.extremes)[:, 0] @ leaning, (0, 1, 2),
            datum.form, datum.form_columns, heights, leaning, free, geometry.names,
        )  # fmt: skip
    extremes = geometry.rows(geometry.extremes)[:, 0] @ residuals
    if is_turned or np.abs(extremes).max(initial=0.0) <= MIN_LEAN:
        return None
    return Lean(datum.feature.datum, extremes, (0,))


def padded(coordinates: np.ndarray, columns: int) -> np.ndarray:
    """Return coordinates (coordinate, column) with zeros for the columns after theirs."""
    result = np.zeros((len(coordinates), columns))
    result[:, : coordinates.shape[1]] = coordinates
    return result


def tolerance_layers(
    declared: Toleranced, geometry: PatternGeometry, datums: Mapping[str | None, Sequence[Datum]], columns: int
) -> tuple[Layer, ...]:
    """Return a layer for each geometric tolerance of a feature or pattern, from the one that controls fewest freedoms on.

    `datums` are by their letters. Raises GeometryFault for tolerances that the feature cannot have, or that do not nest.
    """
    candidates = [_layer(tolerance, geometry, datums, columns) for tolerance in declared.geometric]
    candidates.sort(key=lambda layer: (layer.controlled.shape[1], layer.tolerance.width))
    layers: list[Layer] = []
    controlled_before = np.zeros((geometry.count, 0))
    for candidate in candidates:
        tolerance, controlled = candidate.tolerance, candidate.controlled
        _check_nesting(candidate, layers)
        is_outer = controlled_before.shape[1] > 0
        added = _named_basis(_difference(controlled, controlled_before), geometry, is_outer=is_outer)
        if tolerance.rule == TRANSLATION:
            added = _translations(tolerance, geometry, added, is_outer=is_outer)
        if controlled.shape[1] and not added.shape[1]:
            raise GeometryFault(
                f"{tolerance.kind} {tolerance.width:g} controls nothing that others do not; leave one of them out"
            )
        controlled_before = np.hstack([controlled_before, added])
        frame = candidate.frame.felt(added @ added.T @ geometry.values)
        layers.append(replace(candidate, added=added, frame=frame))
    return tuple(layers)


def _layer(
    tolerance: GeometricTolerance, geometry: PatternGeometry, datums: Mapping[str | None, Sequence[Datum]], columns: int
) -> Layer:
    """Return the layer of a tolerance by itself, to which nothing is added yet."""
    absent = [letter for compartment in tolerance.system for letter in compartment if letter not in datums]
    if absent:
        raise GeometryFault(f"{tolerance.kind} refers to datum {absent[0]}, which could not be made; mend its feature first")
    system = [[datum for letter in compartment for datum in datums[letter]] for compartment in tolerance.system]
    primary = system[0][0].geometry if system else None
    rows = tuple(zone_rows(tolerance, member, primary) for member in geometry.members)
    frame = datum_frame(system, geometry.centre, geometry.reach, columns, tolerance.orientation_only)
    nothing = np.zeros((geometry.count, 0))
    is_limited = system or len(geometry.members) > 1  # a common zone limits the members to each other
    controlled = _controlled(rows, geometry, frame) if is_limited else nothing
    if any(map(len, rows)) and is_limited and not controlled.shape[1]:
        reason = f"the datum system {tolerance.datums} does not lock any" if system else "a common zone limits nothing"
        raise GeometryFault(f"{tolerance.kind}: {reason} of what is toleranced; add the datum that does")
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


def _translations(tolerance: GeometricTolerance, geometry: PatternGeometry, added: np.ndarray, *, is_outer: bool) -> np.ndarray:
    """Return the part of the added directions (coordinate, n) that does not turn a feature."""
    turns = geometry.turns @ added
    _, S, Vt = np.linalg.svd(turns)
    translations = added @ Vt[int((S > RANK_TOLERANCE).sum()) :].T
    if not translations.shape[1]:
        raise GeometryFault(f'{tolerance.kind}: the rule "{tolerance.rule}" leaves nothing, as its datums lock tilts alone')
    return _named_basis(translations, geometry, is_outer=is_outer)


def _controlled(rows: Sequence[np.ndarray], geometry: PatternGeometry, frame: DatumFrame) -> np.ndarray:
    """Return the directions (coordinate, n) that the zone limits and that no free motion of the datum frame changes."""
    limited = _span(np.asarray(scipy.linalg.block_diag(*(member.reshape(-1, member.shape[-1]).T for member in rows))))
    controlled = _difference(limited, _span(limited @ limited.T @ geometry.values @ frame.free))
    return _named_basis(controlled, geometry, is_outer=False)


def _span(vectors: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (row, n) of columns (row, m)."""
    if not vectors.size:
        return np.zeros((len(vectors), 0))
    U, S, _ = np.linalg.svd(vectors, full_matrices=False)
    return U[:, RANK_TOLERANCE * max(1.0, S.max(initial=0.0)) < S]


def _difference(basis: np.ndarray, subtracted: np.ndarray) -> np.ndarray:
    """Return a basis of the part of a span that is orthogonal to another span; both are given by orthonormal columns."""
    return _span(basis - subtracted @ (subtracted.T @ basis))


def _named_basis(directions: np.ndarray, geometry: PatternGeometry, *, is_outer: bool) -> np.ndarray:
    """Return unit vectors with the same span as `directions` (coordinate, n), along coordinates as far as there are any.

    Directions of the outer tolerance of a pattern are along its common motions first. What is along neither follows from
    the projections of the coordinates, in their order, so that the vectors depend on the span alone.
    """
    projector, count = directions @ directions.T, directions.shape[1]
    coordinates = np.eye(geometry.count)
    spanned = np.flatnonzero(np.diag(projector) > 1 - 1e-6)
    if len(spanned) == count:
        return coordinates[:, spanned]
    motions = geometry.common_motions if is_outer and len(geometry.members) > 1 else np.zeros((geometry.count, 0))
    lengths = np.linalg.norm(motions, axis=0)
    motions = motions[:, lengths > MIN_LENGTH] / lengths[lengths > MIN_LENGTH]
    within = np.linalg.norm(projector @ motions - motions, axis=0) < RANK_TOLERANCE
    candidates = np.hstack([motions[:, within], coordinates[:, spanned], projector])
    basis, rank = np.zeros((geometry.count, count)), 0
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


def datum_order(part: Part) -> tuple[list[Declared], list[Declared]]:
    """Return what is declared of a part, each after its datums, and those whose datums refer to each other in a circle."""
    remaining: list[Declared] = [*part.toleranced, *part.targets]
    letters, present, ordered = set[str](), set[Feature](), list[Declared]()
    while remaining:
        ready = [declared for declared in remaining if _letters(declared) <= letters and _features(declared) <= present]
        if not ready:
            return ordered, remaining
        for declared in ready:
            ordered.append(declared)
            present |= set() if isinstance(declared, DatumTargets) else set(declared.members)
            letters |= {letter for letter in [_letter(declared)] if letter}
        remaining = [declared for declared in remaining if declared not in ready]
    return ordered, []


def _letter(declared: Declared) -> str | None:
    return declared.letter if isinstance(declared, DatumTargets) else declared.datum


def _letters(declared: Declared) -> set[str]:
    """Return the datums that tolerances refer to."""
    tolerances = () if isinstance(declared, DatumTargets) else declared.geometric
    return {letter for tolerance in tolerances for compartment in tolerance.system for letter in compartment}


def _features(declared: Declared) -> set[Feature]:
    """Return the features that members or targets are."""
    if isinstance(declared, DatumTargets):
        return set(declared.features)
    return set(declared.borrowed) if isinstance(declared, Pattern) else set()
