"""Regression of measured heights on the covariances with stations: smooth where points scatter, exact where they agree.

The sum of squared deviations from the points is minimized, with a penalty for rough fields, as in kriging with a nugget. The
number of stations and the penalty predict points that are left out best (generalized cross-validation), over several scans.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
import scipy

from tolcontact.declaration.size import Form
from tolcontact.features.associated_features import AssociatedSurface
from tolcontact.features.covariances import Lengths, covariance
from tolcontact.features.form_field import longest_extent
from tolcontact.geometry.spreading import spread
from tolcontact.geometry.surface import Surface

STATIONS = (160, 320, 640, 1280)
MAX_LENGTH_FACTOR = 40.0  # times the distance of stations, beyond which their covariances are all but dependent
ROUNDING = 1e-11  # that is added to the variance of stations, since their covariances are all but dependent
PENALTIES = tuple(10.0 ** np.arange(-8, 2))  # of a field of variance 1, relative to a squared deviation
MAX_VALUES = 5_000_000  # of the covariances of a scan with stations: of more points, some are taken at random
TRIAL_SCANS = 2  # that determine the number of stations and the penalty
MAX_STATIONS_PER_POINT = 2
MAX_FREEDOM_SHARE = 0.98  # of the number of points: with more, points left out cannot be predicted
MIN_POWER = 1e-300
GAIN_SHARE = 0.002  # of the heights: more stations must predict points better than that
SIGNIFICANT = 2.0  # standard deviations of an error: the same, where points scatter


class Scan(NamedTuple):
    """The points of a measured face.

    path     of its file
    feet     (point, 3) [mm] on the nominal surface
    heights  (point,) [mm] over it, without what displaces the face as a whole
    """

    path: str
    feet: np.ndarray
    heights: np.ndarray

    def sample(self, count: int) -> "Scan":
        """Return the scan with at most a number of its points, taken at random."""
        if len(self.feet) <= count:
            return self
        numbers = np.sort(np.random.default_rng(0).permutation(len(self.feet))[:count])
        return Scan(self.path, self.feet[numbers], self.heights[numbers])


@dataclass(frozen=True, eq=False)
class HeightRegression:
    """Fields of heights by their covariances with stations.

    form        whose covariance it is
    lengths     correlation lengths, as long as the stations tell apart: nothing draws the field towards 0 between points
    associated  what the form is measured from
    stations    (station, 3) [mm] all over the face
    penalty     of rough fields
    """

    form: Form
    lengths: Lengths
    associated: AssociatedSurface
    stations: np.ndarray
    penalty: float

    @classmethod
    def of(cls, form: Form, face: Surface, associated: AssociatedSurface, scans: Sequence[Scan]) -> Self:
        """Return the regression with the fewest stations that predict points of scans as well as more of them do."""
        scans = scans[:: -(-len(scans) // TRIAL_SCANS)]
        trials, fewest = [], min(len(scan.feet) for scan in scans)
        for count in STATIONS:
            if count > max(STATIONS[0], MAX_STATIONS_PER_POINT * fewest):
                break
            trials.append(cls._with_stations(count, form, face, associated)._with_penalty(scans))
            if trials[-1][1] < GAIN_SHARE:
                break
        least = min(error for _, error in trials)
        points = sum(len(scan.feet) for scan in trials[-1][0].samples(scans))
        enough = GAIN_SHARE + (1 + SIGNIFICANT / points**0.5) * least
        return next(regression for regression, error in trials if error <= enough)

    @classmethod
    def _with_stations(cls, count: int, form: Form, face: Surface, associated: AssociatedSurface) -> Self:
        stations = associated.surface.project(spread(face.mesh, count, None))
        distance = float(np.sqrt(face.mesh.area / count))
        length = min(longest_extent(np.asarray(face.mesh.vertices)), MAX_LENGTH_FACTOR * distance)
        return cls(form, Lengths(length, length), associated, stations, PENALTIES[0])

    def _with_penalty(self, scans: Sequence[Scan]) -> tuple[Self, float]:
        """Return the regression with the best penalty for scans, and its error at points left out, relative to heights."""
        errors = np.hstack([self._errors(feet, heights) for feet, heights in _batches(self.samples(scans))]).mean(axis=1)
        best = int(errors.argmin())
        return replace(self, penalty=PENALTIES[best]), float(np.sqrt(errors[best]))

    def _errors(self, feet: np.ndarray, heights: np.ndarray) -> np.ndarray:
        """Return the mean squared errors (penalty, part) at points left out, relative to mean squared heights (point, part)."""
        functions = self._functions(feet)
        eigenvalues, directions = np.linalg.eigh(functions.T @ functions)
        eigenvalues, shares2 = np.maximum(eigenvalues, 0.0), (directions.T @ (functions.T @ heights)) ** 2
        count, power = len(feet), np.maximum((heights**2).sum(axis=0), MIN_POWER)
        errors = np.full((len(PENALTIES), heights.shape[1]), np.inf)
        for number, penalty in enumerate(PENALTIES):
            freedom = float((eigenvalues / (eigenvalues + penalty)).sum())
            left = power - ((eigenvalues + 2 * penalty) / (eigenvalues + penalty) ** 2) @ shares2
            if freedom <= MAX_FREEDOM_SHARE * count or penalty == PENALTIES[-1]:
                errors[number] = (count / (count - freedom)) ** 2 * np.maximum(left, 0.0) / power
        return errors

    def samples(self, scans: Sequence[Scan]) -> list[Scan]:
        """Return as much of scans as the regression takes."""
        return [scan.sample(MAX_VALUES // len(self.stations)) for scan in scans]

    def weights(self, scans: Sequence[Scan]) -> np.ndarray:
        """Return the weights (station, part) [mm] of the covariances with stations in the fields of scans."""
        solutions = []
        for feet, heights in _batches(scans):
            functions = self._functions(feet)
            matrix = functions.T @ functions
            matrix[np.diag_indices_from(matrix)] += self.penalty
            solutions.append(scipy.linalg.solve(matrix, functions.T @ heights, assume_a="pos"))
        return np.asarray(scipy.linalg.solve_triangular(self._factor, np.hstack(solutions), lower=True, trans=1))

    def values(self, points: np.ndarray) -> np.ndarray:
        """Return the covariances (point, station) of points (point, 3) with the stations."""
        return covariance(self.form, self.lengths, self.associated.surface, points, self.stations)

    def _functions(self, points: np.ndarray) -> np.ndarray:
        """Return functions (point, station) whose coefficients have the variance 1 each, at points (point, 3)."""
        return np.asarray(scipy.linalg.solve_triangular(self._factor, self.values(points).T, lower=True).T)

    @cached_property
    def _factor(self) -> np.ndarray:
        """The Cholesky factor of the covariance of stations."""
        return np.linalg.cholesky(self.values(self.stations) + ROUNDING * np.eye(len(self.stations)))


def _batches(scans: Sequence[Scan]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the feet (point, 3) and heights (point, part) of scans in turn, together of those with equal feet."""
    batches = list[tuple[np.ndarray, list[np.ndarray]]]()
    for scan in scans:
        if not (batches and np.array_equal(batches[-1][0], scan.feet)):
            batches.append((scan.feet, []))
        batches[-1][1].append(scan.heights)
    return [(feet, np.column_stack(heights)) for feet, heights in batches]
