"""Contact pairs: surfaces that may touch and may not pass through each other; and forces that press parts together."""

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
        if self.spacing is not None:
            points = f"spacing {self.spacing:g} mm"
        else:
            count = VERTICES if self.points == VERTICES else f"{self.points} points"
            points = "points by geometry" if self.points is None else count
        stiffness = "" if self.stiffness is None else f", {self.stiffness:g} N/mm"
        return f"contact {self.name}: {self.moving} (moving) against {self.reference} (reference), {points}{stiffness}"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Force(Declaration):
    """A force `vector` [N] at a point of a part, constant in the assembly frame. The objective "seating" uses it."""

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
            yield "vector is not a nonzero vector of three finite numbers [N]"

    def __str__(self) -> str:
        return f"force {self.name}: ({', '.join(f'{c:g}' for c in self.vector)}) N at {self.at}"
