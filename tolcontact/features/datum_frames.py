"""Datum reference frames (ISO 5459): how the frame of a datum system moves as its datum features deviate.

A plane touches its datum feature outside the material. Its shift from the least-squares plane follows from deviations, but not
linearly: the coordinates of the shift are freedoms that are not drawn.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy
from scipy.linalg import block_diag

from tolcontact.declaration import OUTSIDE, DatumTargets, Feature, Part, Pattern
from tolcontact.features.feature_geometry import PlaneFeature
from tolcontact.features.form_field import FormField
from tolcontact.features.minimum_zone import minimax
from tolcontact.features.nominal_feature import NominalFeature, padded
from tolcontact.features.zone_kernel import sum_modes
from tolcontact.geometry.tolerances import MIN_PART

FIELDS_AT_ONCE = 512
MIN_DIRECTION = 1e-9  # of the largest tilt that a datum system leaves to a plane: smaller ones are rounding
MIN_EFFECT = 1e-4  # smallest singular value, relative to the largest, of a displacement that affects a datum
MIN_SHIFT = 1e-9  # mm of a datum or a feature, per unit deviation
RANK_TOLERANCE = 1e-4  # smallest singular value of an independent direction: shapes of single precision are no better
Datums = Sequence[NominalFeature]  # of one compartment of a datum system
Declared = Feature | Pattern | DatumTargets
Shifts = dict[tuple[object, bytes], np.ndarray]  # coordinates (row, 3) of planes that are already computed


@dataclass(frozen=True, eq=False)
class DatumShift:
    """The offset of a datum plane from its least-squares plane to contact outside the material.

    A plane that keeps its shape shifts by the largest height of its extremes. A plane with form is replaced by the minimax
    plane: of all planes outside the material the one whose largest distance from the face is smallest (ISO 5459). It is the
    centre plane of the minimum zone of the face, moved out of the material by half the width, and it tilts within the limits of
    the datums before it. If the form of a face is 0, the plane touches it as a face that keeps its shape.

    datum        its feature
    extremes     (extreme, column) [mm]: heights of the extremes of the plane over the least-squares plane, per unit deviation
                 of the columns before its own
    residuals    (3, column): coordinates of the face relative to the least-squares plane, per unit deviation
    free         (3, freedom): coordinates of the plane that the datums before leave free, the offset first
    coordinates  indices of the coordinates of the plane that shift; each has a column
    """

    datum: NominalFeature
    extremes: np.ndarray
    residuals: np.ndarray
    free: np.ndarray
    coordinates: tuple[int, ...]

    @property
    def form(self) -> FormField | None:
        """The form of the datum feature; None if it keeps its shape."""
        return self.datum.form

    @cached_property
    def heights(self) -> np.ndarray:
        """The heights (place, 3) of unit coordinates of the plane at the places of the form."""
        assert self.form is not None
        return self.datum.geometry.rows((self.form.places, self.form.normals[:, None]))[:, 0]

    @property
    def rule(self) -> str:
        """The dependence of the shift, in words."""
        if self.form is None:
            return "follows from the tilts of the datum feature"
        return "follows from the form of the datum feature; minimax plane outside of the material"

    @property
    def columns(self) -> range:
        """The columns of its coordinates."""
        first = self.extremes.shape[1]
        return range(first, first + len(self.coordinates))

    @property
    def sources(self) -> np.ndarray:
        """The columns of the deviations that the shift follows from."""
        columns = np.flatnonzero(self.extremes.any(axis=0))
        return columns if self.form is None else np.union1d(columns, np.array(self.datum.form_columns))

    def labels(self, system: str) -> list[str]:
        """Return the names of its freedoms, for a feature that refers to a datum system."""
        name = f"datum {self.datum.feature.datum} of {system}"
        return [name] if self.form is None else [f"{name}: {self.datum.geometry.names[k]}" for k in self.coordinates]

    def moved(self, kept: np.ndarray, places: np.ndarray) -> "DatumShift | None":
        """Return the shift with some columns kept, and these at other places; None if none of its own columns is kept."""
        is_earlier, is_own = kept < self.columns.start, np.isin(kept, self.columns)
        if not is_own.any():
            return None
        coordinates = tuple(self.coordinates[k - self.columns.start] for k in kept[is_own])
        extremes, residuals = (np.zeros((len(matrix), places[is_own][0])) for matrix in (self.extremes, self.residuals))
        extremes[:, places[is_earlier]] = self.extremes[:, kept[is_earlier]]
        residuals[:, places[is_earlier]] = self.residuals[:, kept[is_earlier]]
        return replace(self, extremes=extremes, residuals=residuals, coordinates=coordinates)

    def shifts(self, deviations: np.ndarray, computed: Shifts) -> np.ndarray:
        """Return the shifts (row, coordinate) [mm] of the datum for deviations (row, column).

        Other features may refer to the same datum: its planes are added to those `computed` before.
        """
        if self.form is None:
            return _summed(deviations, self.extremes).max(axis=1)[:, None]
        residuals = _summed(deviations, self.residuals)
        key = (self.form, residuals.tobytes() + self.free.tobytes())
        if key not in computed:
            computed[key] = self._minimax_planes(self.form, deviations, residuals)
        return computed[key][:, self.coordinates]

    def bounds(self, lower: np.ndarray, upper: np.ndarray) -> tuple[float, float]:
        """Return bounds [mm] of the shift for deviations between `lower` and `upper` (column,)."""
        rows = np.vstack([self.extremes, self.extremes.mean(axis=0)])
        ends = np.stack([rows * bound[: rows.shape[1]] for bound in (lower, upper)])
        return float(ends.min(axis=0).sum(axis=1).max()), float(ends.max(axis=0).sum(axis=1).max())

    def _minimax_planes(self, form: FormField, deviations: np.ndarray, residuals: np.ndarray) -> np.ndarray:
        """Return the coordinates (row, 3) [mm] of the planes that touch faces with `residuals` (row, 3) [mm]."""
        coordinates = np.zeros((len(deviations), 3))
        coordinates[:, 0] = _summed(deviations, self.extremes).max(axis=1)
        coefficients = deviations[:, self.datum.form_columns.start : self.datum.form_columns.stop]
        with_form = np.flatnonzero(coefficients.any(axis=1))
        rows, planes = np.ascontiguousarray(self.heights.T), self.heights @ self.free
        for start in range(0, len(with_form), FIELDS_AT_ONCE):
            indices = with_form[start : start + FIELDS_AT_ONCE]
            heights = np.zeros((len(indices), len(self.heights)))
            sum_modes(residuals[indices], rows, heights)
            sum_modes(coefficients[indices], form.place_heights, heights)
            centre, _ = minimax(planes, heights)
            sum_modes(-centre, np.ascontiguousarray(planes.T), heights)
            centre[:, 0] += heights.max(axis=1)
            coordinates[indices] = (centre[:, :, None] * self.free.T).sum(axis=1)
        return coordinates


class DatumFrame(NamedTuple):
    """The frame of a datum system, for displacements (tau, rho) about one centre.

    motion   (6, column) of the frame per unit deviation; the last columns are for unit shifts of its planes
    free     (6, freedom): displacements that affect none of the datums
    shifts   of its planes, in the order of their columns
    """

    motion: np.ndarray
    free: np.ndarray
    shifts: tuple[DatumShift, ...]

    def columns_affecting(self, effect: np.ndarray) -> np.ndarray:
        """Return the columns without shifts that do not affect `effect` (coordinate, 6) of the motion."""
        affects = np.abs(effect @ self.motion).max(axis=0, initial=0.0) > MIN_SHIFT
        affects[: min((shift.columns.start for shift in self.shifts), default=None)] = True
        for shift in reversed(self.shifts):
            if affects[shift.columns].any():
                affects[shift.sources] = True
        return np.flatnonzero(affects)


def datum_frame(
    system: Sequence[Datums], centre: np.ndarray, reach: float, columns: int, orientation_only: Sequence[bool]
) -> DatumFrame:
    """Return the frame of datums in their precedence, for displacements about a `centre` (3,) [mm].

    The datums of one compartment count together, by least squares of their coordinates. A plane alone is then moved to where it
    touches its feature outside the material (ISO 5459), unless its association is by least squares. Angles are weighed by
    `reach` [mm]. Compartments that are `orientation_only` lock no translations (ISO 5459, "><").
    """
    to_twist = np.diag([1.0] * 3 + [1 / reach] * 3)
    motion, free, shifts = np.zeros((6, columns)), np.eye(6), list[DatumShift]()
    for compartment, is_turned in zip(system, orientation_only, strict=True):
        # J (coordinate, 6): coordinates of the datum features of a compartment for unit displacements.
        J = np.vstack([datum.geometry.about(centre) for datum in compartment]) @ to_twist
        coordinates = np.vstack([padded(datum.coordinates, motion.shape[1]) for datum in compartment])
        selection, jacobian, values = np.eye(len(J)), J, coordinates
        if is_turned:  # only combinations of coordinates that translations do not change: rotations alone affect them
            selection = scipy.linalg.null_space(J[:, :3].T, rcond=RANK_TOLERANCE)
            jacobian, values = selection.T @ J, selection.T @ coordinates
        U, S, Vt = np.linalg.svd(jacobian @ free)
        largest = S.max(initial=0.0)
        rank = int((S > MIN_EFFECT * max(largest, 1e-300)).sum()) if largest > MIN_EFFECT else 0
        if rank:
            moves = free @ (Vt[:rank].T @ (U[:, :rank] / S[:rank]).T)
            motion = motion + moves @ (values - jacobian @ motion)
            if shift := _datum_shift(compartment, coordinates - J @ motion, J @ free, is_turned=is_turned):
                moves, plane = moves @ selection.T, compartment[0].geometry
                assert isinstance(plane, PlaneFeature)
                shift_motion = moves[:, shift.coordinates]
                if shift.form is None:
                    shift_motion = (moves @ plane.values @ np.concatenate([plane.normal, np.zeros(3)]))[:, None]
                motion = np.hstack([motion, shift_motion])
                shifts.append(shift)
        free = free @ Vt[rank:].T
    return DatumFrame(to_twist @ motion, to_twist @ free, tuple(shifts))


def _datum_shift(compartment: Datums, residuals: np.ndarray, tilts: np.ndarray, *, is_turned: bool) -> DatumShift | None:
    """Return the shift of the plane of a compartment from its least-squares plane; None if there is none.

    residuals   (coordinate, column): coordinates of the features relative to their datum, per unit deviation
    tilts       (coordinate, n): coordinates for the motions that the datums before leave free
    is_turned   whether rotations alone affect the datum
    """
    (datum, *further) = compartment
    geometry = datum.geometry
    if further or not isinstance(geometry, PlaneFeature) or datum.feature.association != OUTSIDE:
        return None
    if datum.form is not None:
        residuals = np.where(np.abs(residuals) < MIN_PART, 0.0, residuals)
    extremes = geometry.rows(geometry.extremes)[:, 0] @ residuals
    if datum.form is None and (is_turned or np.abs(extremes).max(initial=0.0) <= MIN_SHIFT):
        return None
    U, S, _ = np.linalg.svd(tilts[1:], full_matrices=False)
    independent = U[:, S > MIN_DIRECTION * max(S.max(initial=0.0), 1.0)]
    return DatumShift(datum, extremes, residuals, block_diag(1.0, independent), (0,) if datum.form is None else (0, 1, 2))


def _summed(deviations: np.ndarray, factors: np.ndarray) -> np.ndarray:
    """Return sums (row, factor) of deviations (row, column) times factors (factor, column), in a fixed order."""
    sums = np.zeros((len(deviations), len(factors)))
    for column in np.flatnonzero(factors.any(axis=0)):
        sums += deviations[:, column, None] * factors[:, column]
    return sums


def datum_order(part: Part) -> tuple[list[Declared], list[Declared]]:
    """Return what is declared of a part, each after its datums, and those whose datums refer to each other in a circle."""
    remaining: list[Declared] = [*part.toleranced, *part.targets]
    present, ordered = set[str | Feature | None](), list[Declared]()
    while ready := [declared for declared in remaining if _references(declared) <= present]:
        ordered += ready
        for declared in ready:
            present |= {declared.letter} if isinstance(declared, DatumTargets) else {declared.datum, *declared.members}
        remaining = [declared for declared in remaining if declared not in ready]
    return ordered, remaining


def _references(declared: Declared) -> set[str | Feature]:
    """Return the letters of datums and the features that a declaration refers to."""
    if isinstance(declared, DatumTargets):
        return set(declared.features)
    letters = {letter for tolerance in declared.geometric for letter in tolerance.letters}
    return {*letters, *(declared.borrowed if isinstance(declared, Pattern) else ())}
