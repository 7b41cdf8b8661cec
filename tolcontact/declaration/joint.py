"""Bodies that belong together: parts that a station joined to one rigid body, and parts that may overlap."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

from tolcontact.declaration.checks import Declaration
from tolcontact.declaration.part import Part

MIN_PARTS = 2
MIN_MEMBERS = 2


@dataclass(frozen=True, eq=False, repr=False)
class Joint(Declaration):
    """Parts that keep, after the station that joins them, their relative poses in that station.

    `members` are the joined parts. The pose of the joint is the pose of the first one. A joint that is joined
    again is stated by its parts.
    """

    name: str
    members: tuple[Part, ...]
    station: str
    declared_at: str = ""
    noun: ClassVar[str] = "joint"

    @property
    def first(self) -> Part:
        """The part whose pose is the pose of the joint."""
        return self.members[0]

    def faults(self) -> Iterator[str]:
        if len(self.members) < MIN_MEMBERS:
            yield f"it has {len(self.members)} part; join at least {MIN_MEMBERS}"
        for part in dict.fromkeys(self.members):
            if self.members.count(part) > 1:
                yield f'station "{self.station}" joins part "{part.name}" {self.members.count(part)} times in it; name it once'
            if part.fixed:
                yield f'part "{part.name}" is fixed, so no later station can move it; locate it in station "{self.station}"'

    def __str__(self) -> str:
        return f"joint {self.name}: {', '.join(part.name for part in self.members)}, joined in station {self.station}"


def parts_of(bodies: Sequence[Part | Joint]) -> tuple[Part, ...]:
    """Return the parts of bodies, in their order."""
    return tuple(part for body in bodies for part in (body.members if isinstance(body, Joint) else (body,)))


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
        count = len(set(self.parts))
        if count < MIN_PARTS:
            yield f"it names {count} part; name at least {MIN_PARTS}, as in may_overlap(shaft, hub)"

    def __str__(self) -> str:
        return f"overlap of {self.name}"
