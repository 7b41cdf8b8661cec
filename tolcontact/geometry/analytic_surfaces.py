"""Analytic surfaces: planes, cylinders, cones, spheres and tori, in double precision. Lengths in mm.

Each kind is a class, which `ANALYTIC_SURFACES` lists by the kind's name.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np

from tolcontact.geometry.tolerances import PARALLEL
from tolcontact.vocabulary import SURFACE_KINDS

PROJECTIONS = 2  # one is exact except for rounding


@dataclass(frozen=True, eq=False)
class AnalyticSurface(ABC):
    """An unbounded surface. A size that its kind does not have is 0.

    origin     a point of a plane or of the axis (3,) [mm]: the apex of a cone, the centre of a sphere or torus
    axis       normal of a plane, or unit vector along the axis (3,), from the apex into a cone; meaningless for a sphere
    residual   [mm] largest distance of the fitted vertices
    is_fitted  whether it was fitted; otherwise a file states it
    """

    kind: ClassVar[str]
    sizes: ClassVar[tuple[str, ...]] = ()  # the names of its sizes
    radius = 0.0
    minor = 0.0
    angle = 0.0

    origin: np.ndarray
    axis: np.ndarray
    residual: float = field(default=0.0, kw_only=True)
    is_fitted: bool = field(default=False, kw_only=True)

    @classmethod
    def of(cls, numbers: Mapping[str, Any]) -> Self:
        """Return the surface from its origin, axis and sizes by name; sizes that its kind does not have are ignored."""
        return cls(**{name: numbers[name] for name in ("origin", "axis", *cls.sizes)})

    @abstractmethod
    def height(self, radial: Any, along: Any) -> Any:
        """Return the signed distance [mm] of a point from the surface, positive in front of a plane or outside.

        radial  distance [mm] from the centre of a sphere, the axis of a cylinder or cone, or the circle inside a torus
        along   height [mm] over a plane, or coordinate along the axis of a cone, from its apex

        Numbers, NumPy arrays and CasADi expressions are all accepted.
        """

    def height_beside_axis(self, radial: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Return `distance` [mm] at radial distances from the axis and at coordinates along it, from the origin [mm]."""
        return np.asarray(self.height(radial, along))

    @abstractmethod
    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return signed distances (point,) [mm] of `points` (point, 3) [mm], and their gradients (point, 3), unit vectors.

        Where the nearest point is not unique (on an axis) the gradient is 0.
        """

    def placed(self, R: np.ndarray, t: np.ndarray) -> Self:
        """Return the surface rotated by R (3, 3), then translated by t (3,) [mm]."""
        return replace(self, origin=R @ self.origin + t, axis=R @ self.axis)

    def project(self, points: np.ndarray) -> np.ndarray:
        """Return the points of the surface (point, 3) [mm] nearest to `points` (point, 3) [mm]."""
        for _ in range(PROJECTIONS):
            value, slope = self.distance(points)
            points = points - value[:, None] * slope
        return points

    def along(self, points: np.ndarray) -> np.ndarray:
        """Return the coordinates (point,) [mm] of points (point, 3) along the axis, from the origin."""
        return np.asarray((points - self.origin) @ self.axis)

    def extent(self, points: np.ndarray) -> tuple[float, float]:
        """Return the smallest and the largest coordinate [mm] of points (point, 3) along the axis, from the origin."""
        along = self.along(points)
        return float(along.min()), float(along.max())

    def around_axis(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return distances (point,) from the axis, unit vectors (point, 3) away from it, and coordinates (point,) along it."""
        offset = points - self.origin
        along = offset @ self.axis
        return *_length_and_direction(offset - along[:, None] * self.axis), along


