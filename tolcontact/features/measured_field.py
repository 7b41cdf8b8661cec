"""The form field of measured faces: their mean, and the principal components of their deviations from it.

Heights of the points of each part over the nominal surface are fitted with functions of place, so that the field is known at
any place like any other. Coefficients vary as the measured faces do. The field is compared with the points: a form that changes
over shorter lengths than the distance of stations, or of points, is refused.

The functions are covariances with stations: smooth where points scatter, exact where they agree. The sum of squared deviations
from the points is minimized, with a penalty for rough fields, as in kriging with a nugget. The number of stations and the
penalty predict points that are left out best (generalized cross-validation), over several scans.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
import scipy

from tolcontact.declaration.size import Covariance, Form
from tolcontact.errors import GeometryFault
from tolcontact.features.associated_features import AssociatedSurface, Lengths, covariance, displacement_terms
from tolcontact.features.form_field import (
    FormField,
    associated_covariance,
    longest_extent,
    scales_within,
    without_displacements,
)
from tolcontact.features.minimum_zone import ZoneMember, minimum_widths
from tolcontact.geometry.analytic_surfaces import Cone, Cylinder
from tolcontact.geometry.measured_points import measured_points
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
ERROR_LIMIT = 2.0  # standard deviations of an error: the same, where points scatter
COVARIANCE: Covariance = "matern 5/2"  # for the heights between stations
MIN_EXTENT_SHARE = 0.5  # of a face, in each of its principal directions
MIN_POINTS = 24
MAX_HEIGHT_SHARE = 0.02  # of a face's size: a point further from its surface was not measured on it
DIGITS = 6  # of mm: points that are no further apart are one, whose scatter is not independent
MIN_VARIANCE = 1e-8  # of the largest: a component with less is rounding
MAX_LOST_SHARE = 0.25  # of the form: what the field may leave out
MAX_EXCESS = 3.0  # times the largest height at the points: what the field may reach between them
NEIGHBOURS = 8  # of a point, whose deviations from the field are compared with its own
SCATTER_LIMIT = 5.0  # standard deviations of a mean, above which deviations from the field are more than scatter
STEP_SHARE = 1e-4  # of the correlation length: steps of slopes


class Scan(NamedTuple):
    """The points of a measured face.

    path     of its file
    feet     (point, 3) [mm] on the nominal surface
    heights  (point,) [mm] over it, without what displaces the face as a whole
    """

    path: str
    feet: np.ndarray
    heights: np.ndarray


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
        trials, fewest = list[tuple[Self, float]](), min(len(scan.feet) for scan in scans)
        extent = longest_extent(np.asarray(face.mesh.vertices))
        for count in STATIONS:
            if count > max(STATIONS[0], MAX_STATIONS_PER_POINT * fewest):
                break
            stations = associated.surface.project(spread(face.mesh, count, None))
            length = min(extent, MAX_LENGTH_FACTOR * float(np.sqrt(face.mesh.area / count)))
            regression = cls(form, Lengths(length, length), associated, stations, PENALTIES[0])
            batches = _batches(regression.samples(scans))
            errors = np.hstack([regression._errors(feet, heights) for feet, heights in batches]).mean(axis=1)
            best = int(errors.argmin())
            trials.append((replace(regression, penalty=PENALTIES[best]), float(np.sqrt(errors[best]))))
            if trials[-1][1] < GAIN_SHARE:
                break
        least = min(error for _, error in trials)
        points = sum(len(scan.feet) for scan in trials[-1][0].samples(scans))
        enough = GAIN_SHARE + (1 + ERROR_LIMIT / points**0.5) * least
        return next(regression for regression, error in trials if error <= enough)

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
        """Return as many points of scans as the regression takes, at random."""
        rows = [np.random.default_rng(0).permutation(len(scan.feet))[: MAX_VALUES // len(self.stations)] for scan in scans]
        return [Scan(scan.path, scan.feet[np.sort(k)], scan.heights[np.sort(k)]) for scan, k in zip(scans, rows, strict=True)]

    def weights(self, scans: Sequence[Scan]) -> np.ndarray:
        """Return the weights (station, part) [mm] of the covariances with stations in the fields of scans."""
        solutions = []
        for feet, heights in _batches(scans):
            functions = self._functions(feet)
            matrix = functions.T @ functions
            matrix[np.diag_indices_from(matrix)] += self.penalty
            solutions.append(scipy.linalg.solve(matrix, functions.T @ heights, assume_a="pos"))
        return np.asarray(scipy.linalg.solve_triangular(self._factor, np.hstack(solutions), lower=True, trans=1))

    def covariances(self, points: np.ndarray) -> np.ndarray:
        """Return the covariances (point, station) of points (point, 3) with the stations."""
        return covariance(self.form, self.lengths, self.associated.surface, points, self.stations)

    def form_heights(self, points: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the heights (point, part) [mm] of fields of weights (station, part) at points (point, 3), as form alone.

        They are `covariances(points) @ weights`, the heights over the nominal surface, without the displacements of the
        sections or lines of the points.
        """
        return associated_covariance(self.form, self.lengths, self.associated, points, self.stations) @ weights

    def _functions(self, points: np.ndarray) -> np.ndarray:
        """Return functions (point, station) whose coefficients have the variance 1 each, at points (point, 3)."""
        return np.asarray(scipy.linalg.solve_triangular(self._factor, self.covariances(points).T, lower=True).T)

    @cached_property
    def _factor(self) -> np.ndarray:
        """The Cholesky factor of the covariance of stations."""
        return np.linalg.cholesky(self.covariances(self.stations) + ROUNDING * np.eye(len(self.stations)))


