"""What form deviations are measured from: an associated surface, or the circles or the lines of a surface (ISO 17450).

A flatness or a cylindricity limits a face as a whole, free of displacements and sizes of its surface. A roundness limits each
section, free of its position and diameter, and a straightness each line, free of its position and slope.

The heights of two points have a covariance by their distance in correlation lengths. The variance is 1. With a number of lobes,
heights vary around the axis of the face as a cosine, and by the distance along the axis.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple, Self

import numpy as np
import scipy

from tolcontact.declaration.size import Form
from tolcontact.errors import GeometryFault
from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Cone, Cylinder, azimuths
from tolcontact.geometry.surface import Surface
from tolcontact.geometry.tolerances import ON_FACE
from tolcontact.geometry.triangle_mesh import quadrature

PLACE_SPACING = 1 / 4  # of the correlation length
MIN_PLACES, MAX_PLACES = 600, 20_000  # of a face, over which areas are summed
MAX_EXCESS = 8  # times the intended number of places
MIN_AZIMUTHS, MAX_AZIMUTHS = 48, 144  # of a circle
MIN_HEIGHTS, MAX_HEIGHTS = 9, 25
MAX_FACET_ANGLE = np.radians(46.0)  # between neighbouring vertices: a wider gap is a gap of the face
ROTATIONS = 32  # that determine the position and diameter of a section, exactly for fewer lobes
NODES = 16  # of a line
MIN_LENGTH = 1e-9  # of a displacement, relative to the largest
START = 0.01  # rad before the first line, where no other line is: azimuths are counted from here
TERMS = 7  # of the displacement of a surface: its growth, then a translation and a rotation


def squared_exponential(distance: np.ndarray) -> np.ndarray:
    """Return the covariance of very smooth fields."""
    return np.asarray(np.exp(-(distance**2) / 2))


def matern_5_2(distance: np.ndarray) -> np.ndarray:
    """Return the covariance of fields that are twice differentiable."""
    scaled = np.sqrt(5) * distance
    return np.asarray((1 + scaled + scaled**2 / 3) * np.exp(-scaled))


def matern_3_2(distance: np.ndarray) -> np.ndarray:
    """Return the covariance of fields that are once differentiable."""
    scaled = np.sqrt(3) * distance
    return np.asarray((1 + scaled) * np.exp(-scaled))


COVARIANCES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "squared exponential": squared_exponential,
    "matern 5/2": matern_5_2,
    "matern 3/2": matern_3_2,
}


class Lengths(NamedTuple):
    """The correlation lengths [mm] of a form: across the axis of its surface, and along it."""

    across: float
    along: float


def covariance(form: Form, lengths: Lengths, surface: AnalyticSurface, points: np.ndarray, stations: np.ndarray) -> np.ndarray:
    """Return the covariance (point, station) of points (point, 3) and stations (station, 3) [mm] of a surface."""
    decay = COVARIANCES[form.covariance]
    if form.lobes is None:
        stretch = (1 / lengths.along - 1 / lengths.across) * np.outer(surface.axis, surface.axis)
        scaled = [places / lengths.across + places @ stretch for places in (points, stations)]
        return decay(scipy.spatial.distance.cdist(*scaled))
    (arms, along), (station_arms, station_along) = (surface.around_axis(places)[1:] for places in (points, stations))
    cosines = np.einsum("pk,sk->ps", arms, station_arms)
    lobes = np.cos(form.lobes * np.arccos(cosines.clip(-1.0, 1.0)))
    return np.asarray(lobes * decay(np.abs(along[:, None] - station_along) / lengths.along))


Places = tuple[np.ndarray, np.ndarray]  # places (place, 3) [mm] of a face, and their areas (place,) as weights


def placed_twist(twist: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return displacements (6, n), tau [mm] and rho [rad], rotated by R (3, 3). A mirror reverses the sense of rotations."""
    return np.vstack([R @ twist[:3], np.sign(np.linalg.det(R)) * (R @ twist[3:])])


