"""Contact points of round faces: a ball or shaft of one part against a wall of the other. Nominal assembly frame, mm.

A ball touches where its centre is nearest to the wall, a shaft at the rim of one of its ends or of an end of the wall. These
points are computed at every pose from a few numbers, so they are exact; none is sampled.
"""

import math
import pickle
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from tolcontact.geometry.analytic_surfaces import (
    AnalyticSurface,
    Cone,
    Cylinder,
    Plane,
    RoundSurface,
    Sphere,
    axes_across,
    azimuths,
    surface_arrays,
    surfaces_of,
)
from tolcontact.geometry.surface import Piece
from tolcontact.geometry.tolerances import SAME_PLACE

TANGENTS = 5  # of a whole hollow wall, in addition to the nearest point
MAX_FACET_ANGLE = math.radians(31.0)  # between neighbouring vertices of a round face: a wider gap is a gap of the face
MAX_MISSING_SHARE = 0.05  # of the area of a round face that its triangles leave out
CAP_SHARE = 0.9  # of the angle to the rim of a cap, at which its tangent planes are
NO_DIRECTION = np.zeros(3)
X_AXIS = np.array([1.0, 0.0, 0.0])


class NotRoundError(Exception):
    """Two faces do not touch as a ball or a shaft and walls do."""


def arc(wall: Piece) -> tuple[np.ndarray, float]:
    """Return the unit vector (3,) from the axis to the centre of a round face, and half its arc's angle [rad], pi if whole.

    Raises NotRoundError if a part of the face is missing within the arc.
    """
    if isinstance(wall.surface, Sphere):
        return _cap(wall, wall.surface)
    vertices, axis = wall.face.vertices, wall.surface.axis
    across = vertices - wall.surface.origin
    across -= (across @ axis)[:, None] * axis
    across = across[np.linalg.norm(across, axis=1) > SAME_PLACE * wall.face.mesh.scale]
    if isinstance(wall.surface, Plane) or not len(across):
        return axes_across(axis)[0], math.pi
    x = across[0] / np.linalg.norm(across[0])
    y = np.cross(axis, x)
    angles, gaps = azimuths(across, x, y)
    if (gaps > MAX_FACET_ANGLE).sum() > 1:
        raise NotRoundError
    widest = int(gaps.argmax())
    if gaps[widest] < MAX_FACET_ANGLE:
        middle, opening = x, math.pi
    else:
        opening = math.pi - float(gaps[widest]) / 2
        azimuth = float(angles[widest] + gaps[widest]) + opening
        middle = math.cos(azimuth) * x + math.sin(azimuth) * y
    _check_area(wall, opening)
    return middle, opening


def _check_area(wall: Piece, opening: float) -> None:
    """Raise NotRoundError if a cylinder or cone has less area than its whole arc from end to end of its axis."""
    along = wall.surface.along(wall.face.vertices)
    if isinstance(wall.surface, Cylinder):
        expected = 2 * opening * wall.surface.radius * float(np.ptp(along))
    elif isinstance(wall.surface, Cone):
        slants = along / math.cos(wall.surface.angle)
        expected = opening * math.sin(wall.surface.angle) * abs(float(slants.max() ** 2 - slants.min() ** 2))
    else:
        return
    if wall.face.mesh.area < (1 - MAX_MISSING_SHARE) * expected:
        raise NotRoundError


def _cap(wall: Piece, sphere: Sphere) -> tuple[np.ndarray, float]:
    """Return the unit vector (3,) from the centre to the middle of a cap, and the angle [rad] to its rim; pi if whole."""
    mesh = wall.face.mesh
    outward = (np.asarray(mesh.vertices) - sphere.origin) / sphere.radius
    middle = (np.asarray(mesh.area_faces)[:, None] * (np.asarray(mesh.triangles_center) - sphere.origin)).sum(axis=0)
    if np.linalg.norm(middle) < MAX_MISSING_SHARE * mesh.area * sphere.radius:
        middle, opening = outward[0], math.pi
    else:
        middle /= np.linalg.norm(middle)
        opening = math.acos(min(max(float((outward @ middle).min()), -1.0), 1.0))
    if mesh.area < (1 - MAX_MISSING_SHARE) * 2 * math.pi * sphere.radius**2 * (1 - math.cos(opening)):
        raise NotRoundError
    return middle, opening


def tangent_directions(wall: Piece) -> Sequence[np.ndarray]:
    """Return unit vectors (3,) from the axis to the tangent planes of a hollow wall.

    They start from a vertex, so they rotate with the part.
    """
    x, opening = arc(wall)
    if isinstance(wall.surface, Sphere):
        y, z = _directions_across(wall, x)
        tilt, angles = min(CAP_SHARE * opening, math.pi / 2), np.arange(TANGENTS - 1) * 2 * math.pi / (TANGENTS - 1)
        sideways = [math.cos(azimuth) * y + math.sin(azimuth) * z for azimuth in angles]
        directions = [x, *(math.cos(tilt) * x + math.sin(tilt) * across for across in sideways)]
        return [*directions, -x] if opening == math.pi else directions
    y = np.cross(wall.surface.axis, x)
    if opening == math.pi:
        angles = np.arange(TANGENTS) * 2 * math.pi / TANGENTS
    else:
        angles = np.linspace(-opening, opening, max(math.ceil(opening / math.pi * TANGENTS), 1) + 1)
    return [math.cos(azimuth) * x + math.sin(azimuth) * y for azimuth in angles]


