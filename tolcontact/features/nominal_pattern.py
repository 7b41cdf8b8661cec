"""The features that a declaration tolerances together: their coordinates, and what varies of them. Part's own frame.

A tolerance adds a layer: the directions that it controls beyond the tolerances within it. Datums at their material boundary
have play.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag

from tolcontact.declaration import Feature, GeometricTolerance, Pattern
from tolcontact.declaration.feature_tolerance import INSIDE, TRANSLATION, Material, Position
from tolcontact.errors import GeometryFault
from tolcontact.features.datum_frames import RANK_TOLERANCE, DatumFrame, Datums, DatumShift, datum_frame
from tolcontact.features.feature_geometry import FeatureGeometry, FeatureOfSize, PlaneFeature
from tolcontact.features.freedoms import FEATURE, Freedom
from tolcontact.features.nominal_feature import NominalFeature
from tolcontact.features.tolerance_kinds import zone_rows
from tolcontact.geometry.tolerances import MIN_PART, SAME_SIZE

MIN_LENGTH = 1e-4  # of the coordinates of a motion of 1 mm that affects a pattern
MIXED, RELATIVE = "mixed", "relative"
MOTIONS = ("common shift x", "common shift y", "common shift z", "common turn x", "common turn y", "common turn z")


@dataclass(frozen=True, eq=False)
class Layer:
    """The directions of a pattern that one tolerance controls beyond the tolerances within it.

    rows        for each member (point, component, coordinate of the member) of its zone (see tolerance_kinds)
    controlled  (coordinate, n): orthonormal directions that its datums lock
    added       (coordinate, k): directions that no narrower tolerance controls and that its rule draws; each is a freedom
    columns     of these freedoms in the deviations
    frame       of its datum system
    """

    tolerance: GeometricTolerance
    rows: tuple[np.ndarray, ...]
    controlled: np.ndarray
    added: np.ndarray
    columns: range
    frame: DatumFrame


@dataclass(frozen=True, eq=False)
class NominalPattern:
    """The members of a pattern, or one feature alone. Its coordinates are the coordinates of one member after the other.

    layers    of its geometric tolerances, from the innermost on
    freedoms  the directions that its layers add, shifts of datum planes, sizes of its members, and modes of their forms
    shifts    of the datum planes of its tolerances
    form      the tolerance that draws the form of its members; None if they keep their shape
    """

    declared: Feature | Pattern
    members: tuple[NominalFeature, ...]
    layers: tuple[Layer, ...] = ()
    freedoms: tuple[Freedom, ...] = ()
    shifts: tuple[DatumShift, ...] = ()
    form: GeometricTolerance | None = None

    @property
    def part(self) -> int:
        return self.members[0].part

    @property
    def is_gauge(self) -> bool:
        """Whether it is the gauge element of a datum (see mobile)."""
        return self.members[0].mobility is not None

    @property
    def geometries(self) -> tuple[FeatureGeometry, ...]:
        """The geometry of each member."""
        return tuple(member.geometry for member in self.members)

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """The coordinates of each member."""
        ends = np.cumsum([0, *(len(geometry.names) for geometry in self.geometries)])
        return tuple(slice(int(start), int(end)) for start, end in pairwise(ends))

    @property
    def count(self) -> int:
        """The number of coordinates."""
        return self.slices[-1].stop

    @cached_property
    def centre(self) -> np.ndarray:
        """The mean (3,) [mm] of the centres of the members."""
        centres = [geometry.centre for geometry in self.geometries]
        return centres[0] if len(centres) == 1 else np.mean(centres, axis=0)

    @cached_property
    def reach(self) -> float:
        """The largest distance [mm] of an extreme of a member from the centre."""
        if len(self.members) == 1:
            return self.geometries[0].reach
        return max(float(np.linalg.norm(geometry.extremes[0] - self.centre, axis=1).max()) for geometry in self.geometries)

    @cached_property
    def values(self) -> np.ndarray:
        """The coordinates (coordinate, 6) of a displacement (tau, rho) of all members about the centre."""
        if len(self.members) == 1:
            return self.geometries[0].values
        return np.vstack([geometry.about(self.centre) for geometry in self.geometries])

    @property
    def offsets(self) -> np.ndarray:
        """The coordinates (coordinate,) if all members that are planes are 1 mm out of the material; 0 for other features."""
        offsets = np.zeros(self.count)
        for geometry, place in zip(self.geometries, self.slices, strict=True):
            offsets[place.start] = isinstance(geometry, PlaneFeature)
        return offsets

    @property
    def common_motions(self) -> np.ndarray:
        """Columns (coordinate, 6): the coordinates as the pattern moves as a whole, in the order of MOTIONS."""
        return self.values @ np.diag([1.0] * 3 + [1 / self.reach] * 3)

    def owner(self, direction: np.ndarray) -> int | None:
        """Return the index of the one member that a direction (coordinate,) moves; None if it moves several."""
        moved = [number for number, place in enumerate(self.slices) if direction[place].any()]
        return moved[0] if len(moved) == 1 else None

    def freedom_name(self, direction: np.ndarray) -> str:
        """Return the name of a direction (coordinate,): of its coordinate, of its motion of the pattern, "relative" or "mixed".

        A relative direction moves members relative to each other, and not the pattern as a whole.
        """
        coordinate = int(np.abs(direction).argmax())
        if abs(direction[coordinate]) > 1 - 1e-6:
            return [name for geometry in self.geometries for name in geometry.names][coordinate]
        if self.owner(direction) is not None:
            return MIXED
        lengths = np.linalg.norm(self.common_motions, axis=0)
        along = np.abs(direction @ self.common_motions) / np.where(lengths > MIN_LENGTH, lengths, np.inf)
        return MOTIONS[int(along.argmax())] if along.max() > 1 - 1e-6 else RELATIVE if along.max() < 1e-6 else MIXED


def unlike_members(members: Sequence[FeatureGeometry]) -> str:
    """Return the fault of members of a pattern that are not of one kind and size; empty if they are."""
    first = members[0]
    for number, member in enumerate(members[1:], start=2):
        is_alike = type(member) is type(first)
        if is_alike and isinstance(member, FeatureOfSize) and isinstance(first, FeatureOfSize):
            is_alike = member.is_inner == first.is_inner and abs(member.size - first.size) <= SAME_SIZE * first.size
        if not is_alike:
            return (
                f"its member 1 is {_described(first)}, and member {number} is {_described(member)}; the members of a pattern "
                "with tolerances are of one kind and size, so declare unlike ones as patterns or features of their own"
            )
    return ""


def _described(geometry: FeatureGeometry) -> str:
    if not isinstance(geometry, FeatureOfSize):
        return geometry.in_words
    return f"{geometry.in_words} of {geometry.size:.9g} mm, {'inner' if geometry.is_inner else 'outer'}"


def tolerance_layers(pattern: NominalPattern, systems: Sequence[Sequence[Datums]], first_column: int) -> tuple[Layer, ...]:
    """Return a layer for each geometric tolerance of a feature or pattern, from the one that controls fewest directions on.

    `systems` are the datums of each tolerance, compartment by compartment. Raises GeometryFault for tolerances that the feature
    cannot have, or that do not nest.
    """
    zones = [
        _controlling(tolerance, pattern, system, first_column)
        for tolerance, system in zip(pattern.declared.geometric, systems, strict=True)
    ]
    layers = list[Layer]()
    controlled_before = np.zeros((pattern.count, 0))
    for zone in sorted(zones, key=lambda zone: (zone.controlled.shape[1], zone.tolerance.width)):
        tolerance, controlled = zone.tolerance, zone.controlled
        for inner in layers:
            contains = inner.controlled.shape[1] and _difference(inner.controlled, controlled).shape[1] == 0
            has_bonus = tolerance.material or inner.tolerance.material
            if contains and tolerance.width < inner.tolerance.width and not has_bonus:
                raise GeometryFault(
                    f"{tolerance.kind} {tolerance.width:g} is narrower than {inner.tolerance.kind} {inner.tolerance.width:g}, "
                    "which it contains; expected orientation within location"
                )
        is_outer, column = controlled_before.shape[1] > 0, first_column + controlled_before.shape[1]
        added = _named_basis(_difference(controlled, controlled_before), pattern, is_outer=is_outer)
        if tolerance.rule == TRANSLATION:
            turns = block_diag(*(geometry.twists[3:] * geometry.reach for geometry in pattern.geometries))
            _, S, Vt = np.linalg.svd(turns @ added)
            translations = added @ Vt[int((S > RANK_TOLERANCE).sum()) :].T  # that rotate no feature
            if not translations.shape[1]:
                raise GeometryFault(
                    f'{tolerance.kind}: the rule "{tolerance.rule}" leaves nothing, as its datums lock tilts alone'
                )
            added = _named_basis(translations, pattern, is_outer=is_outer)
        if controlled.shape[1] and not added.shape[1]:
            raise GeometryFault(
                f"{tolerance.kind} {tolerance.width:g} controls nothing that others do not; leave one of them out"
            )
        controlled_before = np.hstack([controlled_before, added])
        layers.append(replace(zone, added=added, columns=range(column, column + added.shape[1])))
    return tuple(layers)


def _controlling(tolerance: GeometricTolerance, pattern: NominalPattern, system: Sequence[Datums], columns: int) -> Layer:
    """Return a layer with all directions that the zone limits and that no free motion of its datum frame changes."""
    primary = system[0][0].geometry if system else None
    rows = tuple(zone_rows(tolerance, member, primary) for member in pattern.geometries)
    at_gauge = [[datum.at_gauge(columns) for datum in compartment] for compartment in system]
    frame = datum_frame(at_gauge, pattern.centre, pattern.reach, columns, tolerance.orientation_only)
    controlled, is_combined = np.zeros((pattern.count, 0)), pattern.declared.combines(tolerance)
    if system or is_combined:
        limited = _span(np.asarray(block_diag(*(member.reshape(-1, member.shape[-1]).T for member in rows))))
        motions = pattern.values @ frame.free
        if not is_combined:  # a combined zone limits the members to each other, other ones each alone
            motions = block_diag(*(motions[place] for place in pattern.slices))
        controlled = _difference(limited, _span(limited @ limited.T @ motions))
        controlled = _named_basis(controlled, pattern, is_outer=False)
        if any(map(len, rows)) and not controlled.shape[1]:
            reason = f"the datum system {tolerance.datums} does not lock any" if system else "a combined zone limits nothing"
            raise GeometryFault(f"{tolerance.kind}: {reason} of what is toleranced; add the datum that does")
    return Layer(tolerance, rows, controlled, controlled, range(0), frame)


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
    added, layers, freedoms = np.zeros((pattern.count, 0)), tuple[Layer, ...](), tuple[Freedom, ...]()
    if isinstance(declared, Feature) and isinstance(member.geometry, FeatureOfSize) and member.size_column is not None:
        widths = (tolerance.width for tolerance in declared.geometric if not tolerance.is_form and tolerance.datums)
        zone = GeometricTolerance(Position, min(widths, default=0.0), material=material, rule=INSIDE)
        rows = zone_rows(zone, member.geometry, None)
        added = _named_basis(_span(pattern.values @ free), pattern, is_outer=False)
        frame = DatumFrame(np.zeros((6, start)), free, ())
        layers = (Layer(zone, (rows,), added, added, range(start, start + added.shape[1]), frame),)
        names = (pattern.freedom_name(direction) for direction in added.T)
        freedoms = tuple(Freedom(f"{label}: {name}", FEATURE, geometric=zone) for name in names)
    motion = np.hstack([np.zeros((pattern.count, start)), added])
    return replace(pattern, members=(replace(member, mobility=motion),), layers=layers, freedoms=freedoms, shifts=(), form=None)


def uncontrolled(pattern: NominalPattern, followed: np.ndarray) -> list[str]:
    """Return the names of the freedoms of a pattern that no tolerance limits.

    Those in the span of `followed` (coordinate, n) are left out: the frame of a datum follows them.
    """
    limited = _span(np.hstack([followed, *(layer.controlled for layer in pattern.layers)]))
    rest = _difference(np.eye(pattern.count), limited)
    return [pattern.freedom_name(direction) for direction in _named_basis(rest, pattern, is_outer=True).T]


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
