"""Points of a part."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tolcontact.declaration.vectors import Vector, is_finite
from tolcontact.readable import Readable

if TYPE_CHECKING:
    from tolcontact.declaration.feature import Feature
    from tolcontact.declaration.part import Part


@dataclass(frozen=True, eq=False, repr=False)
class Point(Readable):
    """A point of a part, in the part's own frame [mm]; one `on` a feature moves with it when it deviates.

    An `end` (0 or 1) of the feature's axis takes the place of a position.
    """

    part: "Part"
    position: Vector | None
    on: "Feature | None" = None
    end: int | None = None

    def faults(self) -> Iterator[str]:
        if self.position is not None and not is_finite(self.position):
            yield f'point of part "{self.part.name}" is not three finite numbers'
        if self.position is None and self.end not in (0, 1):
            yield f"end of the axis is {self.end!r}; expected 0 or 1"

    def __str__(self) -> str:
        where = f"{self.part.name}.{self.on.name}" if self.on else self.part.name
        return (
            f"{where} axis end {self.end}" if self.position is None else "{} ({:g}, {:g}, {:g})".format(where, *self.position)
        )
