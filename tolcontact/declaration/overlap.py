"""Overlaps that are meant: parts that may lie in each other."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from tolcontact.declaration.part import Part
from tolcontact.readable import Readable

MIN_PARTS = 2


@dataclass(frozen=True, eq=False, repr=False)
class Overlap(Readable):
    """Parts that may lie in each other, any two of them: press fits, welds, parts that are modelled overlapping.

    Neither checks nor runs watch these bodies. A contact pair between two of them still holds for its chosen faces.
    """

    parts: tuple[Part, ...]
    declared_at: str = ""
    noun: ClassVar[str] = "overlap"

    @property
    def name(self) -> str:
        return ", ".join(part.name for part in self.parts)

    def faults(self) -> Iterator[str]:
        count = len(set(self.parts))
        if count < MIN_PARTS:
            yield f"it names {count} part; name at least {MIN_PARTS}, as in may_overlap(shaft, hub)"

    def __str__(self) -> str:
        return f"overlap of {self.name}"
