"""Contact points of round faces: a ball or a shaft of one part beside a wall of the other. Nominal assembly frame, mm.

A ball touches where its centre is nearest to the wall, a shaft at the rim of one of its ends or of an end of the wall. These
points are computed at every pose from a few numbers. They are exact; no point is sampled.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np

from tolcontact.geometry.analytic_surfaces import AnalyticSurface, surface_arrays, surfaces_of
from tolcontact.geometry.surface import Piece

NO_DIRECTION = np.zeros(3)
X_AXIS = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True, eq=False)
class RoundPoint:
    """A wall, and a ball or the place on a shaft's axis where the shaft or the wall ends.

    wall        the surface that the ball or shaft may touch
    is_hollow   whether the wall is around the ball or shaft: the free side of the surface is inside
    centre      (3,) [mm] of the ball, or the place on the axis
    axis        (3,) unit vector of the shaft; 0 for a ball
    cut         (3,) unit normal of the plane in which the wall ends, which moves with the wall; 0 where the shaft itself ends
    radius      [mm] of the ball or shaft
    on_moving   whether the ball or shaft belongs to the moving part; else the wall does
    towards     (3,) unit vector from the axis of a hollow cylinder or cone to the middle of its arc
    opening     [rad] half the angle of that arc; pi if it is whole
    """

    wall: AnalyticSurface
    is_hollow: bool
    centre: np.ndarray
    axis: np.ndarray
    cut: np.ndarray
    radius: float
    on_moving: bool
    towards: np.ndarray
    opening: float

    @classmethod
    def ball(
        cls, wall: Piece, ball: AnalyticSurface, on_moving: bool, towards: np.ndarray = X_AXIS, opening: float = math.pi
    ) -> "RoundPoint":
        """Return the point of a ball."""
        axis = cut = NO_DIRECTION
        return cls(wall.surface, wall.is_hollow, ball.origin, axis, cut, ball.radius, on_moving, towards, opening)

    @classmethod
    def end(
        cls,
        wall: Piece,
        shaft: AnalyticSurface,
        place: float,
        cut: np.ndarray,
        on_moving: bool,
        towards: np.ndarray = X_AXIS,
        opening: float = math.pi,
    ) -> "RoundPoint":
        """Return the point of a shaft at a place [mm] on its axis."""
        centre = shaft.origin + place * shaft.axis
        return cls(wall.surface, wall.is_hollow, centre, shaft.axis, cut, shaft.radius, on_moving, towards, opening)

    def nominal(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return P^m, P^r and n^r (3,): the nominal points of contact and the reference's normal.

        In a hollow wall no side is nearest, so both points are the centre.
        """
        distances, slopes = self.wall.distance(self.centre[None])
        distance, slope = distances[0], slopes[0]
        n = slope if np.linalg.norm(slope) > 0.5 and not self.is_hollow else -self.towards
        on_body, on_wall = self.centre - self.radius * n, self.centre - distance * n
        if self.is_hollow:
            on_body = on_wall = self.centre
        return (on_body, on_wall, n) if self.on_moving else (on_wall, on_body, -n)


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
        names = [field.name for field in fields(RoundPoint) if field.name != "wall"]
        arrays = {name: np.array([getattr(point, name) for point in points]) for name in names}
        return cls(surface_arrays([point.wall for point in points]), arrays)

    def __iter__(self) -> Iterator[RoundPoint]:
        for k, wall in enumerate(surfaces_of(self.walls)):
            assert wall is not None
            yield RoundPoint(wall, **{name: values[k] for name, values in self.points.items()})
