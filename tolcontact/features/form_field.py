"""Form fields: heights of a face as few functions of place, without displacements of the face as a whole.

The functions are Karhunen-Loeve modes of a covariance, orthogonal to rigid displacements and growths by area. They follow from
a pivoted Cholesky factor of the covariance, so that they are known at any place: height(p) = covariance(p, stations) @ weights
- removed. All that uses a face thus shares one field.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tolcontact.declaration.size import Form
from tolcontact.errors import GeometryFault
from tolcontact.features.associated_features import (
    TERMS,
    AssociatedSurface,
    Lengths,
    covariance,
    displacement_terms,
    placed_twist,
)
from tolcontact.features.minimum_zone import ZoneMember
from tolcontact.geometry.analytic_surfaces import Cone, Cylinder
from tolcontact.geometry.surface import Surface

LENGTH_SHARE = 1 / 3  # of the longest extent of a face: the usual correlation length
MAX_STATIONS = 200
VALUES_AT_ONCE = 1 << 22  # of covariances with stations
REST = 1e-5  # of the variance: what the stations leave out at no place
MIN_VARIANCE = 1e-10  # of the largest: a mode with less is rounding


@dataclass(frozen=True, eq=False)
class FormField:
    """Modes of a face, as functions of place; each has the standard deviation that it has in a field of variance 1.

    form        as declared
    associated  what the form is measured from
    lengths     correlation lengths
    scales      lengths over which heights change
    places      (place, 3) [mm] all over the face, at which zones are evaluated
    stations    (station, 3) [mm]
    weights     (station, mode)
    removed     (7, mode): growth, translation and rotation [1/mm] about the origin of the face as a whole, which a mode leaves
                out
    left_out    share of the variance of the field that the modes leave out, of measured faces also what the field leaves out
    spreads     (mode,) [mm] standard deviations of the coefficients, as measured; None if these follow from a tolerance
    means       (mode,) [mm] of the coefficients; None: 0
    scans       widths [mm] of the minimum zones of measured faces by file; empty if the form follows from a tolerance
    """

    form: Form
    associated: AssociatedSurface
    lengths: Lengths
    scales: Lengths
    places: np.ndarray
    stations: np.ndarray
    weights: np.ndarray
    removed: np.ndarray
    left_out: float
    spreads: np.ndarray | None
    means: np.ndarray | None
    scans: Mapping[str, float]

    @property
    def modes(self) -> int:
        """The number of modes."""
        return self.weights.shape[1]

    @property
    def normals(self) -> np.ndarray:
        """Unit normals (place, 3) of the surface at the places, away from its axis or centre."""
        return self.associated.surface.distance(self.places)[1]

    @cached_property
    def zone(self) -> tuple[ZoneMember, ...]:
        """The members of the zone of the form, at the places."""
        members = self.associated.members(self.places)
        return tuple(ZoneMember(indices, self.associated.rows(self.places[indices])) for indices in members)

    @cached_property
    def place_heights(self) -> np.ndarray:
        """The heights (mode, place) of each mode at the places."""
        return np.ascontiguousarray(self.heights(self.places).T)

    def heights(self, points: np.ndarray) -> np.ndarray:
        """Return the heights (..., mode) of each mode at points (..., 3) [mm] of the face."""
        flat = points.reshape(-1, 3)
        heights = np.zeros((len(flat), self.modes))
        for piece in self._pieces(len(flat)):
            # A product of matrices would depend, in its last bits, on the number of points.
            for factor, row in zip(np.hstack(self._functions(flat[piece])).T, (*self.weights, *-self.removed), strict=True):
                heights[piece] += factor[:, None] * row
        return heights.reshape(*points.shape[:-1], self.modes)

    def sums(self, points: np.ndarray, row: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
        """Return the heights (point,) [mm] at points (point, 3) of faces, each of its own row (point,) of coefficients."""
        factors = np.zeros((len(coefficients), len(self.stations) + TERMS))
        for k, mode in enumerate(np.vstack([self.weights, -self.removed]).T):
            factors += coefficients[:, k, None] * mode
        heights = np.zeros(len(points))
        for piece in self._pieces(len(points)):
            values, terms = self._functions(points[piece])
            of_points, count = factors[row[piece]], len(self.stations)
            heights[piece] = (values * of_points[:, :count]).sum(axis=1)
            heights[piece] += (terms * of_points[:, count:]).sum(axis=1)
        return heights

    def _pieces(self, count: int) -> Iterator[slice]:
        """Yield pieces of a number of points that are evaluated at once."""
        step = max(VALUES_AT_ONCE // len(self.stations), 1)
        yield from (slice(start, start + step) for start in range(0, count, step))

    def _functions(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return covariances with stations (point, station) and displacements of the face (point, 7) at points (point, 3)."""
        _, normals = self.associated.surface.distance(points)
        values = associated_covariance(self.form, self.lengths, self.associated, points, self.stations)
        return values, displacement_terms(normals, points)

    def placed(self, R: np.ndarray, t: np.ndarray) -> "FormField":
        """Return the field of a face in a part at R (3, 3), t (3,) [mm]."""
        removed = displaced_about_origin(np.vstack([self.removed[:1], placed_twist(self.removed[1:], R)]), t)
        places, stations = self.places @ R.T + t, self.stations @ R.T + t
        return replace(self, associated=self.associated.placed(R, t), places=places, stations=stations, removed=removed)


