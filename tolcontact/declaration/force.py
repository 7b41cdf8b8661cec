"""Forces that press parts onto their supports: gravity, clamps and others."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from tolcontact.declaration.part import Part, Point
from tolcontact.declaration.values import Vector, is_finite
from tolcontact.readable import Readable


@dataclass(frozen=True, eq=False, repr=False)
class Force(Readable):
    """A force `vector` [N] at a point of a part, constant in the assembly frame. The objective "seating" uses it."""

    name: str
    at: Point
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
