"""Contact points of round faces: a ball or a shaft of one part beside a wall of the other. Nominal assembly frame, mm.

A ball touches where its centre is nearest to the wall, a shaft where the rim of one of its ends, or of the wall's, is: points
that are found anew at every pose, from few numbers. What touches is exact; nothing is sampled.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields

import numpy as np

from tolcontact.geometry.analytic_surfaces import AnalyticSurface, surface_arrays, surfaces_of
from tolcontact.geometry.surface import Piece

NONE = np.zeros(3)


@dataclass(frozen=True, eq=False)
class RoundPoint:
    """A ball, or the place of a shaft's axis where it or the wall ends, and the wall.

    wall        the surface that it may touch
    is_hollow   whether the wall is around it: the free side of the surface is inside
    centre      (3,) of the ball, or that place
    axis        (3,) unit vector of the shaft; 0 of a ball
    cut         (3,) unit normal of the plane in which the wall ends, with which it moves; 0 where the shaft itself ends
    radius      of the ball or shaft
    on_moving   whether the ball or shaft belongs to the moving part; else the wall does
    towards     (3,) unit vector to the middle of a hollow cylinder or cone, seen from its axis, and
    opening     [rad] how far it reaches to either side of that; pi of a whole one
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
        cls, wall: Piece, ball: AnalyticSurface, on_moving: bool, towards: np.ndarray | None = None, opening: float = math.pi
    ) -> "RoundPoint":
        """That of a ball."""
        return cls(wall.surface, wall.is_hollow, ball.origin, NONE, NONE, ball.radius, on_moving, _or_x(towards), opening)

    @classmethod
    def end(
        cls,
        wall: Piece,
        shaft: AnalyticSurface,
        place: float,
        cut: np.ndarray,
        on_moving: bool,
        towards: np.ndarray | None = None,
        opening: float = math.pi,
    ) -> "RoundPoint":
        """That of a shaft, at a place [mm] of its axis."""
        centre = shaft.origin + place * shaft.axis
        return cls(wall.surface, wall.is_hollow, centre, shaft.axis, cut, shaft.radius, on_moving, _or_x(towards), opening)

    def nominal(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """P^m, P^r and n^r (3,): where the two touch nominally, and the reference's normal; in a hollow wall its axis' place.

        A ball or shaft in a hollow wall touches on no side more than on others.
        """
        side = -1.0 if self.is_hollow else 1.0
        distance, slope = (each[0] for each in self.wall.distance(self.centre[None]))
        n = side * slope if np.linalg.norm(slope) > 0.5 and not self.is_hollow else -self.towards
        touching = self.centre - self.radius * n, self.centre - distance * n
        if self.is_hollow:
            touching = self.centre, self.centre
        return (*touching, n) if self.on_moving else (touching[1], touching[0], -n)


def _or_x(towards: np.ndarray | None) -> np.ndarray:
    return np.array([1.0, 0.0, 0.0]) if towards is None else towards


@dataclass(frozen=True, eq=False)
class RoundPoints:
    """The points of a pair as arrays (point, ...), by name: `walls` what their surfaces are, `points` the rest."""

    walls: Mapping[str, np.ndarray]
    points: Mapping[str, np.ndarray]

    def __len__(self) -> int:
        return len(self.points["radius"])

    @classmethod
    def of(cls, points: Sequence[RoundPoint]) -> "RoundPoints":
        """The arrays of some points."""
        own = [field.name for field in fields(RoundPoint) if field.name != "wall"]
        return cls(
            surface_arrays([point.wall for point in points]),
            {name: np.array([getattr(p, name) for p in points]) for name in own},
        )

    def __iter__(self) -> Iterator[RoundPoint]:
        for k, wall in enumerate(surfaces_of(self.walls)):
            assert wall is not None
            yield RoundPoint(wall, **{name: values[k] for name, values in self.points.items()})