def _batches(scans: Sequence[Scan]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the feet (point, 3) and heights (point, part) of scans in turn, together of those with equal feet."""
    batches = list[tuple[np.ndarray, list[np.ndarray]]]()
    for scan in scans:
        if not (batches and np.array_equal(batches[-1][0], scan.feet)):
            batches.append((scan.feet, []))
        batches[-1][1].append(scan.heights)
    return [(feet, np.column_stack(heights)) for feet, heights in batches]


def measured_field(form: Form, face: Surface, associated: AssociatedSurface) -> FormField:
    """Return the form field of faces whose points are in files, in the frame of their part. Raises GeometryFault."""
    assert form.measured is not None
    pattern, form = form.measured, replace(form, covariance=COVARIANCE)
    everywhere = associated.surface.project(spread(face.mesh, STATIONS[0], None))
    scans = [_scan(cloud, str(path), face, everywhere, associated) for path, cloud in measured_points(pattern).items()]
    regression = HeightRegression.of(form, face, associated, scans)
    scans = regression.samples(scans)
    weights = regression.weights(scans)
    fits = [_fit(scan, of_part, regression) for scan, of_part in zip(scans, weights.T, strict=True)]
    lengths = _lengths(regression, weights)
    places, areas = associated.places(face, lengths)
    shares = areas / areas.sum()
    heights, removed = without_displacements(regression.form_heights(places, weights), associated, places, shares)
    mixes, size, spreads = _principal_components(heights, form.modes)
    kept, lost = mixes.shape[1] - 1, float(np.mean([loss**2 for _, loss in fits]))
    left_out = (float((spreads[kept:] ** 2).sum()) + lost) / max(size**2 + float((spreads**2).sum()) + lost, 1e-300)
    scales = scales_within(lengths, associated, places)
    field = FormField(
        form, associated, regression.lengths, scales, places, regression.stations, weights @ mixes, removed @ mixes, left_out,
        spreads=np.array([0.0, *spreads[:kept]]), means=np.array([size, *[0.0] * kept]), scans={},
    )  # fmt: skip
    widths = [width for width, _ in fits]
    if not associated.is_whole:  # each section or line has a zone of its own, at places
        widths = [float(width) for width in minimum_widths(field.zone, (heights / np.sqrt(shares)[:, None]).T)]
    return replace(field, scans={scan.path: width for scan, width in zip(scans, widths, strict=True)})


def _principal_components(heights: np.ndarray, modes: int) -> tuple[np.ndarray, float, np.ndarray]:
    """Return the mean and the principal components of heights (place, part) [mm], as mixes (part, 1 + component) of parts.

    There are at most `modes` components. The heights of each mix have the length 1. Return also the length of the mean, and the
    standard deviations of all components, in mm.
    """
    mean, count = heights.mean(axis=1), heights.shape[1]
    _, spreads, directions = np.linalg.svd((heights - mean[:, None]) / np.sqrt(count - 1), full_matrices=False)
    kept = min(modes, int((spreads**2 > MIN_VARIANCE * spreads[0] ** 2).sum()))
    mixes = np.column_stack([np.full(count, 1 / count), (directions[:kept] / spreads[:kept, None]).T / np.sqrt(count - 1)])
    mixes[:, 1:] -= mixes[:, 1:].mean(axis=0)
    size = max(float(np.linalg.norm(mean)), 1e-300)
    mixes[:, 0] /= size
    return mixes, size, spreads


def _scan(cloud: np.ndarray, path: str, face: Surface, everywhere: np.ndarray, associated: AssociatedSurface) -> Scan:
    """Return the heights of a measured part over its nominal face, from its points (point, 3) [mm].

    Raises GeometryFault for points that are not of the face, or not near places (place, 3) everywhere on it.
    """
    outward = -1.0 if any(piece.is_hollow for piece in face.pieces) else 1.0
    distances, normals = associated.surface.distance(cloud)
    heights = outward * distances
    outermost = int(np.abs(heights).argmax())
    if abs(heights[outermost]) > MAX_HEIGHT_SHARE * face.mesh.scale:
        raise GeometryFault(
            f'"{path}": point {outermost + 1} is {abs(heights[outermost]):.3g} mm away from the face; expected points of the '
            "face, in mm in the frame of the part"
        )
    feet = associated.surface.project(cloud)
    _, distinct = np.unique(feet.round(DIGITS), axis=0, return_index=True)
    if len(distinct) < MIN_POINTS:
        raise GeometryFault(
            f'"{path}" has {len(distinct)} points; expected at least {MIN_POINTS}, all over the face, for its '
            "form; tc.io.measured_planes(...) takes a plane without form from 3 or more"
        )
    distance = float(scipy.spatial.KDTree(feet).query(everywhere)[0].max())
    if distance > face.mesh.scale / 4:
        raise GeometryFault(
            f'"{path}" has no points within {distance:.3g} mm of a place of the face; expected points all over it'
        )
    *_, axes = np.linalg.svd(everywhere - everywhere.mean(axis=0), full_matrices=False)
    extents, extents_of_face = np.ptp(feet @ axes.T, axis=0), np.ptp(everywhere @ axes.T, axis=0)
    if (narrow := extents < MIN_EXTENT_SHARE * extents_of_face - 1e-6 * face.mesh.scale).any():
        raise GeometryFault(
            f'"{path}" has points over {extents[narrow][0]:.3g} mm of the {extents_of_face[narrow][0]:.3g} mm that the face '
            "extends in a direction; expected points all over it"
        )
    feet, normals, heights = feet[distinct], normals[distinct], heights[distinct]
    terms = displacement_terms(normals, feet - feet.mean(axis=0))
    displacement, *_ = np.linalg.lstsq(terms, heights, rcond=1e-10)
    return Scan(path, feet, heights - terms @ displacement)


def _fit(scan: Scan, weights: np.ndarray, regression: HeightRegression) -> tuple[float, float]:
    """Return the minimum zone of a scan, and the root mean square of the form that a field of weights (station,) leaves out.

    Both are in mm. What neighbours deviate by equally is form that the field leaves out; the rest is scatter.
    Raises GeometryFault if the field does not agree with the points.
    """
    feet, values = scan.feet, regression.covariances(scan.feet) @ weights
    deviations = scan.heights - values
    # Equal or opposite: waves of a few points are opposite at the second neighbour or the third.
    products = deviations[:, None] * deviations[scipy.spatial.KDTree(feet).query(feet, NEIGHBOURS + 1)[1][:, 1:]]
    shared = float((np.abs(products.mean(axis=0)) - SCATTER_LIMIT * products.std(axis=0) / np.sqrt(len(feet))).max())
    lost = float(np.sqrt(max(shared, 0.0)))
    height = float(np.hypot(values.std(), lost))
    if lost > MAX_LOST_SHARE * height:
        raise GeometryFault(
            f'"{scan.path}": its form changes over too short lengths: the field of {len(weights)} stations leaves out '
            f"{lost:.2g} mm of its {height:.2g} mm (root mean square), and up to {np.abs(deviations).max():.2g} mm; filter "
            "short waves out of the points, or divide the face into several features"
        )
    elsewhere = regression.covariances(regression.stations) @ weights
    excess = float(np.abs(elsewhere).max() / max(np.abs(values).max(), 1e-300))
    if excess > MAX_EXCESS:
        raise GeometryFault(
            f'"{scan.path}": its points are too far apart for its form: the field is up to {excess:.2g} times as high '
            "between or beside them; measure more points, also along the rim, or filter short waves out of the points"
        )
    rows = regression.associated.rows(feet)
    return float(minimum_widths([ZoneMember(np.arange(len(feet)), rows)], values[None])[0]), lost


def _lengths(regression: HeightRegression, weights: np.ndarray) -> Lengths:
    """Return the lengths [mm] over which fields of weights (station, part) change: their heights divided by their slopes.

    A squared exponential of this correlation length has the same slopes.
    """
    surface, stations = regression.associated.surface, regression.stations
    _, normals = surface.distance(stations)
    is_axial = isinstance(surface, Cylinder | Cone)
    across = np.cross(surface.axis, normals) if is_axial else np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    step = STEP_SHARE * min(regression.lengths)
    slopes = np.stack([
        (regression.form_heights(stations + arms, weights) - regression.form_heights(stations - arms, weights)) / (2 * step)
        for arms in (step * across, step * np.cross(normals, across))
    ]).reshape(2, -1)  # fmt: skip
    moments = slopes @ slopes.T / slopes.shape[1]
    steepest = np.diagonal(moments) if is_axial else np.full(2, np.linalg.eigvalsh(moments)[-1])
    height2 = float((regression.form_heights(stations, weights) ** 2).mean())
    return Lengths(*(
        min(length, float(np.sqrt(height2 / slope2))) if slope2 > 0 else length
        for length, slope2 in zip(regression.lengths, steepest, strict=True)
    ))  # fmt: skip
