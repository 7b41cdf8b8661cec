"""The assembly: it collects declarations in the order of a script."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Generic, TypeVar

from tolcontact.declaration.contact_pair import ContactPair
from tolcontact.declaration.contributor import (
    Correlation,
    Population,
    Variable,
    correlation as _correlation,
    population as _population,
)
from tolcontact.declaration.force import Force
from tolcontact.declaration.geometry import Geometry
from tolcontact.declaration.locator import Location, Locator, ThreeTwoOne
from tolcontact.declaration.measure import Measure
from tolcontact.declaration.measurement import Measurement
from tolcontact.declaration.part import Face, Feature, Part, Point, face_of
from tolcontact.declaration.size import Size
from tolcontact.declaration.title_block import TitleBlock
from tolcontact.declaration.tolerance import tolerance as _tolerance
from tolcontact.declaration.values import (
    direction,
    friction_faults,
    key_faults,
    repetitions,
    script_line,
    text_faults,
    vector as _vector,
)
from tolcontact.later import FASTENER, LATER
from tolcontact.method import Method
from tolcontact.readable import Pictured

T = TypeVar("T")

CONSTANT_SHARE = 1e-3  # of the widest zone: a narrower one counts as a constant
MAX_COUNTS = {  # of what an assembly declares
    "parts": 1000, "locations": 1000, "pairs": 5000, "measures": 2000, "forces": 5000, "variables": 5000, "correlations": 5000,
    "populations": 1000,
}  # fmt: skip


class Declared(Generic[T]):
    """A view of one of the lists of an assembly: a tuple in the order of the script."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, assembly: Any, owner: type) -> tuple[T, ...]:
        return self if assembly is None else tuple(assembly._declared[self._name])  # type: ignore[return-value]


