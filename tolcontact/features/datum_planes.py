"""Planes that touch datum features outside of the material (ISO 5459): where they lie, seen from those by least squares.

Where that is follows from deviations, but not linearly: coordinates of such a plane are contributors that are not drawn.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from tolcontact.features.feature_geometry import PlaneFeature
from tolcontact.features.form_field import FormField
from tolcontact.features.least_zone import middles
from tolcontact.features.zone_kernel import sum_modes

FIELDS_AT_ONCE = 512
MIN_DIRECTION = 1e-9  # of the largest tilt that a datum system leaves to a plane: smaller ones are rounding
Shifts = dict[tuple[object, bytes], np.ndarray]  # of the faces with form that are known already


@dataclass(frozen=True, eq=False)
class Lean:
    """A plane that leans against the datums before it, so that its datum touches it at an extreme, outside of the material.

    datum        its letter
    extremes     (extreme, column) [mm]: how far the extremes of the plane stand out of its datum by least squares, for
                 deviations of 1. The datum is shifted by the largest one
    coordinates  numbers of the coordinates of the plane in which the datum is shifted; each is a column
    """

    rule: ClassVar[str] = "follows from the tilts of the datum feature"

    datum: str | None
    extremes: np.ndarray
    coordinates: tuple[int, ...]

    def name(self, coordinate: int, system: str) -> str:
        """Return the name of the contributor of a coordinate, for a feature that refers to a datum system."""
        return f"datum {self.datum} of {system}"

    def motions(self, following: np.ndarray, geometry: PlaneFeature) -> np.ndarray:
        """Return the motions (6, column) of a frame for shifts by 1 mm, of those (6, 3) for coordinates of the plane."""
        translation = np.concatenate([geometry.normal, np.zeros(3)])
        return np.asarray(following @ geometry.values @ translation)[:, None]

    def taken(self, columns: np.ndarray, kept: np.ndarray) -> "Lean":
        """Return this lean with some of the `columns` before its own, and with those of its own that are `kept`, by number."""
        return replace(self, extremes=self.extremes[:, columns], coordinates=tuple(self.coordinates[k] for k in kept))

    def at_column(self, own: int, place: int) -> "Lean":
        """Return this lean with its columns from number `own` on, which are those of the leans before it, at `place`."""
        return replace(self, extremes=_moved(self.extremes, own, place))

    @property
    def sources(self) -> np.ndarray:
        """Numbers of the columns of deviations that the shift follows from."""
        return np.flatnonzero(self.extremes.any(axis=0))

    def shifts(self, deviations: np.ndarray, known: Shifts) -> np.ndarray:
        """Return the shifts (row, coordinate) [mm] of the datum for deviations (row, column), summed up in a fixed order."""
        out = np.zeros((len(deviations), len(self.extremes)))
        for column, factors in enumerate(self.extremes.T):
            if factors.any():
                out += deviations[:, column, None] * factors
        return out.max(axis=1)[:, None]

    def bounds(self, lower: np.ndarray, upper: np.ndarray) -> tuple[float, float]:
        """Return bounds [mm] of the shift for deviations between `lower` and `upper` (contributor,)."""
        rows = np.vstack([self.extremes, self.extremes.mean(axis=0)])
        ends = np.stack([rows * bound[: rows.shape[1]] for bound in (lower, upper)])
        return float(ends.min(axis=0).sum(axis=1).max()), float(ends.max(axis=0).sum(axis=1).max())


@dataclass(frozen=True, eq=False)
class TangentPlane(Lean):
    """The plane that touches a face with form: of those outside of the material the one with the least distance from the face.

    The distance is the largest one from any place (ISO 5459: minimax), so that the plane is the middle of the least zone of the
    face, moved out of the material by half of its width. It tilts as far as the datums before leave its orientation free. If
    the form of a face is 0, the plane touches it as a face that keeps its shape.

    form, form_columns   of the face, and the columns of its coefficients
    heights              (place, 3): heights of coordinates of the plane of 1 mm at the places of the form
    leaning              (3, column): coordinates of the face beside its datum by least squares, for deviations of 1
    free                 (3, freedom): coordinates of the plane in which it may lie, the offset first
    """

    rule: ClassVar[str] = "follows from the form of the datum feature; minimax plane outside of the material"

    form: FormField
    form_columns: range
    heights: np.ndarray
    leaning: np.ndarray
    free: np.ndarray
    names: tuple[str, ...]

    def name(self, coordinate: int, system: str) -> str:
        return f"datum {self.datum} of {system}: {self.names[coordinate]}"

    def motions(self, following: np.ndarray, geometry: PlaneFeature) -> np.ndarray:
        return following[:, self.coordinates]

    def taken(self, columns: np.ndarray, kept: np.ndarray) -> "TangentPlane":
        taken = super().taken(columns, kept)
        assert isinstance(taken, TangentPlane)
        return replace(taken, leaning=self.leaning[:, columns])

    def at_column(self, own: int, place: int) -> "TangentPlane":
        moved = super().at_column(own, place)
        assert isinstance(moved, TangentPlane)
        return replace(moved, leaning=_moved(self.leaning, own, place))

    @property
    def sources(self) -> np.ndarray:
        return np.union1d(super().sources, np.array(self.form_columns))

    def shifts(self, deviations: np.ndarray, known: Shifts) -> np.ndarray:
        leaning = np.zeros((len(deviations), 3))
        for column, factors in enumerate(self.leaning.T):
            if factors.any():
                leaning += deviations[:, column, None] * factors
        key = (self.form, leaning.tobytes() + self.free.tobytes())
        if key not in known:  # other features may refer to the same datum
            known[key] = self._touching(deviations, leaning)
        return known[key][:, self.coordinates]

    def _touching(self, deviations: np.ndarray, leaning: np.ndarray) -> np.ndarray:
        """Return the coordinates (row, 3) [mm] of the planes that touch faces which lean by `leaning` (row, 3)."""
        coordinates = np.zeros((len(deviations), 3))
        coordinates[:, :1] = super().shifts(deviations, {})
        coefficients = deviations[:, self.form_columns.start : self.form_columns.stop]
        with_form = np.flatnonzero(coefficients.any(axis=1))
        rows, planes = np.ascontiguousarray(self.heights.T), self.heights @ self.free
        for start in range(0, len(with_form), FIELDS_AT_ONCE):
            numbers = with_form[start : start + FIELDS_AT_ONCE]
            heights = np.zeros((len(numbers), len(self.heights)))
            sum_modes(leaning[numbers], rows, heights)
            sum_modes(coefficients[numbers], self.form.place_heights, heights)
            middle, _ = middles(planes, heights)
            sum_modes(-middle, np.ascontiguousarray(planes.T), heights)
            middle[:, 0] += heights.max(axis=1)
            coordinates[numbers] = (middle[:, :, None] * self.free.T).sum(axis=1)
        return coordinates


def free_directions(tilts: np.ndarray) -> np.ndarray:
    """Return the coordinates (3, freedom) in which a plane with `tilts` (2, n) may lie: its offset, and independent tilts."""
    U, S, _ = np.linalg.svd(tilts, full_matrices=False)
    spanned = U[:, S > MIN_DIRECTION * max(S.max(initial=0.0), 1.0)]
    free = np.zeros((3, 1 + spanned.shape[1]))
    free[0, 0] = 1.0
    free[1:, 1:] = spanned
    return free


def _moved(matrix: np.ndarray, own: int, place: int) -> np.ndarray:
    """Return a matrix (row, column) with its columns from number `own` on at `place`, and zeros in between."""
    between = np.zeros((len(matrix), place - own))
    return np.hstack([matrix[:, :own], between, matrix[:, own:]])