def _directions_across(wall: Piece, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors across x (3,) and each other; the first towards the vertex most distant from x."""
    across = wall.face.vertices - wall.surface.origin
    across -= (across @ x)[:, None] * x
    y = across[np.linalg.norm(across, axis=1).argmax()]
    y /= np.linalg.norm(y)
    return y, np.cross(x, y)


@dataclass(frozen=True, eq=False)
class RoundPoint:
    """A wall, and a ball or the point on a shaft's axis where the shaft or the wall ends.

    wall        the surface that the ball or shaft may touch
    is_hollow   whether the wall is around the ball or shaft: the free side of the surface is inside
    centre      (3,) [mm] of the ball, or the point on the axis
    axis        (3,) unit vector of the shaft; 0 for a ball
    cut         (3,) unit normal of the plane where the wall ends, which moves with the wall; 0 where the shaft itself ends
    radius      [mm] of the ball or shaft
    on_moving   whether the ball or shaft belongs to the moving part; else the wall does
    towards     (3,) unit vector from the axis of a hollow cylinder or cone to the centre of its arc
    opening     [rad] half the angle of that arc; pi if it is whole
    """

    wall: AnalyticSurface
    is_hollow: bool
    centre: np.ndarray
    axis: np.ndarray
    cut: np.ndarray
    radius: float
    on_moving: bool
    towards: np.ndarray = field(default_factory=lambda: X_AXIS)
    opening: float = math.pi

    def tangents(self, directions: Sequence[np.ndarray]) -> "list[RoundPoint]":
        """Return points like this one at the tangent planes of its hollow wall in some directions (3,)."""
        assert isinstance(self.wall, RoundSurface)
        planes = [self.wall.tangent(direction) for direction in directions]
        return [replace(self, wall=plane, is_hollow=False, towards=X_AXIS, opening=math.pi) for plane in planes]

    def nominal(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return P^m, P^r and n^r (3,): the nominal points of contact and the reference's normal.

        In a hollow wall no direction is nearest, so both points are the centre.
        """
        distances, slopes = self.wall.distance(self.centre[None])
        distance, slope = distances[0], slopes[0]
        n = slope if np.linalg.norm(slope) > 0.5 and not self.is_hollow else -self.towards
        on_body, on_wall = self.centre - self.radius * n, self.centre - distance * n
        if self.is_hollow:
            on_body = on_wall = self.centre
        return (on_body, on_wall, n) if self.on_moving else (on_wall, on_body, -n)

    def curvature(self, *, of_moving: bool) -> tuple[np.ndarray, float]:
        """Return the centre of curvature (3,) and its radius [mm] of one of the faces, at the nominal contact point.

        A plane is replaced by a sphere around the contact point that is as large as the ball or shaft.
        """
        if of_moving == self.on_moving:
            return self.centre, self.radius
        on_wall = self.nominal()[0 if of_moving else 1]
        if isinstance(self.wall, Plane):
            return on_wall, self.radius
        offset = on_wall - self.wall.origin
        if isinstance(self.wall, Cylinder | Cone):  # whose origin is anywhere on the axis
            offset = offset - float(offset @ self.wall.axis) * self.wall.axis
        return on_wall - offset, float(np.linalg.norm(offset))


@dataclass(frozen=True, eq=False)
class RoundPoints:
    """The points of a pair as arrays (point, ...) by name: `walls` for their surfaces, `points` for the rest."""

    walls: Mapping[str, np.ndarray]
    points: Mapping[str, np.ndarray]

    def __len__(self) -> int:
        return len(self.points["radius"])

    @classmethod
    def of(cls, points: Sequence[RoundPoint]) -> "RoundPoints":
        """Return points as arrays."""
        names = [entry.name for entry in fields(RoundPoint) if entry.name != "wall"]
        arrays = {name: np.array([getattr(point, name) for point in points]) for name in names}
        return cls(surface_arrays([point.wall for point in points]), arrays)

    @property
    def fingerprint(self) -> tuple[bytes, ...]:
        """All numbers of the points: points with the same fingerprint have the same equations."""
        return tuple(pickle.dumps(point) for point in self)

    @property
    def are_beside(self) -> bool:
        """Whether no wall surrounds its ball or shaft."""
        return not bool(self.points["is_hollow"].any())

    def __iter__(self) -> Iterator[RoundPoint]:
        for k, wall in enumerate(surfaces_of(self.walls)):
            assert wall is not None
            yield RoundPoint(wall, **{name: values[k] for name, values in self.points.items()})