def form_field(form: Form, face: Surface, associated: AssociatedSurface) -> FormField:
    """Return the form field of a face on an analytic surface, in its part's own frame."""
    extents = face_extents(associated, np.asarray(face.mesh.vertices))
    across = extents.across / 2 / form.lobes if form.lobes else form.length or LENGTH_SHARE * extents.across
    lengths = Lengths(across, form.length or LENGTH_SHARE * extents.along)
    places, areas = associated.places(face, lengths)
    factor, pivots, rest = _cholesky(places, form, lengths, associated)
    stations, shares = places[pivots], areas / areas.sum()
    inverse = np.linalg.inv(factor[:, pivots])
    functions = associated_covariance(form, lengths, associated, places, stations) @ inverse
    remainder, removed = without_displacements(functions, associated, places, shares)
    variances, directions = np.linalg.eigh(remainder.T @ remainder)
    if variances.sum() < REST:
        raise GeometryFault(
            f"the correlation length of its form, {max(lengths):.3g} mm, is so large that little more than displacements of "
            f"the face is left; expected at most three times its extent, {longest_extent(places):.3g} mm"
        )
    count = min(form.modes, int((variances > MIN_VARIANCE * variances[-1]).sum()))
    modes = directions[:, : -count - 1 : -1]  # of the functions
    modes = modes * np.sign(np.diagonal(modes[np.abs(modes).argmax(axis=0)]))
    left_out = float(1 - variances[-count:].sum() / (variances.sum() + rest @ shares))
    scales, weights, removed = scales_within(lengths, associated, places), inverse @ modes, removed @ modes
    return FormField(form, associated, lengths, scales, places, stations, weights, removed, left_out, None, None, {})


def without_displacements(
    functions: np.ndarray, associated: AssociatedSurface, places: np.ndarray, shares: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return functions (place, function) without displacements and growths of the face, and these (7, function).

    shares   (place,) of the area. Values of a place are returned times the root of its share.
    """
    root, centre = np.sqrt(shares)[:, None], places.mean(axis=0)
    # Sections and lines without displacements are not displaced as a whole either.
    terms = associated.is_whole * displacement_terms(associated.surface.distance(places)[1], places - centre)
    removed, *_ = np.linalg.lstsq(terms * root, functions * root, rcond=1e-10)
    return (functions - terms @ removed) * root, displaced_about_origin(removed, centre)


def scales_within(lengths: Lengths, associated: AssociatedSurface, places: np.ndarray) -> Lengths:
    """Return the lengths over which heights change at places (place, 3) of a face, at most half of its extents.

    A length far beyond the face leaves heights that bend once over the face.
    """
    extents = face_extents(associated, places)
    return Lengths(min(lengths.across, extents.across / 2), min(lengths.along, extents.along / 2))


def face_extents(associated: AssociatedSurface, points: np.ndarray) -> Lengths:
    """Return the diameter of points (point, 3) [mm] around an axis and their extent along it; without axis the longest one."""
    surface = associated.surface
    if not isinstance(surface, Cylinder | Cone):
        return Lengths(longest_extent(points), longest_extent(points))
    radii, _, along = surface.around_axis(points)
    return Lengths(2 * float(radii.max()), float(np.ptp(along)))


def longest_extent(points: np.ndarray) -> float:
    """Return the longest extent [mm] of points (point, 3) along their principal directions."""
    _, _, directions = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    return float(np.ptp(points @ directions.T, axis=0).max())


def displaced_about_origin(displacements: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Return displacements (7, n) with rotations about the origin that equal some with rotations about a centre (3,) [mm]."""
    growth, translation, rotation = np.split(displacements, [1, TERMS - 3])
    return np.vstack([growth, translation + np.cross(centre, rotation, axisb=0).T, rotation])


def associated_covariance(
    form: Form, lengths: Lengths, associated: AssociatedSurface, points: np.ndarray, stations: np.ndarray
) -> np.ndarray:
    """Return the covariance (point, station), as functions of the points without displacements of sections or lines."""
    values = np.zeros((len(points), len(stations)))
    for factors, copies in associated.copies(points):
        values += factors[:, None] * covariance(form, lengths, associated.surface, copies, stations)
    return values


def _cholesky(
    places: np.ndarray, form: Form, lengths: Lengths, associated: AssociatedSurface
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the pivoted Cholesky factor (station, place) of the covariance, the pivots (station,), and the remaining variance.

    The variance (place,) is what the stations leave out.
    """
    variance, rows, pivots = np.ones(len(places)), np.zeros((0, len(places))), list[int]()
    while len(rows) < min(MAX_STATIONS, len(places)) and variance.max() > REST:
        pivot = int(variance.argmax())
        column = covariance(form, lengths, associated.surface, places, places[pivot][None])[:, 0]
        row = (column - rows[:, pivot] @ rows) / np.sqrt(variance[pivot])
        rows, variance = np.vstack([rows, row]), np.maximum(variance - row**2, 0.0)
        pivots.append(pivot)
    return rows, np.array(pivots), variance
