"""Measures: the numbers that the assembly is judged by (key characteristics).

A user's expression is kept as a tape: a list of elementary steps, which an archive can hold without code. A tape is a tuple of
rows (operation, operands...): "input" with an index into the pose entries of all parts and the deviations that follow, "const"
with a number, or the name of a CasADi operation with the positions of earlier rows. The last row is the value.
"""

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from tolcontact.declaration.checks import TRUTH, Declaration, direction_faults
from tolcontact.declaration.codec import Place
from tolcontact.declaration.geometry import UNITS
from tolcontact.declaration.measurement import Measurement
from tolcontact.declaration.part import Part, Point
from tolcontact.declaration.values import Vector, is_length, is_line
from tolcontact.declaration.written_tolerance import Deviations, TextFault, text_fault, written
from tolcontact.tables import MAX_NUMBER

_KINDS: dict[str, dict[str, float]] = {"mm": UNITS, "rad": {"deg": math.pi / 180, "mrad": 1e-3}}


@dataclass(frozen=True, eq=False, repr=False)
class Measure(Declaration):
    """A number that follows from the poses of the parts.

        of one Point                its displacement from its nominal place, along `along` [mm]; its coordinate, if `absolute`
        of a Point and `to` Point   the distance from the first to the second, along `along` [mm] (gap, flush); its deviation
                                    from the nominal distance, if `absolute` is False
        of a Measurement            its value, such as a gap, an angle or the least of several measures [mm, rad]
        of a function               the CasADi expression that the function returns for the symbolic poses

    `limits` are the smallest and the largest allowed value; None leaves a side open. `tolerance` is short for limits around the
    nominal value: at half of a number below and above it, or at deviations such as "±0.1", "+0.1/-0.05" or (-0.05, 0.1). All of
    these, and the values, are in `units`: "in", "um", ... for lengths, and "deg" for angles; of a function, what it returns.
    """

    name: str
    of: Point | Measurement | Callable[[Any], Any] | tuple[Any, ...]
    to: Point | None = None
    along: Vector | None = None
    tolerance: float | Deviations | None = None  # a text or another pair only if it is no tolerance
    units: str = "mm"
    declared_at: str = ""
    absolute: bool | None = None
    limits: tuple[float | None, float | None] | None = None
    station: str = ""
    noun: ClassVar[str] = "measurement"
    checks: ClassVar = {"absolute": TRUTH}

    def __post_init__(self) -> None:
        with contextlib.suppress(TextFault):  # faults() reports it
            value = written(self.tolerance, units=self.units)
            is_symmetric = isinstance(value, Deviations) and not value.middle
            object.__setattr__(self, "tolerance", value.width if is_symmetric else value)

    @property
    def points(self) -> tuple[Point, ...]:
        """The declared points; empty for an expression."""
        return tuple(point for point in (self.of, self.to) if isinstance(point, Point))

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts that are measured; none for an expression."""
        return self.of.parts if isinstance(self.of, Measurement) else tuple(point.part for point in self.points)

    @property
    def is_expression(self) -> bool:
        """Whether the measure is a user's own expression of the poses."""
        return not isinstance(self.of, Point | Measurement)

    @property
    def unit(self) -> float:
        """Its unit in mm or rad; 1 for a function, and for a combination, which is in the units of its measurements."""
        if isinstance(self.of, Measurement) and not self.of.names:
            return _conversion(self.units, self.of.units) or 1.0
        return (_conversion(self.units, "mm") or 1.0) if isinstance(self.of, Point) else 1.0

    @property
    def quantity(self) -> str:
        """The quantity: a displacement, a coordinate, a distance, its deviation, a kind of measurement, or an expression."""
        if isinstance(self.of, Measurement):
            return self.of.kind
        if not isinstance(self.of, Point):
            return "expression"
        if self.to is None:
            return "coordinate" if self.absolute else "displacement"
        return "deviation of distance" if self.absolute is False else "distance"

    @property
    def width(self) -> float | None:
        """The width of the allowed zone; None if a side is open."""
        if self.limits is None:
            return self.tolerance.width if isinstance(self.tolerance, Deviations) else self.tolerance
        lower, upper = self.limits
        return None if lower is None or upper is None else float(upper - lower)

    def bounds(self, nominal: float) -> tuple[float, float]:
        """Return the smallest and the largest allowed value around the nominal one; infinite on an open side."""
        if self.limits is not None:
            lower, upper = self.limits
            return -math.inf if lower is None else lower, math.inf if upper is None else upper
        if isinstance(self.tolerance, Deviations):
            return nominal + self.tolerance.lower, nominal + self.tolerance.upper
        if self.tolerance is None:
            return -math.inf, math.inf
        return nominal - self.tolerance / 2, nominal + self.tolerance / 2

    def faults(self) -> Iterator[str]:
        for point in self.points:
            yield from point.faults()
        yield from self._subject_faults()
        if not (self.units and is_line(self.units)):
            yield (
                f'units is {self.units!r}; expected a text such as "mm", "rad", or "1" for a pure number, '
                "without control characters"
            )
        elif isinstance(self.of, Point) and _conversion(self.units, "mm") is None:
            yield f"units is {self.units!r}; expected one of: {', '.join(UNITS)}"
        if self.to is not None and not isinstance(self.to, Point):
            yield f"to is a {type(self.to).__name__}; expected part.point(x, y, z)"
        yield from self._limits_faults()
        yield from super().faults()
        if self.absolute is not None and not isinstance(self.of, Point):
            yield f"absolute is for measurements of points; a {self._noun} has its own value, so leave it out"

    def _subject_faults(self) -> Iterator[str]:
        if isinstance(self.of, Point):
            if self.along is None:
                yield 'a measured point needs a direction; give along="z", or a vector'
            yield from direction_faults("along", self.along)
        elif not (isinstance(self.of, Measurement | tuple) or callable(self.of)):
            yield (
                f"it measures a {type(self.of).__name__}; expected part.point(x, y, z), a measurement such as tc.Gap(...), "
                "or a function of the poses"
            )
        elif self.along is not None or self.to is not None:
            yield f"a {self._noun} needs no direction; leave out to and along"
        if isinstance(self.of, Measurement):
            yield from self.of.faults()

    @property
    def _noun(self) -> str:
        return "measurement" if isinstance(self.of, Measurement) else "function of the poses"

    def _limits_faults(self) -> Iterator[str]:
        width = self.tolerance.width if isinstance(self.tolerance, Deviations) else self.tolerance
        if fault := text_fault(self.tolerance, units=self.units):
            yield f"tolerance is {fault}"
        elif width is not None and not (is_length(width) and width > 0):
            yield f"tolerance is {self.tolerance!r}; expected the full width of the allowed zone, above 0"
        if self.limits is None:
            return
        if self.tolerance is not None:
            yield "it has both a tolerance and limits; give one of them"
        fault = f"limits are {self.limits!r}; expected (lower, upper), numbers with lower < upper, or None for an open side"
        if isinstance(self.limits, str):
            yield f"{fault}; around the nominal value they are a tolerance, as in tolerance={self.limits!r}"
            return
        is_pair = isinstance(self.limits, tuple) and len(self.limits) == 2
        limits = [limit for limit in self.limits if limit is not None] if is_pair else []
        if not limits or not all(map(is_length, limits)) or (len(limits) == 2 and not limits[0] < limits[1]):
            yield fault

    def reference_faults(self, earlier: "Sequence[Measure]") -> Iterator[str]:
        """Yield faults of a measurement's units and references: it may only refer to the earlier measures."""
        if not isinstance(self.of, Measurement):
            return
        units = {measure.name: measure.units for measure in earlier}
        for name in dict.fromkeys(self.of.names):
            if name not in units:
                yield f'unknown measurement "{name}"; those declared before it are: {", ".join(units) or "none"}'
        own = self.of.units_among(units)
        if len(own) > 1:
            yield f"it combines measurements in {' and '.join(sorted(own))}; expected the same units"
        elif own and (self.of.names or _conversion(self.units, min(own)) is None) and own != {self.units}:
            yield f"units is {self.units!r}, but its measurement is in {min(own)}; leave units out"

    def __str__(self) -> str:
        along = "" if self.along is None else " along ({:g}, {:g}, {:g})".format(*self.along)
        subject = "expression of the poses" if self.is_expression else f"{self.of}{along}"
        if self.to is not None:
            subject = f"distance {self.of} to {self.to}{along}"
        if isinstance(self.of, Point) and self.absolute is not None:
            subject = f"{self.quantity}, {subject}"
        return f"measurement {self.name}: {subject}{self._limit_text}"

    @property
    def _limit_text(self) -> str:
        if self.limits is None:
            if isinstance(self.tolerance, Deviations):
                return f", tolerance {self.tolerance} {self.units}"
            return "" if self.tolerance is None else f", tolerance {self.tolerance:g} {self.units}"
        lower, upper = self.limits
        if lower is None or upper is None:
            return f", at most {upper:g} {self.units}" if lower is None else f", at least {lower:g} {self.units}"
        return f", limits {lower:g} to {upper:g} {self.units}"


