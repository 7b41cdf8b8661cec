"""Measurements of faces, and of other measurements: values of measures, in addition to points and expressions.

Each kind is a class, which `MEASUREMENTS` lists by the kind's name. Measurements can be nested: `tc.Minimum(tc.Gap(...), "m")`.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from tolcontact.declaration.checks import direction_faults
from tolcontact.declaration.part import Face, Feature, Part, Point, face_of
from tolcontact.declaration.values import Vector, direction, is_length
from tolcontact.readable import Readable

MAX_DEPTH = 8  # of nested measurements
MAX_LISTED = 3  # measurements in a text


class Measurement(Readable):
    """A quantity that follows from the poses of parts and the deviations of their features.

    kind     its name, in documents and tables
    units    of its value; a combination has the units of its measurements
    depth    number of combinations inside each other
    """

    kind: ClassVar[str]
    units: str = "mm"
    depth = 0

    @property
    def faces(self) -> tuple[Face, ...]:
        """The faces that are measured."""
        return tuple(value for value in vars(self).values() if isinstance(value, Face))

    @property
    def points(self) -> tuple[Point, ...]:
        """The points that are measured."""
        return tuple(value for value in vars(self).values() if isinstance(value, Point))

    @property
    def operands(self) -> "tuple[str | Measurement, ...]":
        """The measurements that this one combines, or the names of their measures."""
        return ()

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts that are measured, and the parts that choose faces."""
        own = [part for face in self.faces for part in face.parts] + [point.part for point in self.points]
        return (*own, *(part for nested in self._nested for part in nested.parts))

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the measures that this measurement refers to."""
        own = [operand for operand in self.operands if isinstance(operand, str)]
        return (*own, *(name for nested in self._nested for name in nested.names))

    @property
    def _nested(self) -> "tuple[Measurement, ...]":
        return tuple(operand for operand in self.operands if isinstance(operand, Measurement))

    def units_among(self, units: Mapping[str, str]) -> set[str]:
        """Return the units of the value from the units of named measures: several if it combines unlike measurements."""
        return {self.units}

    def faults(self) -> Iterator[str]:
        things: tuple[Face | Point | Measurement, ...] = (*self.faces, *self.points, *self._nested)
        for thing in things:
            yield from thing.faults()

    def _take_faces(self, *names: str) -> None:
        """Store faces in place of features. Raises TypeError for anything else."""
        for name in names:
            face = getattr(self, name)
            if not isinstance(face, Face | Feature):
                raise TypeError(f'{self.kind}: {name} is a {type(face).__name__}; expected part.face("+z"), or a feature')
            object.__setattr__(self, name, face_of(face))


@dataclass(frozen=True, eq=False, repr=False)
class _OfStation(Measurement):
    station: Point
    face: Face

    def __post_init__(self) -> None:
        if not isinstance(self.station, Point):
            raise TypeError(
                f"{self.kind}: station is a {type(self.station).__name__}; it takes a point and a face, as in "
                f'tc.{type(self).__name__}(part.point(x, y, z), other.face("+z")); of two faces there are tc.Clearance, '
                "tc.LargestGap and tc.MeanGap"
            )
        self._take_faces("face")

    def __str__(self) -> str:
        return f"{self.kind} from {self.station} to {self.face}"


class Gap(_OfStation):
    """The distance of a station, a point of one part, from a face of another, perpendicular to this face.

    `tc.Gap(door.point(0, 40, 300), body.face("-x"))`

    The face is extended beyond its ends: as its plane, cylinder, cone, sphere or torus, or as its tangent plane at the point
    nearest to the nominal station if its surface is of no such kind. The gap is negative if the station is inside the material.
    """

    kind = "gap"


class Flush(_OfStation):
    """The height of a station, a point of one part, over a neighbouring outer face of another, perpendicular to this face.

    `tc.Flush(door.point(0, 40, 300), body.face("+y"))`

    The face is extended beyond its ends, as for a Gap.
    """

    kind = "flush"


@dataclass(frozen=True, eq=False, repr=False)
class _OfTwoFaces(Measurement):
    first: Face
    second: Face

    directions: ClassVar[tuple[str, ...]] = ()  # names of fields that may be left out

    def __post_init__(self) -> None:
        self._take_faces("first", "second")
        for name in self.directions:
            if getattr(self, name) is not None:
                object.__setattr__(self, name, direction(getattr(self, name)))

    def faults(self) -> Iterator[str]:
        yield from super().faults()
        for name in self.directions:
            yield from direction_faults(name, getattr(self, name))

    def __str__(self) -> str:
        given = [(name, value) for name in self.directions if (value := getattr(self, name)) is not None]
        texts = [" {} ({:g}, {:g}, {:g})".format(name, *value) for name, value in given]
        return "".join([f"{self.kind} of {self.first} and {self.second}", *texts])


class Clearance(_OfTwoFaces):
    """The shortest distance of two faces of different parts, negative where they overlap: `tc.Clearance(first, second)`.

    For planes it is the smallest height, perpendicular to the second face, in their overlap region at the current pose; in
    their nominal overlap region if they do not overlap there, or if their rims have more than 2500 pairs of edges. For a ball
    or a shaft and walls it is the smallest contact gap (see tolcontact.discretization); for two outer cylinders, the distance
    of their axes, each as long as its face, less both radii. For all other faces, and for whole parts (`part.face()`), it is
    the shortest distance of their triangles, negative by the depth of a corner or an edge inside the other one. It evaluates
    the corners and edges that are nominally nearest; where parts move beyond these it is too small, never too large, with a
    warning (see tolcontact.plausibility).
    """

    kind = "clearance"


class LargestGap(_OfTwoFaces):
    """The largest gap [mm] left between two faces of different parts that face each other: the widest leak.

    `tc.LargestGap(lid.face("-z"), box.face("+z"))`

    The gap is measured at places of the first face, perpendicular to the second one, with the form of both, and is negative
    inside the material. The places cover the region of the first face over which the second one lies in the nominal assembly,
    its rim and its corners included. Their spacing is a seventh of the shortest correlation length of form; without form there
    are about 200 places. The second face is extended beyond its ends, as for a Gap, and its form deviation is taken opposite
    the nominal place.
    """

    kind = "largest gap"


class MeanGap(_OfTwoFaces):
    """The area-weighted mean [mm] of the gap left between two faces of different parts, at the places of a LargestGap.

    `tc.MeanGap(lid.face("-z"), box.face("+z"))`

    The weight of each place is the area of the first face that is nearest to it, so that flat faces have the mean of the region
    where they lie over each other. On curved faces the area is summed over triangles, each over the second face or not: where
    the second face ends over the first one, the mean is off by up to about 0.4 % of the range of gaps. The mean times the area
    of the region is the volume between both faces.
    """

    kind = "mean gap"


@dataclass(frozen=True, eq=False, repr=False)
class AxisDistance(_OfTwoFaces):
    """The distance of the axes of two cylinders or cones; the axis of a sphere is its centre.

    `tc.AxisDistance(hole, pin)` is the shortest distance of the two axes, each as long as its face.

    across   a direction: the distance of the points where both axes, extended if needed, pierce the plane across it through the
             midpoint of the first axis
    along    a direction: the component of the perpendicular from the midpoint of the first axis to the infinite second axis

    Directions are fixed in the assembly frame.
    """

    kind, directions = "distance of axes", ("across", "along")

    across: Vector | None = None
    along: Vector | None = None

    def faults(self) -> Iterator[str]:
        yield from super().faults()
        if self.across is not None and self.along is not None:
            yield "across and along are both given; give one of them"


@dataclass(frozen=True, eq=False, repr=False)
class Angle(_OfTwoFaces):
    """The angle [rad] between two planes or axes, by the normals of planes and the axes of cylinders and cones.

    Planes and lines have no sense: the second direction is reversed if it is more than a right angle from the first one
    nominally. Without `about`, as in `tc.Angle(top, base)`, it is the angle between the two directions in space, from 0 on.

    about   a direction, fixed in the assembly frame: the rotation about it that makes the first direction coincide with the
            second one, both seen along it, from -pi to pi. A nominally right angle with an axis is positive.
    """

    kind, units, directions = "angle", "rad", ("about",)

    about: Vector | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Chain(Measurement):
    """A dimension chain: the sum of deviations times their sensitivities, wherever contact places the parts.

    `tc.Chain({"spacer.end.offset": -1, "wall.end.offset": 1}, nominal=0.4)`

    sensitivities   factor of each link, by the name of a variable or the label of another contributor
    nominal         value without deviations, to which variables with a nominal value add theirs times their factors
    units           of the value, by default mm
    """

    kind = "chain"

    sensitivities: Mapping[str, float]
    nominal: float = 0.0
    units: str = "mm"

    def faults(self) -> Iterator[str]:
        if not self.sensitivities:
            yield 'the chain has no links; give sensitivities={"part.locator": 1, ...}'
        for label, factor in self.sensitivities.items():
            if not (isinstance(label, str) and is_length(factor)):
                yield f"sensitivities has {label!r}: {factor!r}; expected the label of a contributor, and a number"
        if not is_length(self.nominal):
            yield f"nominal is {self.nominal!r}; expected a number"

    def __str__(self) -> str:
        links = [f"{factor:+g} {label}" for label, factor in self.sensitivities.items()]
        return f"chain of {len(links)} links" if len(links) > MAX_LISTED else f"chain {' '.join(links)}"


@dataclass(frozen=True, eq=False, repr=False, init=False)
class Combination(Measurement):
    """A value of several measurements, or of measures that were declared before, which may be given by name."""

    measurements: tuple[str | Measurement, ...]

    def __init__(self, *measurements: Any) -> None:
        operands = []
        for operand in measurements:
            value = operand if isinstance(operand, str | Measurement) else getattr(operand, "name", None)
            if not isinstance(value, str | Measurement):
                raise TypeError(f"{self.kind}: {type(operand).__name__} is no measurement; expected one, or the name of one")
            operands.append(value)
        vars(self)["measurements"] = tuple(operands)
        vars(self)["depth"] = 1 + max((nested.depth for nested in self._nested), default=0)
        if self.depth > MAX_DEPTH:
            raise ValueError(f"{self.kind}: measurements are nested more than {MAX_DEPTH} deep; declare some as measures")

    def units_among(self, units: Mapping[str, str]) -> set[str]:
        own = {units[operand] for operand in self.operands if isinstance(operand, str) and operand in units}
        return own.union(*(nested.units_among(units) for nested in self._nested))

    @property
    def operands(self) -> tuple[str | Measurement, ...]:
        return self.measurements

    def faults(self) -> Iterator[str]:
        yield from super().faults()
        if len(self.operands) < 2:
            yield f"the {self.kind} has {len(self.operands)} measurement(s); expected two or more"

    def __str__(self) -> str:
        if len(self.operands) > MAX_LISTED:
            return f"{self.kind} of {len(self.operands)} measurements"
        return f"{self.kind} of {' and '.join(f'({operand})' for operand in self.operands)}"


class Minimum(Combination):
    """The least of several measurements, or of measures by name: `tc.Minimum(tc.Gap(...), tc.Gap(...))`."""

    kind = "minimum"


class Maximum(Combination):
    """The largest of several measurements, or of measures by name: `tc.Maximum("gap top", "gap bottom")`."""

    kind = "maximum"


class Mean(Combination):
    """The mean of several measurements, or of measures by name: `tc.Mean("gap top", "gap bottom")`."""

    kind = "mean"


class Sum(Combination):
    """The sum of several measurements, or of measures by name: `tc.Sum("step", "flush")`."""

    kind = "sum"


class Difference(Combination):
    """The first of two measurements, or measures by name, less the second one: `tc.Difference("left", "right")`."""

    kind = "difference"

    def faults(self) -> Iterator[str]:
        yield from super().faults()
        if len(self.operands) > 2:
            yield f"the difference has {len(self.operands)} measurements; expected two"


_KINDS: tuple[type[Measurement], ...] = (
    Gap, Flush, Clearance, LargestGap, MeanGap, AxisDistance, Angle, Minimum, Maximum, Mean, Sum, Difference, Chain,
)  # fmt: skip
MEASUREMENTS = {measurement.kind: measurement for measurement in _KINDS}
