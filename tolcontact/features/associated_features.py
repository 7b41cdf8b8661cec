"""What form deviations are measured from: an associated surface, or the circles or the lines of a surface (ISO 17450).

A flatness or a cylindricity limits a face as a whole, beside displacements and sizes of its surface. A roundness limits each
section, beside its place and diameter, and a straightness each line, beside its place and slope.
"""

from abc import ABC
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from tolcontact.errors import GeometryFault
from tolcontact.features.axial_grid import PLACE_SPACING, AxialGrid
from tolcontact.features.covariances import Lengths
from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Cone, Cylinder
from tolcontact.geometry.surface import Surface
from tolcontact.geometry.triangle_mesh import quadrature

MIN_PLACES, MAX_PLACES = 600, 20_000  # of a face, over which areas are summed
MAX_EXCESS = 8  # times the intended number of places
ROTATIONS = 32  # by which a section's place and diameter are known, exactly for fewer lobes
NODES = 16  # of a line
MIN_LENGTH = 1e-9  # of a displacement, relative to the largest
START = 0.01  # rad before the first line, where no other line is: azimuths are counted from here
TERMS = 7  # of the displacement of a surface: its growth, then a translation and a rotation

Places = tuple[np.ndarray, np.ndarray]  # places (place, 3) [mm] of a face, and the areas (place,) that they stand for


def displacement_terms(normals: np.ndarray, arms: np.ndarray) -> np.ndarray:
    """Return heights (place, 7) of a surface with `normals` (place, 3) for a growth, translations and turns of 1.

    Turns are about the point from which `arms` (place, 3) [mm] are counted.
    """
    (x, y, z), (u, v, w) = arms.T, normals.T
    return np.column_stack([np.ones(len(arms)), normals, y * w - z * v, z * u - x * w, x * v - y * u])


@dataclass(frozen=True, eq=False)
class AssociatedFeature(ABC):
    """What the form of a face on an analytic surface is measured from.

    ends       places [mm] of the ends of the face along the axis of the surface
    is_whole   whether it is the whole surface, and not several members of it
    """

    name: ClassVar[str]
    is_whole: ClassVar[bool] = False

    surface: AnalyticSurface
    ends: tuple[float, float]

    @classmethod
    def of(cls, surface: AnalyticSurface, face: Surface) -> Self:
        """Return the associated feature of a face that lies on an analytic surface."""
        along = (np.asarray(face.mesh.vertices) - surface.origin) @ surface.axis
        return cls(surface, (float(along.min()), float(along.max())))

    def placed(self, R: np.ndarray, t: np.ndarray) -> Self:
        """Return the feature of a face that stands at R (3, 3), t (3,) [mm]."""
        return replace(self, surface=self.surface.placed(R, t))

    def places(self, face: Surface, lengths: Lengths) -> Places:
        """Return places all over a face, for a form with correlation lengths, and their areas."""
        if isinstance(self.surface, Cylinder | Cone):
            grid = AxialGrid.of(self.surface, self.ends, face, lengths)
            return grid.places[grid.is_on], grid.areas[grid.is_on]
        count = min(max(MIN_PLACES, face.mesh.area / (PLACE_SPACING * min(lengths)) ** 2), MAX_PLACES)
        step = float(np.sqrt(face.mesh.area / count))
        places, areas = quadrature(face.mesh, step)
        while len(places) > MAX_EXCESS * count:  # of a strip, whose triangles are divided along and across
            step *= 2
            places, areas = quadrature(face.mesh, step)
        return (self.surface.project(places) if face.curvature else places), areas

    def copies(self, points: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield points (point, 3), and the factors (point,) with which a function of place is summed over them.

        The sum is the function without what displaces each section or line.
        """
        yield np.ones(len(points)), points

    def members(self, places: np.ndarray) -> list[np.ndarray]:
        """Return the numbers of the places (place, 3) of each member that has a zone of its own."""
        return [np.arange(len(places))]

    def rows(self, places: np.ndarray) -> np.ndarray:
        """Return heights (place, freedom) at the places of a member of displacements and growths, each at most 1."""
        _, normals = self.surface.distance(places)
        arms = places - places.mean(axis=0)
        terms = displacement_terms(normals, arms / np.linalg.norm(arms, axis=1).max())[:, 1:]
        varying = terms - terms.mean(axis=0)
        directions, lengths, _ = np.linalg.svd(varying, full_matrices=False)
        directions = directions[:, lengths > MIN_LENGTH * max(lengths.max(initial=0.0), 1.0)]
        return np.column_stack([np.ones(len(places)), directions / np.abs(directions).max(axis=0)])


class AssociatedSurface(AssociatedFeature):
    """The surface as a whole."""

    name, is_whole = "surface", True


class AxialFeature(AssociatedFeature):
    """Circles around an axis, or lines along it, of a face that goes all the way around. Places are a grid on the face."""

    def places(self, face: Surface, lengths: Lengths) -> Places:
        grid = AxialGrid.of(self.surface, self.ends, face, lengths)
        if not grid.is_whole:
            raise GeometryFault(
                "its face does not go all the way around its axis, so that the form of its sections and lines cannot be drawn; "
                "give the tolerance form=None, and the feature keeps its shape"
            )
        return grid.places[grid.is_on], grid.areas[grid.is_on]

    def _along(self, points: np.ndarray) -> np.ndarray:
        """Return the places (point,) [mm] of points (point, 3) along the axis."""
        return (points - self.surface.origin) @ self.surface.axis


class AssociatedCircles(AxialFeature):
    """The circle of each section across the axis."""

    name = "circles"

    def copies(self, points: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield points turned about the axis: their means, and means with a cosine, are a section's diameter and place."""
        yield np.ones(len(points)), points
        axis, arms = self.surface.axis, points - self.surface.origin
        along = (arms @ axis)[:, None] * axis
        across, sideways = arms - along, np.cross(axis, arms)
        for turn in np.arange(ROTATIONS) * 2 * np.pi / ROTATIONS:
            turned = self.surface.origin + along + np.cos(turn) * across + np.sin(turn) * sideways
            yield np.full(len(points), -(1 + 2 * np.cos(turn)) / ROTATIONS), turned

    def members(self, places: np.ndarray) -> list[np.ndarray]:
        return _alike(self._along(places))


class AssociatedLines(AxialFeature):
    """Each line of the surface in a plane through the axis."""

    name = "lines"

    def copies(self, points: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield points along the line of each point: integrals of a function, and of it times the place, are its line."""
        yield np.ones(len(points)), points
        along, (start, end) = self._along(points), self.ends
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
        azimuths = np.arctan2(arms @ np.cross(axis, u), arms @ u)
        return _alike((azimuths + START) % (2 * np.pi))


def _alike(values: np.ndarray) -> list[np.ndarray]:
    """Return the numbers of values that are equal but for rounding, for each such value in turn."""
    order = np.argsort(values, kind="stable")
    starts = np.flatnonzero(np.diff(values[order]) > 1e-6 * np.ptp(values)) + 1
    return [np.sort(numbers) for numbers in np.split(order, starts)]


ASSOCIATED: Mapping[str, type[AssociatedFeature]] = {
    kind.name: kind for kind in (AssociatedSurface, AssociatedCircles, AssociatedLines)
}
