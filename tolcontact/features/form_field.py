"""Form fields: heights of a face as few functions of place, without what displaces the face as a whole.

The functions are Karhunen-Loeve modes of a covariance, orthogonal to rigid displacements by area. They follow from a pivoted
Cholesky factor of the covariance, so that they are known at any place: height(p) = covariance(p, stations) @ weights - removed.
All that uses a face thus shares one field.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from tolcontact.declaration.form import Form
from tolcontact.features.covariances import COVARIANCES
from tolcontact.geometry.quadrature import quadrature
from tolcontact.geometry.surface import Surface

LENGTH_SHARE = 1 / 3  # of the longest extent of a face: the usual correlation length
MIN_QUADRATURE = 600  # places of a face over which areas are summed, at least
MAX_QUADRATURE = 20_000
QUADRATURE_SPACING = 1 / 4  # of the correlation length
MAX_STATIONS = 200
REST = 1e-8  # of the variance: what the stations leave out at no place


@dataclass(frozen=True, eq=False)
class FormField:
    """Modes of a plane face, as functions of place; each has the standard deviation that it has in a field of variance 1.

    form        as declared
    length      [mm] correlation length
    places      (place, 3) [mm] all over the face, at which zones are evaluated
    stations    (station, 3) [mm]
    weights     (station, mode)
    removed     (4, mode): constant and gradient [1/mm] of the displacement of the face as a whole, which a mode leaves out
    left_out    share of the variance of the field that the modes leave out
    """

    form: Form
    length: float
    places: np.ndarray
    stations: np.ndarray
    weights: np.ndarray
    removed: np.ndarray
    left_out: float

    @property
    def modes(self) -> int:
        """The number of modes."""
        return self.weights.shape[1]

    def heights(self, points: np.ndarray) -> np.ndarray:
        """Return the heights (..., mode) of each mode at points (..., 3) [mm] of the face."""
        flat = points.reshape(-1, 3)
        covariance = COVARIANCES[self.form.covariance](scipy.spatial.distance.cdist(flat, self.stations) / self.length)
        heights = np.tile(-self.removed[0], (len(flat), 1))
        # A product of matrices would depend, in its last bits, on the number of points.
        for factor, row in zip((*-flat.T, *covariance.T), (*self.removed[1:], *self.weights), strict=True):
            heights += factor[:, None] * row
        return heights.reshape(*points.shape[:-1], self.modes)

    def placed(self, R: np.ndarray, t: np.ndarray) -> "FormField":
        """Return the field of a face that stands at R (3, 3), t (3,) [mm]."""
        gradient = R @ self.removed[1:]
        removed = np.vstack([self.removed[0] - t @ gradient, gradient])
        return replace(self, places=self.places @ R.T + t, stations=self.stations @ R.T + t, removed=removed)


def form_field(form: Form, surface: Surface) -> FormField:
    """Return the form field of a plane face, in its part's own frame."""
    vertices = np.asarray(surface.mesh.vertices)
    length = form.length or LENGTH_SHARE * longest_extent(vertices)
    count = min(max(MIN_QUADRATURE, surface.mesh.area / (QUADRATURE_SPACING * length) ** 2), MAX_QUADRATURE)
    places, areas = quadrature(surface.mesh, float(np.sqrt(surface.mesh.area / count)))
    factor, pivots, rest = _cholesky(places, form, length)
    root = np.sqrt(areas / areas.sum())
    affine = np.column_stack([np.ones(len(places)), places])
    removed, *_ = np.linalg.lstsq(affine * root[:, None], (factor * root).T, rcond=1e-10)
    remainder = (factor.T - affine @ removed) * root[:, None]
    variances, directions = np.linalg.eigh(remainder.T @ remainder)
    modes = directions[:, : -form.modes - 1 : -1]  # of the rows of the factor
    modes = modes * np.sign(np.diagonal(modes[np.abs(modes).argmax(axis=0)]))
    return FormField(
        form=form,
        length=length,
        places=places,
        stations=places[pivots],
        weights=np.linalg.solve(factor[:, pivots], modes),
        removed=removed @ modes,
        left_out=float(1 - variances[-form.modes :].sum() / (variances.sum() + rest @ areas / areas.sum())),
    )


def longest_extent(points: np.ndarray) -> float:
    """Return the longest extent [mm] of points (point, 3) along their principal directions."""
    _, _, directions = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    return float(np.ptp(points @ directions.T, axis=0).max())


def _cholesky(places: np.ndarray, form: Form, length: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the pivoted Cholesky factor (station, place) of the covariance, the pivots (station,), and what it leaves out.

    This is a variance (place,).
    """
    variance, rows, pivots = np.ones(len(places)), np.zeros((0, len(places))), list[int]()
    while len(rows) < min(MAX_STATIONS, len(places)) and variance.max() > REST:
        pivot = int(variance.argmax())
        distance = np.linalg.norm(places - places[pivot], axis=1) / length
        row = (COVARIANCES[form.covariance](distance) - rows[:, pivot] @ rows) / np.sqrt(variance[pivot])
        rows, variance = np.vstack([rows, row]), np.maximum(variance - row**2, 0.0)
        pivots.append(pivot)
    return rows, np.array(pivots), variance