class RoundSurface(AnalyticSurface):
    """A surface with tangent planes all around its hollow side: a cylinder, cone or sphere."""

    def tangent(self, direction: np.ndarray) -> "Plane":
        """Return the tangent plane in a direction (3,) from the axis or centre; its normal points inward."""
        return Plane(self.origin + self.radius * direction, -direction)

    @abstractmethod
    def touched(self, point: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Return the surface point (3,) nearest to a point (3,) in a direction (3,) from the axis or centre."""


@dataclass(frozen=True, eq=False)
class Plane(AnalyticSurface):
    """A plane; its axis is its normal."""

    kind = "plane"

    def height(self, radial: Any, along: Any) -> Any:
        """Return the height over the plane [mm]."""
        return along

    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return heights (point,) [mm] over the plane, and its normal (point, 3)."""
        return (points - self.origin) @ self.axis, np.broadcast_to(self.axis, points.shape)


@dataclass(frozen=True, eq=False)
class Cylinder(RoundSurface):
    """A cylinder with a `radius` [mm]."""

    kind, sizes = "cylinder", ("radius",)
    radius: float

    def height(self, radial: Any, along: Any) -> Any:
        """Return the signed distance [mm] from the cylinder."""
        return radial - self.radius

    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return signed distances (point,) [mm], and their gradients (point, 3)."""
        radial, outward, along = self.around_axis(points)
        return self.height(radial, along), outward

    def touched(self, point: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Return the nearest point of the generator in a direction from the axis."""
        return self.origin + ((point - self.origin) @ self.axis) * self.axis + self.radius * direction


@dataclass(frozen=True, eq=False)
class Cone(RoundSurface):
    """A cone with an `angle` [rad] between its axis and its surface."""

    kind, sizes = "cone", ("angle",)
    angle: float

    def height(self, radial: Any, along: Any) -> Any:
        """Return the signed distance [mm] from the nappe on the side of the axis."""
        return radial * np.cos(self.angle) - along * np.sin(self.angle)

    def height_beside_axis(self, radial: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Return signed distances [mm]."""
        return self.height(radial, np.abs(along))

    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return signed distances (point,) [mm] from the nearer nappe, and their gradients (point, 3)."""
        radial, outward, along = self.around_axis(points)
        side = np.where(along < 0, -1.0, 1.0)  # the nappes meet in one line through the apex
        slope = np.cos(self.angle) * outward - (side * np.sin(self.angle))[:, None] * self.axis
        return self.height(radial, side * along), slope

    def tangent(self, direction: np.ndarray) -> Plane:
        """Return the tangent plane in a direction (3,) from the axis; its normal points inward."""
        return Plane(self.origin, math.sin(self.angle) * self.axis - math.cos(self.angle) * direction)

    def touched(self, point: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Return the nearest point of the generator in a direction from the axis."""
        line = math.cos(self.angle) * self.axis + math.sin(self.angle) * direction
        return self.origin + ((point - self.origin) @ line) * line


@dataclass(frozen=True, eq=False)
class Sphere(RoundSurface):
    """A sphere with a `radius` [mm]."""

    kind, sizes = "sphere", ("radius",)
    radius: float

    def height(self, radial: Any, along: Any) -> Any:
        """Return the signed distance [mm] from the sphere."""
        return radial - self.radius

    def height_beside_axis(self, radial: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Return signed distances [mm]."""
        return self.height(np.hypot(radial, along), along)

    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return signed distances (point,) [mm], and their gradients (point, 3)."""
        radial, outward = _length_and_direction(points - self.origin)
        return self.height(radial, 0.0), outward

    def touched(self, point: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """Return the surface point in a direction from the centre."""
        return self.origin + self.radius * direction


@dataclass(frozen=True, eq=False)
class Torus(AnalyticSurface):
    """A torus: a tube with the radius `minor` [mm] along a circle of `radius` [mm] around the axis."""

    kind, sizes = "torus", ("radius", "minor")
    radius: float
    minor: float

    def height(self, radial: Any, along: Any) -> Any:
        """Return the signed distance [mm] from the tube."""
        return radial - self.minor

    def from_circle(self, radial: Any, outward: Any, along: Any, axis: Any) -> Any:
        """Return the vector from the circle to a point, given by its coordinate `along` the axis and distance `radial` from it.

        `outward` is the unit vector from the axis to the point. Arrays and CasADi expressions are both accepted.
        """
        return (radial - self.radius) * outward + along * axis

    def height_beside_axis(self, radial: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Return signed distances [mm]."""
        return self.height(np.hypot(radial - self.radius, along), along)

    def distance(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return signed distances (point,) [mm], and their gradients (point, 3)."""
        radial, outward, along = self.around_axis(points)
        tube, slope = _length_and_direction(self.from_circle(radial[:, None], outward, along[:, None], self.axis))
        return self.height(tube, along), slope


def axes_across(direction: np.ndarray) -> np.ndarray:
    """Return two unit vectors (2, 3) perpendicular to a direction (3,) and to each other."""
    return np.asarray(np.linalg.svd(direction[None])[2][1:])


def are_opposed(normal: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two unit normals (3,) are of planes in opposite directions."""
    return bool(np.linalg.norm(normal + other) < PARALLEL)


def azimuths(offsets: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the sorted azimuths (point,) [rad] of offsets (point, 3), from x (3,) to y (3,), and the gaps after them."""
    angles = np.sort(np.arctan2(offsets @ y, offsets @ x))
    return angles, np.diff(angles, append=angles[0] + 2 * np.pi)


ANALYTIC_SURFACES: dict[str, type[AnalyticSurface]] = {
    surface.kind: surface for surface in (Plane, Cylinder, Cone, Sphere, Torus)
}
_NUMBERS = ("origin", "axis", "radius", "minor", "angle")


def surface_arrays(surfaces: Sequence[AnalyticSurface | None]) -> dict[str, np.ndarray]:
    """Return surfaces as arrays (surface, ...) by name, as stored in archives.

    `kind` is the index in SURFACE_KINDS, or -1 for None.
    """
    filled = [surface or Plane(np.zeros(3), np.zeros(3)) for surface in surfaces]
    kinds = np.array([-1 if surface is None else SURFACE_KINDS.index(surface.kind) for surface in surfaces])
    return {"kind": kinds} | {name: np.array([getattr(surface, name) for surface in filled]) for name in _NUMBERS}


def surfaces_of(arrays: Mapping[str, np.ndarray]) -> list[AnalyticSurface | None]:
    """Return the surfaces that `surface_arrays` wrote."""
    return [
        None if kind < 0 else ANALYTIC_SURFACES[SURFACE_KINDS[kind]].of({name: arrays[name][number] for name in _NUMBERS})
        for number, kind in enumerate(arrays["kind"])
    ]


def _length_and_direction(vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    length = np.linalg.norm(vectors, axis=1)
    return length, vectors / np.maximum(length, 1e-300)[:, None]
