"""Contact pairs: two surfaces that may touch and may not pass through each other."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from tolcontact.declaration.part import Face
from tolcontact.readable import Readable

VERTICES = "vertices"


@dataclass(frozen=True, eq=False, repr=False)
class ContactPair(Readable):
    """Points of the `moving` face are kept outside the `reference` face.

    The points are `points` of them spread evenly, or as many as keep every spot of the face within `spacing` [mm] of
    one, or the mesh's own vertices (`points="vertices"`). By default they are 200 spread evenly, with the
    corners of the region where flat faces overlap, and on curved faces as many more as curvature requires; a ball or a shaft
    beside walls touches exactly, with none of them.
    A point takes part when the reference face lies within `within` [mm] of it in the nominal assembly (None: a tenth of
    the moving part's diagonal).
    """

    name: str
    moving: Face
    reference: Face
    points: int | str | None = None
    spacing: float | None = None
    within: float | None = None
    declared_at: str = ""

    def faults(self) -> Iterator[str]:
        yield from self.moving.faults()
        yield from self.reference.faults()
        if self.moving.part is self.reference.part:
            yield f'both faces belong to part "{self.moving.part.name}"; a pair needs two parts'
        if self.points not in (None, VERTICES) and not (type(self.points) is int and self.points >= 1):
            yield f'points is {self.points!r}; expected a whole number, 1 or above, or "{VERTICES}"'
        for word in ("spacing", "within"):
            length = getattr(self, word)
            if length is not None and not (isinstance(length, int | float) and math.isfinite(length) and length > 0):
                yield f"{word} is {length!r}; expected a length in mm above 0"
        if self.points is not None and self.spacing is not None:
            yield "both points and spacing are given; give one of them"

    def __str__(self) -> str:
        if self.spacing is not None:
            points = f"spacing {self.spacing:g} mm"
        else:
            said = VERTICES if self.points == VERTICES else f"{self.points} points"
            points = "points by geometry" if self.points is None else said
        return f"contact {self.name}: {self.moving} (moving) against {self.reference} (reference), {points}"