def displacement_terms(normals: np.ndarray, arms: np.ndarray) -> np.ndarray:
    """Return heights (place, 7) of a surface with `normals` (place, 3) for a unit growth, unit translations and rotations.

    Rotations are about the origin of `arms` (place, 3) [mm].
    """
    (x, y, z), (u, v, w) = arms.T, normals.T
    return np.column_stack([np.ones(len(arms)), normals, y * w - z * v, z * u - x * w, x * v - y * u])


@dataclass(frozen=True, eq=False)
class AssociatedSurface:
    """The analytic surface that the form of a face is measured from, as a whole.

    ends       places [mm] of the ends of the face along the axis of the surface
    is_whole   whether the face has one zone, and not several members with a zone each
    """

    name: ClassVar[str] = "surface"
    is_whole: ClassVar[bool] = True

    surface: AnalyticSurface
    ends: tuple[float, float]

    @classmethod
    def of(cls, surface: AnalyticSurface, face: Surface) -> Self:
        """Return the associated feature of a face that lies on an analytic surface."""
        return cls(surface, surface.extent(np.asarray(face.mesh.vertices)))

    def placed(self, R: np.ndarray, t: np.ndarray) -> Self:
        """Return the feature of a face in a part at R (3, 3), t (3,) [mm]."""
        return replace(self, surface=self.surface.placed(R, t))

    def places(self, face: Surface, lengths: Lengths) -> Places:
        """Return places all over a face, for a form with correlation lengths, and their areas.

        Raises GeometryFault for circles or lines of a face that does not go all the way around.
        """
        if isinstance(self.surface, Cylinder | Cone):
            return self._axial_grid(face, lengths)
        count = min(max(MIN_PLACES, face.mesh.area / (PLACE_SPACING * min(lengths)) ** 2), MAX_PLACES)
        step = float(np.sqrt(face.mesh.area / count))
        places, areas = quadrature(face.mesh, step)
        while len(places) > MAX_EXCESS * count:  # of a strip, whose triangles are divided along and across
            step *= 2
            places, areas = quadrature(face.mesh, step)
        return (self.surface.project(places) if face.curvature else places), areas

    def copies(self, points: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield factors (point,) and points (point, 3), where a function of place is summed with these factors.

        The sum is the function without the displacement of each section or line.
        """
        yield np.ones(len(points)), points

    def members(self, places: np.ndarray) -> list[np.ndarray]:
        """Return the indices of the places (place, 3) of each member that has a zone of its own."""
        return [np.arange(len(places))]

    def rows(self, places: np.ndarray) -> np.ndarray:
        """Return heights (place, freedom) at the places of a member for displacements and growths, each at most 1."""
        _, normals = self.surface.distance(places)
        arms = places - places.mean(axis=0)
        terms = displacement_terms(normals, arms / np.linalg.norm(arms, axis=1).max())[:, 1:]
        varying = terms - terms.mean(axis=0)
        directions, lengths, _ = np.linalg.svd(varying, full_matrices=False)
        directions = directions[:, lengths > MIN_LENGTH * max(lengths.max(initial=0.0), 1.0)]
        return np.column_stack([np.ones(len(places)), directions / np.abs(directions).max(axis=0)])

    def _axial_grid(self, face: Surface, lengths: Lengths) -> Places:
        """Return places on a face of a cylinder or cone, a grid of heights and azimuths, and their relative areas."""
        surface, (start, end) = self.surface, self.ends
        count = int(np.clip((end - start) / (PLACE_SPACING * lengths.along), MIN_HEIGHTS, MAX_HEIGHTS))
        heights = np.linspace(start, end, count)
        radii = heights * np.tan(surface.angle) if surface.angle else np.full(len(heights), surface.radius)
        angles, shares, u = _azimuths(surface, face, PLACE_SPACING * lengths.across / radii.max())
        outward = np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * np.cross(surface.axis, u)
        places = surface.origin + heights[:, None, None] * surface.axis + radii[:, None, None] * outward
        nearest = face.nearest(places.reshape(-1, 3))[1].reshape(places.shape)
        is_on = np.linalg.norm(nearest - places, axis=2) <= ON_FACE * face.mesh.scale + face.bulge
        goes_around = np.ptp(angles) > 2 * np.pi - MAX_FACET_ANGLE and is_on.all(axis=1).any()
        if not (self.is_whole or goes_around):
            raise GeometryFault(
                "its face does not go all the way around its axis, so that the form of its sections and lines cannot be drawn; "
                "give the tolerance form=None, and the feature keeps its shape"
            )
        areas = radii[:, None] * np.outer(_trapezoid(heights), shares)
        return places[is_on], areas[is_on]


class AssociatedCircles(AssociatedSurface):
    """The circle of each section across the axis, of a face that goes all the way around."""

    name, is_whole = "circles", False

    def copies(self, points: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield points rotated about the axis: their means, and means with a cosine, are a section's diameter and position."""
        yield np.ones(len(points)), points
        axis, arms = self.surface.axis, points - self.surface.origin
        along = (arms @ axis)[:, None] * axis
        across, sideways = arms - along, np.cross(axis, arms)
        for angle in np.arange(ROTATIONS) * 2 * np.pi / ROTATIONS:
            rotated = self.surface.origin + along + np.cos(angle) * across + np.sin(angle) * sideways
            yield np.full(len(points), -(1 + 2 * np.cos(angle)) / ROTATIONS), rotated

    def members(self, places: np.ndarray) -> list[np.ndarray]:
        return _groups_of_equal(self.surface.along(places))


class AssociatedLines(AssociatedSurface):
    """Each line of the surface in a plane through the axis, of a face that goes all the way around."""

    name, is_whole = "lines", False

    def copies(self, points: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield points along the line of each point: integrals of a function, and of it times the place, are its line."""
        yield np.ones(len(points)), points
        along, (start, end) = self.surface.along(points), self.ends
        middle, half = (start + end) / 2, (end - start) / 2
        place = (along - middle) / half
        for node, weight in zip(*np.polynomial.legendre.leggauss(NODES), strict=True):
            target = middle + half * node
            if self.surface.angle:  # a cone, whose lines go through its apex
                moved = self.surface.origin + (target / along)[:, None] * (points - self.surface.origin)
            else:
                moved = points + (target - along)[:, None] * self.surface.axis
            yield -weight * (1 + 3 * place * node) / 2, moved

    def members(self, places: np.ndarray) -> list[np.ndarray]:
        axis, arms = self.surface.axis, places - self.surface.origin
        u = arms[0] - (arms[0] @ axis) * axis
        angles = np.arctan2(arms @ np.cross(axis, u), arms @ u)
        return _groups_of_equal((angles + START) % (2 * np.pi))


def _azimuths(surface: AnalyticSurface, face: Surface, spacing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return azimuths (azimuth,) [rad] of a face, about `spacing` apart, their shares, and the unit vector (3,) at 0."""
    axis, arms = surface.axis, np.asarray(face.mesh.vertices) - surface.origin
    arms = arms - (arms @ axis)[:, None] * axis
    arms = arms[np.linalg.norm(arms, axis=1) > ON_FACE * face.mesh.scale]
    u = arms[0] / np.linalg.norm(arms[0])
    angles, gaps = azimuths(arms, u, np.cross(axis, u))
    widest = int(gaps.argmax())
    extent = 2 * np.pi - (gaps[widest] if gaps[widest] > MAX_FACET_ANGLE else 0.0)
    count = int(np.ceil(extent / (2 * np.pi) * np.clip(2 * np.pi / spacing, MIN_AZIMUTHS, MAX_AZIMUTHS)))
    if extent == 2 * np.pi:
        return np.arange(count) * extent / count, np.ones(count), u
    spaced = angles[widest] + gaps[widest] + np.linspace(0.0, extent, max(count, MIN_HEIGHTS))
    return spaced, _trapezoid(spaced), u


def _trapezoid(values: np.ndarray) -> np.ndarray:
    """Return the weights of evenly spaced values in a sum by the trapezoidal rule."""
    weights = np.full(len(values), values[1] - values[0])
    weights[[0, -1]] /= 2
    return weights


def _groups_of_equal(values: np.ndarray) -> list[np.ndarray]:
    """Return the indices of values that are equal up to rounding, for each distinct value in turn."""
    order = np.argsort(values, kind="stable")
    starts = np.flatnonzero(np.diff(values[order]) > 1e-6 * np.ptp(values)) + 1
    return [np.sort(indices) for indices in np.split(order, starts)]