def _conversion(units: str, own: str) -> float | None:
    """Return the size of a unit in the `own` units of a measured value, "mm" or "rad"; None if it is none of their kind."""
    return 1.0 if units == own else _KINDS.get(own, {}).get(units)


Tape = tuple[tuple[Any, ...], ...]

UNARY = (
    "neg", "exp", "log", "sqrt", "sq", "twice", "sin", "cos", "tan", "asin", "acos", "atan", "floor", "ceil", "fabs", "sign",
    "erf", "inv", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "not", "log1p", "expm1", "assign",
)  # fmt: skip
BINARY = (
    "add", "sub", "mul", "div", "pow", "constpow", "lt", "le", "eq", "ne", "and", "or", "fmod", "remainder", "copysign",
    "atan2", "fmin", "fmax", "hypot", "if_else_zero",
)  # fmt: skip
OPERANDS = {"input": 1, "const": 1, **dict.fromkeys(UNARY, 1), **dict.fromkeys(BINARY, 2)}
MAX_STEPS = 100_000  # a longer expression takes minutes to compile
MAX_STATIONS = 1000  # of a seam


def tape_of(rows: list[list[Any]], place: Place, max_steps: int = MAX_STEPS) -> Tape:
    """Return the tape that a document has at `place`.

    Raises EntryError for an unknown step, or an operand that is neither an input nor an earlier step.
    """
    if not 0 < len(rows) <= max_steps:
        raise place.error("it has no steps" if not rows else f"it has more than {max_steps} steps")
    for k, (operation, *operands) in enumerate(row or [None] for row in rows):
        if operation not in OPERANDS:
            raise place[k].mismatch("the name of an operation", operation)
        if len(operands) != OPERANDS[operation]:
            raise place[k].error(f"{operation!r} with {len(operands)} operands")
        count = place.sources.inputs if operation == "input" else k
        for operand in operands:
            if operation == "const":  # an expression may compare with infinity
                if not isinstance(operand, float) and not (isinstance(operand, int) and abs(operand) <= MAX_NUMBER):
                    raise place[k].mismatch("a number", operand)
            elif not (isinstance(operand, int) and 0 <= operand < count):
                raise place[k].mismatch(f"a whole number from 0 to {count - 1}", operand)
    return tuple(map(tuple, rows))


def stations(start: Point, end: Point, count: int) -> tuple[Point, ...]:
    """Return `count` points of a part, evenly from `start` to `end`: the stations of a seam.

    `tc.stations(door.point(0, 40, 0), door.point(0, 40, 700), 5)`
    Points on a feature move with its deviation. Raises TypeError or ValueError for points of two parts or features.
    """
    if not (isinstance(start, Point) and isinstance(end, Point) and start.position and end.position):
        raise TypeError(
            f"stations: start is {start!r}, end is {end!r}; expected two points part.point(x, y, z), or two of a feature"
        )
    if start.part is not end.part or start.on is not end.on:
        raise ValueError(f"stations: {start} and {end} are not points of one part, or of one feature")
    if type(count) is not int or not 2 <= count <= MAX_STATIONS:
        raise ValueError(f"stations: count is {count!r}; expected a whole number from 2 to {MAX_STATIONS}")
    point: Callable[..., Point] = start.on.point if start.on else start.part.point
    shares = [k / (count - 1) for k in range(count)]
    return tuple(
        point(*((1 - share) * a + share * b for a, b in zip(start.position, end.position, strict=True))) for share in shares
    )
