"""The assembly: collects declarations in the order in which a script makes them."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from tolcontact.declaration.contact_pair import ContactPair
from tolcontact.declaration.force import Force
from tolcontact.declaration.geometry import Box, Mesh
from tolcontact.declaration.locator import Location, Locator, ThreeTwoOne
from tolcontact.declaration.measure import Measure
from tolcontact.declaration.names import key_faults, text_faults
from tolcontact.declaration.part import Face, Part, Point
from tolcontact.declaration.tolerance import tolerance as _tolerance
from tolcontact.declaration.vectors import direction, script_line
from tolcontact.declaration.vectors import vector as _vector
from tolcontact.method import Method
from tolcontact.readable import Readable

CONSTANT = 1e-3


class Assembly(Readable):
    """Parts, how they are located, which faces may touch, and what is measured. Lengths in mm, angles in rad.

    The methods only record what is declared; `faults()` lists everything that is wrong with it.
    """

    def __init__(self, name: str, *, method: Method | None = None) -> None:
        """`method` is how contact in this model is resolved, unless a run states another one."""
        _expect(f'assembly "{name}": method', method, Method | None, "tc.Method(...)")
        self.name = name
        self.method = method
        self._parts: list[Part] = []
        self._locations: list[Location] = []
        self._pairs: list[ContactPair] = []
        self._measures: list[Measure] = []
        self._forces: list[Force] = []

    @classmethod
    def of(
        cls,
        name: str,
        method: Method | None,
        *,
        parts: Iterable[Part],
        locations: Iterable[Location],
        pairs: Iterable[ContactPair],
        measures: Iterable[Measure],
        forces: Iterable[Force],
    ) -> "Assembly":
        """An assembly of things that have been declared already."""
        made = cls(name, method=method)
        made._parts.extend(parts)
        made._locations.extend(locations)
        made._pairs.extend(pairs)
        made._measures.extend(measures)
        made._forces.extend(forces)
        return made

    @property
    def parts(self) -> tuple[Part, ...]:
        return tuple(self._parts)

    @property
    def locations(self) -> tuple[Location, ...]:
        return tuple(self._locations)

    @property
    def pairs(self) -> tuple[ContactPair, ...]:
        return tuple(self._pairs)

    @property
    def measures(self) -> tuple[Measure, ...]:
        return tuple(self._measures)

    @property
    def forces(self) -> tuple[Force, ...]:
        return tuple(self._forces)

    def part(
        self,
        name: str,
        geometry: Box | Mesh,
        *,
        at: Any = (0, 0, 0),
        rotation: Any = (0, 0, 0),
        fixed: bool | None = None,
    ) -> Part:
        """Declare a part: its shape, and its place in the nominal assembly (see Part)."""
        _expect(f'part "{name}": geometry', geometry, Box | Mesh, "tc.Box(x, y, z) or tc.Mesh(file)")
        _expect(f'part "{name}": fixed', fixed, bool | None, "True, False or None")
        part = Part(name, geometry, _vector(at), _vector(rotation), fixed, script_line())
        self._parts.append(part)
        return part

    def locate(
        self, part: Part, scheme: ThreeTwoOne | Sequence[Locator], *, tolerance: Any = None, on: Part | None = None
    ) -> Location:
        """Locate a part by six locators, on the ground or `on` another part.

        `tolerance` holds for every locator that has none of its own: the full width of its zone [mm], a Tolerance, or
        a frozen scipy.stats distribution.
        """
        _expect("locate: the first argument", part, Part, "a part")
        _expect(f'locate "{part.name}": on', on, Part | None, "a part, or None for the ground")
        scheme = scheme if isinstance(scheme, ThreeTwoOne) else tuple(scheme)
        for locator in scheme if isinstance(scheme, tuple) else ():
            _expect(f'locate "{part.name}": a locator', locator, Locator, "tc.Locator(name, point, direction)")
        common = None if tolerance is None else _tolerance(tolerance)
        self._locations.append(Location(part, scheme, common, on, script_line()))
        return self._locations[-1]

    def contact(
        self,
        name: str,
        *,
        moving: Face,
        reference: Face,
        points: int | str | None = None,
        spacing: float | None = None,
        within: float | None = None,
    ) -> ContactPair:
        """Declare that points of the `moving` face stay outside the `reference` face (see ContactPair)."""
        for side, face in (("moving", moving), ("reference", reference)):
            _expect(f'contact "{name}": {side}', face, Face, 'part.face("+z")')
        self._pairs.append(ContactPair(name, moving, reference, points, spacing, within, script_line()))
        return self._pairs[-1]

    def force(self, name: str, *, at: Point, vector: Any) -> Force:
        """Declare a force `vector` [N], in the assembly frame, at a point of a part (see Force)."""
        _expect(f'force "{name}": at', at, Point, "part.point(x, y, z)")
        self._forces.append(Force(name, at, _vector(vector), script_line()))
        return self._forces[-1]

    def measure(
        self,
        name: str,
        of: Point | Callable[[Any], Any],
        *,
        to: Point | None = None,
        along: Any = None,
        tolerance: float | None = None,
        units: str = "mm",
    ) -> Measure:
        """Declare a measure of a point, of two points, or of a CasADi expression of the poses (see Measure)."""
        axis = None if along is None else direction(along)
        self._measures.append(Measure(name, of, to, axis, tolerance, units, script_line()))
        return self._measures[-1]

    def location_of(self, part: Part) -> Location | None:
        """How `part` is located; None if it is not."""
        return next((location for location in self._locations if location.part is part), None)

    def finest(self) -> float:
        """The smallest width of a tolerance zone [mm] of any locator or measure; infinite if there is none.

        The width of a scipy.stats distribution is six standard deviations. A width below a thousandth of the widest one is
        taken for a constant, and does not count.
        """
        said = []
        for location in self._locations:
            own = [locator.tolerance for locator in location.scheme] if isinstance(location.scheme, tuple) else [None]
            said += [tolerance or location.tolerance for tolerance in own]
        widths = [tolerance.width for tolerance in said if tolerance is not None]
        widths += [float(m.tolerance) for m in self._measures if m.tolerance is not None and m.units == "mm"]
        return min((width for width in widths if width > CONSTANT * max(widths)), default=math.inf)

    def faults(self) -> Iterator[str]:
        """What is wrong with the declarations themselves, one sentence each, naming the thing at fault."""
        if not self._parts:
            yield "it has no parts; declare at least one with assembly.part(name, geometry)"
        if not self._measures:
            yield "it measures nothing; declare at least one measure with assembly.measure(...)"
        kinds = {"part": self._parts, "contact pair": self._pairs, "measure": self._measures, "force": self._forces}
        yield from text_faults("assembly", [self.name])
        for kind, things in kinds.items():
            yield from key_faults(kind, [thing.name for thing in things])  # type: ignore[attr-defined]
        for part in self._parts:
            yield from _named("part", part, part.faults())
            yield from _named("part", part, self._location_faults(part))
        for location in self._locations:
            yield from _named("part", location.part, location.faults(), location.declared_at)
            yield from self._strangers(
                f'locators of "{location.part.name}"', location.declared_at, location.part, location.on, *location.mentioned
            )
        for pair in self._pairs:
            yield from _named("contact pair", pair, pair.faults())
            yield from self._strangers(
                f'contact pair "{pair.name}"', pair.declared_at, *pair.moving.parts, *pair.reference.parts
            )
        for force in self._forces:
            yield from _named("force", force, force.faults())
            yield from self._strangers(f'force "{force.name}"', force.declared_at, force.at.part)
        for measure in self._measures:
            yield from _named("measure", measure, measure.faults())
            yield from self._strangers(
                f'measure "{measure.name}"', measure.declared_at, *(point.part for point in measure.points)
            )

    def _location_faults(self, part: Part) -> Iterator[str]:
        count = sum(location.part is part for location in self._locations)
        if count > 1:
            yield f"it is located {count} times; locate it once"
        if count == 0 and part.fixed is not True:
            yield "it is not located; call locate(...), or declare it fixed=True to hold it at its nominal place"
        seen: list[Part] = []
        below: Part | None = part
        while below is not None:
            if below in seen:
                yield f"it is located on itself, through {' on '.join(p.name for p in seen)}; break the circle"
                return
            seen.append(below)
            location = self.location_of(below)
            below = location.on if location else None

    def _strangers(self, who: str, line: str, *parts: Part | None) -> Iterator[str]:
        for part in parts:
            if part is not None and not any(part is own for own in self._parts):
                known = ", ".join(own.name for own in self._parts) or "none"
                yield (f'{who} ({line}): unknown part "{getattr(part, "name", part)}"; the parts of "{self.name}" are: {known}')

    def __str__(self) -> str:
        rows = [*self._parts, *self._locations, *self._pairs, *self._forces, *self._measures]
        return "\n".join([f"assembly {self.name}", *(f"  {row}" for row in rows)])


def _expect(what: str, value: Any, kind: Any, wanted: str) -> None:
    """Raise TypeError at the script's own line if an argument has a type that no other check could handle."""
    if not isinstance(value, kind):
        raise TypeError(f"{what} is a {type(value).__name__}; expected {wanted}")


def _named(kind: str, thing: Any, faults: Iterator[str], line: str = "") -> Iterator[str]:
    where = line or thing.declared_at
    return (f'{kind} "{thing.name}"{f" ({where})" if where else ""}: {fault}' for fault in faults)
