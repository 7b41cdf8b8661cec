"""What parts have in common: contact pairs, forces that press them together, joints of stations, and meant overlaps."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar, Literal

from tolcontact.declaration.checks import FRICTION, LENGTH, STIFFNESS, Check, Declaration, text_type, whole_number
from tolcontact.declaration.part import Face, Part, Point
from tolcontact.declaration.values import Vector, is_finite

VERTICES = "vertices"
MAX_POINTS = 100_000  # of a pair; more take minutes, and gigabytes
COUNT = whole_number(1, MAX_POINTS)
POINTS = Check(
    lambda points: points == VERTICES or COUNT.holds(points),
    f'{COUNT.expected}, or "{VERTICES}"',
    COUNT.wire | text_type([VERTICES]),
)
MIN_PARTS = 2  # of a joint, and of an overlap


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ContactPair(Declaration):
    """Two faces that may touch: points of the `moving` face stay outside the `reference` face.

    points    the number of points, spread evenly, or "vertices" for the vertices of the mesh. By default 200 points, the
              corners of the region where flat faces overlap, and more points on curved faces as their curvature requires; a
              ball or a shaft against walls needs no points
    spacing   [mm] largest distance from the face to the nearest contact point, in place of a number of points
    within    [mm] a point takes part if the reference face is this near in the nominal assembly; by default a tenth of the
              diagonal of the moving part
    mu        coefficient of friction for tc.analyses.seating and tc.check; contact is resolved without friction. By default the
              coefficient of the assembly
    stiffness [N/mm] the force that presses the faces into each other evenly by 1 mm, under the objective "seating". Each point
              is a spring with its share of the area, and pushes only; round faces share it by their balls
              and ends of shafts. By default the pair is rigid
    """

    moving: Face
    reference: Face
    name: str
    points: int | Literal["vertices"] | None = None
    spacing: float | None = None
    within: float | None = None
    declared_at: str = ""
    mu: float | None = None
    station: str = ""
    stiffness: float | None = None
    noun: ClassVar[str] = "contact pair"
    checks: ClassVar = {"points": POINTS, "spacing": LENGTH, "within": LENGTH, "mu": FRICTION, "stiffness": STIFFNESS}

    @property
    def parts(self) -> tuple[Part, ...]:
        """The parts of its faces, and of their criteria."""
        return (*self.moving.parts, *self.reference.parts)

    def faults(self) -> Iterator[str]:
        yield from self.moving.faults()
        yield from self.reference.faults()
        if self.moving.part is self.reference.part:
            yield f'both faces belong to part "{self.moving.part.name}"; a pair needs two parts'
        yield from super().faults()
        if self.points is not None and self.spacing is not None:
            yield "both points and spacing are given; give one of them"

    def __str__(self) -> str:
        points = VERTICES if self.points == VERTICES else f"{self.points} points"
        if self.spacing is not None:
            points = f"spacing {self.spacing:g} mm"
        elif self.points is None:
            points = "points by geometry"
        stiffness = "" if self.stiffness is None else f", {self.stiffness:g} N/mm"
        return f"contact {self.name}: {self.moving} (moving) against {self.reference} (reference), {points}{stiffness}"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Force(Declaration):
    """A force `vector` [N] at a point of a part, constant in the assembly frame. The objective "seating" uses it.

    Its magnitude varies by variables that load it.
    """

    at: Point
    name: str
    vector: Vector
    declared_at: str = ""
    station: str = ""
    noun: ClassVar[str] = "force"

    @property
    def parts(self) -> tuple[Part, ...]:
        """The part that it acts on."""
        return (self.at.part,)

    def faults(self) -> Iterator[str]:
        yield from self.at.faults()
        if not (is_finite(self.vector) and any(self.vector)):
            yield f"vector is {self.vector!r}; expected a nonzero vector of three finite numbers [N]"

    def __str__(self) -> str:
        return f"force {self.name}: ({', '.join(f'{c:g}' for c in self.vector)}) N at {self.at}"


@dataclass(frozen=True, eq=False, repr=False)
class Joint(Declaration):
    """Parts that keep, after the station that joins them, their relative poses in that station.

    `members` are the joined parts. The pose of the joint is the pose of the first one. A joint that is joined
    again is stated by its parts.

    Elastic parts are joined `at` points of one of them, to the last member. Guns of the station hold their faces there, as
    features deviate, at their nominal distance. Later stations keep the gaps that three points of each `pad` [mm] have then, or
    without a pad the point itself.
    """

    name: str
    members: tuple[Part, ...]
    station: str
    declared_at: str = ""
    at: tuple[Point, ...] = ()
    pad: float | None = None
    noun: ClassVar[str] = "joint"
    checks: ClassVar = {"pad": LENGTH}

    @property
    def welded(self) -> tuple[Part, Part]:
        """The part of its points, and the other part that they join to it."""
        return self.at[0].part, self.members[-1]

    @property
    def first(self) -> Part:
        """The part whose pose is the pose of the joint."""
        return self.members[0]

    def faults(self) -> Iterator[str]:
        if len(self.members) < MIN_PARTS:
            yield f"it has {len(self.members)} part; join at least {MIN_PARTS}"
        for part in dict.fromkeys(self.members):
            if (count := self.members.count(part)) > 1:
                yield f'station "{self.station}" joins part "{part.name}" {count} times in it; name it once'
            if part.fixed:
                yield f'part "{part.name}" is fixed, so no later station can move it; locate it in station "{self.station}"'
        yield from super().faults()
        elastic = [part.name for part in self.members if part.elasticity is not None]
        if elastic and not self.at:
            yield f'part "{elastic[0]}" is elastic, so parts are joined at points: join(..., at=[part.point(x, y, z), ...])'
        if self.at and not elastic:
            yield "it has points, but its parts are rigid and keep their relative pose; leave at out"
        for point in self.at:
            yield from point.faults()
            if point.part is not self.at[0].part or point.part not in self.members[:-1] or point.position is None:
                yield f"its point {point} is not on one of its parts; give points of one part, which the last one is joined to"
        if self.pad is not None and not self.at:
            yield "it has a pad without points; give points, as in at=[part.point(x, y, z)], or leave pad out"

    def __str__(self) -> str:
        return f"joint {self.name}: {', '.join(part.name for part in self.members)}, joined in station {self.station}"


@dataclass(frozen=True, eq=False, repr=False)
class Overlap(Declaration):
    """Parts that may overlap, any two of them: press fits, welds, parts that are modelled overlapping.

    Neither checks nor runs watch these bodies. A contact pair between two of them still holds for its chosen faces.
    """

    parts: tuple[Part, ...]
    declared_at: str = ""
    noun: ClassVar[str] = "overlap"

    @property
    def name(self) -> str:  # type: ignore[override]
        return ", ".join(part.name for part in self.parts)

    def faults(self) -> Iterator[str]:
        if (count := len(set(self.parts))) < MIN_PARTS:
            yield f"it names {count} part; name at least {MIN_PARTS}, as in may_overlap(shaft, hub)"

    def __str__(self) -> str:
        return f"overlap of {self.name}"
