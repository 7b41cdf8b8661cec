"""Stations: an assembly that is built in steps has one set of locations, contact pairs, measures and joints for each."""

from collections.abc import Iterator
from typing import Any, ClassVar

from tolcontact.declaration.checks import Declaration
from tolcontact.declaration.declarations import Declarations, expect
from tolcontact.declaration.joint import Joint, parts_of
from tolcontact.declaration.part import Part
from tolcontact.declaration.values import script_line


class Station(Declarations, Declaration):
    """A step of building or measuring an assembly: `assembly.station(name)` declares it, in the order of the steps.

    Parts and joints are located again in each station; a station that only measures is an inspection. Features belong to parts:
    their deviations are equal in all stations. A locator is a contributor of its own in each station, "weld.panel.A1".
    """

    name: str
    declared_at: str
    noun: ClassVar[str] = "station"

    def __init__(self, name: str, declared_at: str = "") -> None:
        self.name, self._station, self.declared_at = name, name, declared_at
        self._assembly: Declarations | None = None

    def belonging_to(self, assembly: Declarations) -> "Station":
        """Let the station declare into the lists of an assembly, and return it."""
        self._assembly = assembly
        return self

    def join(self, name: str, *bodies: Part | Joint) -> Joint:
        """Declare that parts, or joints of earlier stations, are joined at the end of this station, and return the joint.

        Later stations locate the joint by points of any of its parts.
        """
        for body in bodies:
            expect(f'join "{name}": a body', body, Part | Joint, "parts and joints, as in weld.join(name, left, right)")
        return self._add("joints", Joint(name, parts_of(bodies), self.name, script_line()))

    @property
    def assembly(self) -> Any:
        if self._assembly is None:
            raise TypeError(f'station "{self.name}" belongs to no assembly; declare it with assembly.station(name)')
        return self._assembly

    def faults(self) -> Iterator[str]:
        if not isinstance(self.name, str):
            yield f"name is {self.name!r}; expected a text"

    def __str__(self) -> str:
        return f"station {self.name}"
