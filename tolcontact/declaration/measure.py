"""Measures: the numbers that the assembly is judged by (key characteristics)."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from tolcontact.declaration.names import is_line
from tolcontact.declaration.point import Point
from tolcontact.declaration.vectors import Vector, is_finite
from tolcontact.readable import Readable


@dataclass(frozen=True, eq=False, repr=False)
class Measure(Readable):
    """A number taken from the poses of the parts.

        of one Point                how far it moved from its nominal place, along `along` [mm]
        of a Point and `to` Point   the distance from the first to the second, along `along` [mm] (gap, flush)
        of a function               the CasADi expression that the function returns for the symbolic poses

    `tolerance` is the full width of the allowed zone, centred on the nominal value.
    """

    name: str
    of: Point | Callable[[Any], Any] | tuple[Any, ...]
    to: Point | None
    along: Vector | None
    tolerance: float | None
    units: str
    declared_at: str

    @property
    def points(self) -> tuple[Point, ...]:
        """The declared points; none for an expression."""
        return tuple(point for point in (self.of, self.to) if isinstance(point, Point))

    def faults(self) -> Iterator[str]:
        for point in self.points:
            yield from point.faults()
        if isinstance(self.of, Point):
            if self.along is None:
                yield 'a measured point needs a direction; give along="z", or a vector'
            elif not is_finite(self.along):
                yield 'along is neither "+x" to "-z" nor a nonzero vector of three finite numbers'
        elif not callable(self.of) and not isinstance(self.of, tuple):
            yield f"it measures a {type(self.of).__name__}; expected part.point(x, y, z) or a function of the poses"
        elif self.along is not None or self.to is not None:
            yield "a function of the poses defines its measure by itself; leave out to and along"
        if not (self.units and is_line(self.units)):
            yield (
                f'units is {self.units!r}; expected a text such as "mm", "rad", or "1" for a pure number, '
                "without control characters"
            )
        if self.to is not None and not isinstance(self.to, Point):
            yield f"to is a {type(self.to).__name__}; expected part.point(x, y, z)"
        if self.tolerance is not None and not (
            isinstance(self.tolerance, int | float) and math.isfinite(self.tolerance) and self.tolerance > 0
        ):
            yield f"tolerance is {self.tolerance!r}; expected the full width of the allowed zone, above 0"

    def __str__(self) -> str:
        along = "" if self.along is None else " along ({:g}, {:g}, {:g})".format(*self.along)
        if self.to is not None:
            what = f"distance {self.of} to {self.to}{along}"
        else:
            what = f"{self.of}{along}" if isinstance(self.of, Point) else "expression of the poses"
        limits = "" if self.tolerance is None else f", tolerance {self.tolerance:g} {self.units}"
        return f"measure {self.name}: {what}{limits}"
