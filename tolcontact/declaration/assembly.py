"""The assembly: collects declarations in the order in which a script makes them."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from tolcontact.declaration.contact_pair import ContactPair
from tolcontact.declaration.contributor import Correlation, Population, Variable
from tolcontact.declaration.contributor import correlation as _correlation
from tolcontact.declaration.contributor import population as _population
from tolcontact.declaration.feature_tolerance import Size
from tolcontact.declaration.force import Force
from tolcontact.declaration.geometry import Box, Mesh
from tolcontact.declaration.locator import Location, Locator, ThreeTwoOne
from tolcontact.declaration.measure import Measure
from tolcontact.declaration.names import key_faults, repetitions, text_faults
from tolcontact.declaration.part import Face, Feature, Part, Point, face_of
from tolcontact.declaration.tolerance import tolerance as _tolerance
from tolcontact.declaration.vectors import direction, script_line
from tolcontact.declaration.vectors import vector as _vector
from tolcontact.method import Method
from tolcontact.readable import Pictured

CONSTANT = 1e-3


class Assembly(Pictured):
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
        self._variables: list[Variable] = []
        self._correlations: list[Correlation] = []
        self._populations: list[Population] = []

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
        variables: Iterable[Variable] = (),
        correlations: Iterable[Correlation] = (),
        populations: Iterable[Population] = (),
    ) -> "Assembly":
        """An assembly of things that have been declared already."""
        made = cls(name, method=method)
        made._parts.extend(parts)
        made._locations.extend(locations)
        made._pairs.extend(pairs)
        made._measures.extend(measures)
        made._forces.extend(forces)
        made._variables.extend(variables)
        made._correlations.extend(correlations)
        made._populations.extend(populations)
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

    @property
    def features(self) -> tuple[Feature, ...]:
        """Those of all parts, one part after the other."""
        return tuple(feature for part in self._parts for feature in part.features)

    @property
    def variables(self) -> tuple[Variable, ...]:
        return tuple(self._variables)

    @property
    def correlations(self) -> tuple[Correlation, ...]:
        return tuple(self._correlations)

    @property
    def populations(self) -> tuple[Population, ...]:
        return tuple(self._populations)

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
        self,
        part: Part,
        scheme: ThreeTwoOne | Sequence[Locator],
        *,
        tolerance: Any = None,
        on: Part | None = None,
        floating: bool = False,
    ) -> Location:
        """Locate a part by six locators, on the ground or `on` another part; by fewer, if it is `floating` (see Location).

        `tolerance` holds for every locator that has none of its own: the full width of its zone [mm], a Tolerance, or
        a frozen scipy.stats distribution.
        """
        _expect("locate: the first argument", part, Part, "a part")
        _expect(f'locate "{part.name}": on', on, Part | None, "a part, or None for the ground")
        scheme = scheme if isinstance(scheme, ThreeTwoOne) else tuple(scheme)
        for locator in scheme if isinstance(scheme, tuple) else ():
            _expect(f'locate "{part.name}": a locator', locator, Locator, "tc.Locator(name, point, direction)")
        common = None if tolerance is None else _tolerance(tolerance)
        _expect(f'locate "{part.name}": floating', floating, bool, "True or False")
        self._locations.append(Location(part, scheme, common, on, script_line(), floating))
        return self._locations[-1]

    def contact(
        self,
        name: str,
        *,
        moving: Face | Feature,
        reference: Face | Feature,
        points: int | str | None = None,
        spacing: float | None = None,
        within: float | None = None,
    ) -> ContactPair:
        """Declare that points of the `moving` face stay outside the `reference` face (see ContactPair)."""
        for side, face in (("moving", moving), ("reference", reference)):
            _expect(f'contact "{name}": {side}', face, Face | Feature, 'part.face("+z"), or a feature')
        sides = face_of(moving), face_of(reference)
        self._pairs.append(ContactPair(name, *sides, points, spacing, within, script_line()))
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
        limits: Sequence[float | None] | None = None,
        absolute: bool | None = None,
        units: str = "mm",
    ) -> Measure:
        """Declare a measure of a point, of two points, or of a CasADi expression of the poses (see Measure)."""
        axis = None if along is None else direction(along)
        allowed = tuple(limits) if isinstance(limits, list | tuple) else limits
        self._measures.append(Measure(name, of, to, axis, tolerance, units, script_line(), allowed, absolute))  # type: ignore[arg-type]
        return self._measures[-1]

    def variable(self, name: str, tolerance: Any, *, drives: Mapping[str, float], units: str = "mm") -> Variable:
        """Declare a cause that several contributors share, each by a factor (see Variable)."""
        self._variables.append(Variable(name, _tolerance(tolerance), dict(drives), units, script_line()))
        return self._variables[-1]

    def correlate(self, labels: Sequence[str], matrix: Any) -> Correlation:
        """Declare that contributors are correlated: a matrix, or one coefficient for two of them (see Correlation)."""
        self._correlations.append(_correlation(labels, matrix, script_line()))
        return self._correlations[-1]

    def population(self, source: Any, columns: Mapping[str, str] | None = None) -> Population:
        """Declare that contributors are drawn from measured rows: a CSV file, a DataFrame, a Dataset (see Population)."""
        self._populations.append(_population(source, columns, script_line()))
        return self._populations[-1]

    def location_of(self, part: Part) -> Location | None:
        """How `part` is located; None if it is not."""
        return next((location for location in self._locations if location.part is part), None)

    def finest(self) -> float:
        """The smallest width of a tolerance zone [mm] of any locator, feature or measure; infinite if there is none.

        The width of a scipy.stats distribution is six standard deviations. A width below a thousandth of the widest one is
        taken for a constant, and does not count.
        """
        said = []
        for location in self._locations:
            own = [locator.tolerance for locator in location.scheme] if isinstance(location.scheme, tuple) else [None]
            said += [tolerance or location.tolerance for tolerance in own]
        widths = [tolerance.width for tolerance in said if tolerance is not None]
        sound = [each for feature in self.features for each in feature.tolerances if not any(each.faults())]
        widths += [each.tolerance.width if isinstance(each, Size) else float(each.width) for each in sound]
        widths += [float(m.width) for m in self._measures if m.width is not None and m.units == "mm"]
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
            yield from self._feature_faults(part)
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

        for kind, causes in (("variable", self._variables), ("correlation", self._correlations)):
            for cause in causes:
                yield from _named(kind, cause, cause.faults())
        for population in self._populations:
            yield from _named("population", population, population.faults())
        yield from key_faults("variable", [variable.name for variable in self._variables])

    def _feature_faults(self, part: Part) -> Iterator[str]:
        names = [feature.name for feature in part.features]
        yield from key_faults(f'part "{part.name}": feature', names)
        yield from repetitions(f'part "{part.name}": datum', [each.datum for each in part.features if each.datum])
        letters = {feature.datum for feature in part.features if feature.datum}
        for feature in part.features:
            yield from _named(f'part "{part.name}": feature', feature, feature.faults())
            for tolerance in feature.geometric:
                for letter in [letter for place in tolerance.system for letter in place]:
                    if letter not in letters:
                        known = ", ".join(sorted(letters)) or "none"
                        yield (
                            f'part "{part.name}": feature "{feature.name}" ({feature.declared_at}): {tolerance.kind} refers to '
                            f"datum {letter}, which no feature of the part is; its datums are: {known}; "
                            f'declare it with part.feature(..., datum="{letter}")'
                        )

    def _location_faults(self, part: Part) -> Iterator[str]:
        own = self.location_of(part)
        if own is not None and own.floating:
            if not any(part in (pair.moving.part, pair.reference.part) for pair in self._pairs):
                yield "it is floating, and in no contact pair, so nothing decides its place; declare its contacts"
            if part.fixed is True:
                yield "it is floating, so contact has to move it; leave fixed out"
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
        rows = [
            *self._parts,
            *self.features,
            *self._variables,
            *self._correlations,
            *self._populations,
            *self._locations,
            *self._pairs,
            *self._forces,
            *self._measures,
        ]
        return "\n".join([f"assembly {self.name}", *(f"  {row}" for row in rows)])


def _expect(what: str, value: Any, kind: Any, wanted: str) -> None:
    """Raise TypeError at the script's own line if an argument has a type that no other check could handle."""
    if not isinstance(value, kind):
        raise TypeError(f"{what} is a {type(value).__name__}; expected {wanted}")


def _named(kind: str, thing: Any, faults: Iterator[str], line: str = "") -> Iterator[str]:
    where = line or thing.declared_at
    return (f'{kind} "{thing.name}"{f" ({where})" if where else ""}: {fault}' for fault in faults)