class Assembly(Pictured):
    """Parts, how they are located, which faces may touch, and what is measured. Lengths in mm, angles in rad.

    The methods only record declarations; `faults()` lists everything that is wrong with them. `method` states how contact in
    this model is resolved; a run may state another one. `title_block` heads its reports. `mu` is the coefficient of friction of
    all contacts, of which `tc.seating` makes use. Raises TypeError for an argument of a wrong type.
    """

    parts = Declared[Part]()
    locations = Declared[Location]()
    pairs = Declared[ContactPair]()
    measures = Declared[Measure]()
    forces = Declared[Force]()
    variables = Declared[Variable]()
    correlations = Declared[Correlation]()
    populations = Declared[Population]()

    def __init__(
        self, name: str, *, method: Method | None = None, title_block: TitleBlock | None = None, mu: float | None = None
    ) -> None:  # fmt: skip
        _expect(f'assembly "{name}": method', method, Method | None, "tc.Method(...)")
        _expect(f'assembly "{name}": title_block', title_block, TitleBlock | None, "tc.TitleBlock(...)")
        self.name = name
        self.method = method
        self.title_block = title_block
        self.mu = mu
        self._declared: dict[str, list[Any]] = {name: [] for name in MAX_COUNTS}

    def _add(self, name: str, thing: T) -> T:
        """Append a declaration to a list and return it."""
        self._declared[name].append(thing)
        return thing

    def replaced(self, **lists: Iterable[Any]) -> "Assembly":
        """Return a copy in which `lists` (parts=..., pairs=...) replace its lists. Raises TypeError for other names."""
        copy = Assembly(self.name, method=self.method, title_block=self.title_block, mu=self.mu)
        copy._declared |= {name: list(lists.pop(name, things)) for name, things in self._declared.items()}
        if lists:
            raise TypeError(f"an assembly has no list {', '.join(lists)}; its lists are: {', '.join(MAX_COUNTS)}")
        return copy

    @property
    def features(self) -> tuple[Feature, ...]:
        """The features of all parts, part by part, among them the members of patterns."""
        return tuple(feature for part in self.parts for feature in part.features)

    def part(
        self, name: str, geometry: Geometry, *, at: Any = (0, 0, 0), rotation: Any = (0, 0, 0), fixed: bool | None = None
    ) -> Part:  # fmt: skip
        """Declare a part: its shape, its position `at` [mm] and rotation vector [rad] in the nominal assembly (see Part)."""
        _expect(f'part "{name}": geometry', geometry, Geometry, "tc.Box(x, y, z) or tc.Mesh(file)")
        _expect(f'part "{name}": fixed', fixed, bool | None, "True, False or None")
        return self._add("parts", Part(name, geometry, _vector(at), _vector(rotation), fixed, script_line()))

    def locate(
        self,
        part: Part,
        scheme: ThreeTwoOne | Sequence[Locator],
        *,
        tolerance: Any = None,
        on: Part | Feature | None = None,
        floating: bool = False,
    ) -> Location:
        """Locate a part by six locators, or by fewer if it is `floating`, on the ground or `on` another part (see Location).

        On a feature of another part, it also follows the deviations of that feature.
        `tolerance` applies to each locator without a tolerance: the full width of its zone [mm], limit deviations ("±0.1",
        "+0.1/-0.05"), a Tolerance, or a frozen scipy.stats distribution.
        """
        _expect("locate: the first argument", part, Part, "a part")
        _expect(f'locate "{part.name}": on', on, Part | Feature | None, "a part, a feature of it, or None for the ground")
        scheme = scheme if isinstance(scheme, ThreeTwoOne) else tuple(scheme)
        for locator in scheme if isinstance(scheme, tuple) else ():
            _expect(f'locate "{part.name}": a locator', locator, Locator, "tc.Locator(name, point, direction)")
        zone = None if tolerance is None else _tolerance(tolerance)
        _expect(f'locate "{part.name}": floating', floating, bool, "True or False")
        return self._add("locations", Location(part, scheme, zone, on, script_line(), floating))

    def contact(
        self, name: str, *, moving: Face | Feature, reference: Face | Feature, points: int | str | None = None,
        spacing: float | None = None, within: float | None = None, mu: float | None = None,
    ) -> ContactPair:  # fmt: skip
        """Declare that points of the `moving` face stay outside the `reference` face (see ContactPair)."""
        for side, face in (("moving", moving), ("reference", reference)):
            _expect(f'contact "{name}": {side}', face, Face | Feature, 'part.face("+z"), or a feature')
        sides = face_of(moving), face_of(reference)
        return self._add("pairs", ContactPair(name, *sides, points, spacing, within, script_line(), mu))

    def fasten(
        self,
        name: str,
        fastener: Part | Face | Feature | Size | float,
        *,
        through: Sequence[Face | Feature],
        into: Face | Feature | None = None,
        seat: Face | Feature | None = None,
        pushed: Any = None,
        drift: bool = False,
    ) -> Part:
        """Declare a fastener in the holes of several parts, and return its part (see `tolcontact.fasteners`).

        fastener   its diameter or its tc.Size, and a part is made; or a part, or the face of its shank
        through    the holes that it passes through, from its head on
        into       a threaded or press-fit hole, which holds it; without one it floats in the clearance of its holes
        seat       the plane under its head
        pushed     a force (x, y, z) [N], in the assembly frame, on a fastener that floats
        drift      whether it stands anywhere in the clearance of its tightest hole, where contact allows, all places alike

        Raises ModelError if the fastener does not fit into the nominal assembly.
        """
        part: Part = LATER[FASTENER](self, name, fastener, through=through, into=into, seat=seat, pushed=pushed, drift=drift)
        return part

    def force(self, name: str, *, at: Point, vector: Any) -> Force:
        """Declare a force `vector` [N], in the assembly frame, at a point of a part (see Force)."""
        _expect(f'force "{name}": at', at, Point, "part.point(x, y, z)")
        return self._add("forces", Force(name, at, _vector(vector), script_line()))

    def measure(
        self,
        name: str,
        of: Point | Measurement | Callable[[Any], Any],
        *,
        to: Point | None = None,
        along: Any = None,
        tolerance: Any = None,
        limits: Sequence[float | None] | None = None,
        absolute: bool | None = None,
        units: str | None = None,
    ) -> Measure:
        """Declare a measure of a point, of two points, of a measurement, or of a CasADi expression of the poses (see Measure).

        `units` are those of an expression, by default mm. A measurement has its own.
        """
        axis = None if along is None else direction(along)
        if units is None:
            units = min(of.units_among(self._units), default="mm") if isinstance(of, Measurement) else "mm"
        bounds: Any = tuple(limits) if isinstance(limits, list | tuple) else limits
        return self._add("measures", Measure(name, of, to, axis, tolerance, units, script_line(), bounds, absolute))

    def variable(self, name: str, tolerance: Any, *, drives: Mapping[str, float], units: str = "mm") -> Variable:
        """Declare a cause that drives several contributors, each by a factor (see Variable)."""
        return self._add("variables", Variable(name, _tolerance(tolerance), dict(drives), units, script_line()))

    def correlate(self, labels: Sequence[str], matrix: Any) -> Correlation:
        """Declare that contributors are correlated: a matrix, or one coefficient for two of them (see Correlation)."""
        return self._add("correlations", _correlation(labels, matrix, script_line()))

    def population(self, source: Any, columns: Mapping[str, str] | None = None) -> Population:
        """Declare that contributors are drawn from measured rows: a CSV file, a DataFrame, a Dataset (see Population)."""
        return self._add("populations", _population(source, columns, script_line()))

    @property
    def _units(self) -> dict[str, str]:
        return {measure.name: measure.units for measure in self.measures}

    def location_of(self, part: Part) -> Location | None:
        """Return the location of `part`; None for a part that is not located."""
        return next((location for location in self.locations if location.part is part), None)

    def smallest_zone(self) -> float:
        """Return the smallest width of a tolerance zone [mm] of any locator, feature or measure; infinite without a zone.

        The width of a scipy.stats distribution is six standard deviations. A width below a thousandth of the widest one
        counts as a constant, and is left out.
        """
        zones = []
        for location in self.locations:
            scheme = [locator.tolerance for locator in location.scheme] if isinstance(location.scheme, tuple) else [None]
            zones += [zone or location.tolerance for zone in scheme]
        widths = [zone.width for zone in zones if zone is not None]
        sound = [control for feature in self.features for control in feature.tolerances if not any(control.faults())]
        widths += [control.tolerance.width if isinstance(control, Size) else float(control.width) for control in sound]
        measures = [measure for measure in self.measures if measure.units == "mm" and not any(measure.faults())]
        widths += [float(measure.width) for measure in measures if measure.width is not None]
        return min((width for width in widths if width > CONSTANT_SHARE * max(widths)), default=math.inf)

    def omissions(self) -> Iterator[str]:
        """Yield the faults of a model that is not complete yet: declarations that only a run needs."""
        if not self.measures:
            yield "it measures nothing; declare at least one measure with assembly.measure(...)"
        for part in self.parts:
            if self.location_of(part) is None and part.fixed is not True:
                advice = "it is not located; call locate(...), or declare it fixed=True to hold it at its nominal place"
                yield from _located("part", part, iter([advice]))

    def faults(self) -> Iterator[str]:
        """Yield the faults of the declarations, among them omissions: sentences that name a declaration and its script line."""
        if not self.parts:
            yield "it has no parts; declare at least one with assembly.part(name, geometry)"
        yield from self.omissions()
        yield from (*text_faults("assembly", [self.name]), *friction_faults(self.mu))
        yield from (f"title block: {fault}" for fault in (self.title_block.faults() if self.title_block else ()))
        for name, most in MAX_COUNTS.items():
            if (count := len(self._declared[name])) > most:
                yield f"it has {count} {name}; expected at most {most}"
        keyed = {"part": "parts", "contact pair": "pairs", "measure": "measures", "force": "forces"}
        for kind, name in keyed.items():
            yield from key_faults(kind, [thing.name for thing in self._declared[name]])
        for part in self.parts:
            yield from _located("part", part, part.faults())
            yield from _located("part", part, self._location_faults(part))
            yield from self._feature_faults(part)
        for location in self.locations:
            yield from _located("part", location.part, location.faults(), location.declared_at)
            mentioned = location.part, location.parent, *location.mentioned
            yield from self._unknown_parts(f'locators of "{location.part.name}"', location.declared_at, *mentioned)
        references: list[tuple[str, Any, Iterable[Part]]] = [
            *(("contact pair", pair, (*pair.moving.parts, *pair.reference.parts)) for pair in self.pairs),
            *(("force", force, (force.at.part,)) for force in self.forces),
            *(("measure", measure, measure.parts) for measure in self.measures),
            *(("variable", variable, ()) for variable in self.variables),
            *(("correlation", correlation, ()) for correlation in self.correlations),
            *(("population", population, ()) for population in self.populations),
        ]
        for kind, thing, parts in references:
            yield from _located(kind, thing, thing.faults())
            yield from self._unknown_parts(f'{kind} "{thing.name}"', thing.declared_at, *parts)
        yield from key_faults("variable", [variable.name for variable in self.variables])
        for number, measure in enumerate(self.measures):
            yield from _located("measure", measure, measure.reference_faults(self.measures[:number]))

    def _feature_faults(self, part: Part) -> Iterator[str]:
        letters = [declared.datum for declared in part.toleranced if declared.datum] + [datum.letter for datum in part.targets]
        names = [declared.name for declared in dict.fromkeys((*part.toleranced, *part.features))]
        yield from key_faults(f'part "{part.name}": feature', names)
        yield from repetitions(f'part "{part.name}": datum', letters)
        for datum in part.targets:
            yield from _located(f'part "{part.name}": datum', datum, datum.faults())
            for feature in datum.features:
                if feature not in part.features:
                    yield (
                        f'part "{part.name}": datum "{datum.letter}" ({datum.declared_at}): its target is on feature '
                        f'"{feature.name}", which is no feature of the part; take one of the part'
                    )
        for declared in part.toleranced:
            kind = f'part "{part.name}": {declared.noun}'
            yield from _located(kind, declared, declared.faults())
            for tolerance in declared.geometric:
                for letter in [letter for compartment in tolerance.system for letter in compartment]:
                    if letter not in letters:
                        datums = ", ".join(sorted(set(letters))) or "none"
                        yield (
                            f'{kind} "{declared.name}" ({declared.declared_at}): {tolerance.kind} refers to '
                            f"datum {letter}, which no feature of the part is; its datums are: {datums}; "
                            f'declare it with part.feature(..., datum="{letter}")'
                        )

    def _location_faults(self, part: Part) -> Iterator[str]:
        location = self.location_of(part)
        if location is not None and location.floating:
            if not any(part in (pair.moving.part, pair.reference.part) for pair in self.pairs):
                yield "it is floating, and in no contact pair, so nothing decides its place; declare its contacts"
            if part.fixed is True:
                yield "it is floating, so contact has to move it; leave fixed out"
        count = sum(location.part is part for location in self.locations)
        if count > 1:
            yield f"it is located {count} times; locate it once"
        chain: list[Part] = []
        support: Part | None = part
        while support is not None:
            if support in chain:
                yield f"it is located on itself, through {' on '.join(link.name for link in chain)}; break the circle"
                return
            chain.append(support)
            location = self.location_of(support)
            support = location.parent if location else None

    def _unknown_parts(self, label: str, line: str, *parts: Part | None) -> Iterator[str]:
        for part in parts:
            if part is not None and not any(part is member for member in self.parts):
                names = ", ".join(member.name for member in self.parts) or "none"
                yield f'{label} ({line}): unknown part "{getattr(part, "name", part)}"; the parts of "{self.name}" are: {names}'

    def __str__(self) -> str:
        causes = *self.variables, *self.correlations, *self.populations
        declared = (row for part in self.parts for row in (*part.toleranced, *part.targets))
        rows = *self.parts, *declared, *causes, *self.locations, *self.pairs, *self.forces, *self.measures
        return "\n".join([f"assembly {self.name}", *(f"  {row}" for row in rows)])


def _expect(label: str, value: Any, kind: Any, expected: str) -> None:
    """Raise TypeError at the script's own line if an argument has a type that no other check could handle."""
    if not isinstance(value, kind):
        raise TypeError(f"{label} is a {type(value).__name__}; expected {expected}")


def _located(kind: str, thing: Any, faults: Iterator[str], line: str = "") -> Iterator[str]:
    """Return faults that begin with the name and the script line of a declaration."""
    line = line or thing.declared_at
    return (f'{kind} "{thing.name}"{f" ({line})" if line else ""}: {fault}' for fault in faults)
