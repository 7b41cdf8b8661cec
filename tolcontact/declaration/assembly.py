"""The assembly: it collects declarations in the order of a script."""

import math
from collections.abc import Iterable, Iterator
from typing import Any, ClassVar, Generic, TypeVar, get_args

from tolcontact.declaration.checks import FRICTION, Checked, one_of
from tolcontact.declaration.contact_pair import ContactPair, Force, Joint, Overlap
from tolcontact.declaration.declarations import expect
from tolcontact.declaration.dependence import Correlation, Variable
from tolcontact.declaration.elastic import gravity_faults
from tolcontact.declaration.geometry import UNITS, Geometry
from tolcontact.declaration.locator import Location
from tolcontact.declaration.measure import Measure
from tolcontact.declaration.mirroring import Mirroring
from tolcontact.declaration.part import Feature, Part, Standard
from tolcontact.declaration.population import Population
from tolcontact.declaration.sequence import Station, in_order, joined_before, present_parts, sequence_faults, settings_of
from tolcontact.declaration.size import Size
from tolcontact.declaration.title_block import TitleBlock
from tolcontact.declaration.values import (
    Mirror,
    Vector,
    group_faults,
    key_faults,
    repetitions,
    script_line,
    text_faults,
    vector as _vector,
)
from tolcontact.declaration.widening import widened
from tolcontact.method import Method
from tolcontact.readable import Pictured
from tolcontact.user_functions import refuse_in_functions

T = TypeVar("T")

CONSTANT_SHARE = 1e-3  # of the widest zone: a narrower one counts as a constant
MAX_COUNTS = {  # of what an assembly declares
    "parts": 1000, "locations": 1000, "pairs": 5000, "measures": 2000, "forces": 5000, "variables": 5000, "correlations": 5000,
    "populations": 1000, "stations": 60, "joints": 1000, "overlaps": 1000,
}  # fmt: skip


class Declared(Generic[T]):
    """A view of one of the lists of an assembly: a tuple in the order of the script."""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, assembly: Any, owner: type) -> tuple[T, ...]:
        return self if assembly is None else tuple(assembly._declared[self._name])  # type: ignore[return-value]


class Assembly(Mirroring, Pictured, Checked):
    """Parts, how they are located, which faces may touch, and what is measured. Lengths in mm, angles in rad.

    `tc.Assembly("clamp", mu=0.15)` has the `name` "clamp", which reports and archives show. The methods only record
    declarations; `faults()` lists everything that is wrong with them. `method` states how contact in this model is resolved; a
    run may state another one. `title_block` heads its reports. `mu` is the coefficient of friction of all contacts;
    `tc.analyses.seating` uses it. `standard` is that of the drawings, "ISO" or "ASME": under ISO the zones of a pattern are
    separate, and sizes do not limit form; under ASME zones are combined, and form is inside the envelope of sizes. Without
    one, zones are combined, and sizes do not limit form. `units` are those of its measured lengths; all that is declared stays
    in mm, but for texts such as "±0.005 in". Raises TypeError for an argument of a wrong type.
    """

    checks: ClassVar = {"mu": FRICTION, "standard": one_of(get_args(Standard))}
    parts = Declared[Part]()
    locations = Declared[Location]()
    pairs = Declared[ContactPair]()
    measures = Declared[Measure]()
    forces = Declared[Force]()
    variables = Declared[Variable]()
    correlations = Declared[Correlation]()
    populations = Declared[Population]()
    stations = Declared[Station]()
    joints = Declared[Joint]()
    overlaps = Declared[Overlap]()

    def __init__(
        self,
        name: str,
        *,
        method: Method | None = None,
        title_block: TitleBlock | None = None,
        mu: float | None = None,
        standard: Standard = "",
        units: str = "mm",
    ) -> None:
        for option, value, kind in (("method", method, Method), ("title_block", title_block, TitleBlock)):
            expect(f'assembly "{name}": {option}', value, kind | None, f"tc.{kind.__name__}(...)")
        self.name, self.method, self.title_block = name, method, title_block
        self.mu, self.standard, self.units = mu, standard, units
        self.acceleration: Vector | None = None
        self._declared: dict[str, list[Any]] = {name: [] for name in MAX_COUNTS}

    @property
    def assembly(self) -> "Assembly":
        return self

    @property
    def effective_method(self) -> Method:
        """The method of the assembly; without one, the default, by which forces seat the parts, and bend elastic ones."""
        presses = self.forces or any(part.elasticity for part in self.parts)
        return self.method or Method(objective="seating" if presses else "")

    def widened(self, factor: float, *names: str) -> "Assembly":
        """Return a copy whose tolerances are `factor` times as wide, each about its centre, as if suppliers were worse.

        `tc.run(model.widened(1.2, "cover"))`: `names` choose the tolerances of parts, of single locators and features
        ("part.feature"), and of variables; by default all are widened. Populations stay as measured, and Cp and Cpk unchanged.
        Both models have the same draws, so that tc.compare is by pairs. Raises ValueError for an unknown name.
        """
        return widened(self, factor, names)  # type: ignore[no-any-return]

    def replaced(self, **lists: Iterable[Any]) -> "Assembly":
        """Return a copy with other lists, as in replaced(parts=..., pairs=...). Raises TypeError for other names."""
        copy = Assembly(self.name, method=self.method, title_block=self.title_block, mu=self.mu, standard=self.standard)
        copy.units, copy.acceleration = self.units, self.acceleration
        copy._declared |= {name: list(lists.pop(name, things)) for name, things in self._declared.items()}
        if lists:
            raise TypeError(f"an assembly has no list {', '.join(lists)}; its lists are: {', '.join(MAX_COUNTS)}")
        return copy

    @property
    def standards(self) -> str:
        """The standards of the drawings as archives state them: one for all parts, or by part; empty if none is stated."""
        stated = dict.fromkeys(part.standard for part in self.parts)
        if len(stated) < 2:
            return next(iter(stated), "")
        return ", ".join(f"{part.name} {part.standard}" for part in self.parts if part.standard)

    @property
    def features(self) -> tuple[Feature, ...]:
        """The features of all parts, part by part, among them the members of patterns."""
        return tuple(feature for part in self.parts for feature in part.features)

    def part(
        self,
        name: str,
        geometry: Geometry,
        *,
        at: Any = (0, 0, 0),
        rotation: Any = (0, 0, 0),
        fixed: bool | None = None,
        standard: Standard = "",
        mirror: Mirror = "",
    ) -> Part:
        """Declare a part (see Part).

        name       of the part; it also names groups of archives
        geometry   its shape: tc.Box(x, y, z), tc.Pin(diameter, length) or tc.Mesh(file)
        at         (x, y, z) [mm] of its frame in the nominal assembly; by default the origin
        rotation   rotation vector [rad], by default 0; tc.degrees(0, 0, 90) is a quarter turn about z
        fixed      True: contact does not move it; None (default): it is free if it is the moving side of a pair (see Part)
        standard   of its drawing, "ISO" or "ASME"; by default the assembly's
        mirror     axis of its frame that is reversed, "x", "y" or "z": the part is a mirror image (see `mirrored`)

        `block = model.part("block", tc.Box(60, 40, 20), at=(30, 20, 10))`
        """
        expect(f'part "{name}": geometry', geometry, Geometry, "tc.Box(x, y, z) or tc.Mesh(file)")
        expect(f'part "{name}": fixed', fixed, bool | None, "True, False or None")
        standard = standard or self.standard
        return self._add("parts", Part(name, geometry, _vector(at), _vector(rotation), fixed, standard, script_line(), mirror))

    def station(self, name: str) -> Station:
        """Declare the next station, of this `name`, of an assembly that is built in steps: `weld = line.station("weld")`."""
        return self._add("stations", Station(name, script_line()).belonging_to(self))

    def gravity(self, acceleration: Any) -> None:
        """Declare the `acceleration` [m/s^2] by which elastic parts weigh, in all stations: `model.gravity((0, 0, -9.81))`."""
        refuse_in_functions()
        self.acceleration = _vector(acceleration)

    def may_overlap(self, *parts: Part) -> Overlap:
        """Declare that parts, any two of them, are meant to overlap, as in `model.may_overlap(shaft, hub)` (see Overlap)."""
        for part in parts:
            expect("may_overlap: an argument", part, Part, "parts, as in may_overlap(shaft, hub)")
        return self._add("overlaps", Overlap(parts, script_line()))

    def location_of(self, part: Part) -> Location | None:
        """Return the location of `part`; None for a part that is not located."""
        return next((location for location in self.locations if location.part is part), None)

    @property
    def scenes(self) -> "tuple[Assembly, ...]":
        """The models of the stations, in their order; an assembly without stations is its only scene."""
        return tuple(map(self._scene, self.stations)) or (self,)

    @property
    def in_station_order(self) -> "Assembly":
        """The same assembly with its declarations station by station; an assembly without stations itself."""
        return self.replaced(**in_order(self)) if self.stations else self

    def _scene(self, station: Station) -> "Assembly":
        """Return the model of a station: the parts that it holds, what it declares, and the joints that it locates."""
        parts, joined = present_parts(self, station), joined_before(self, station)
        joints = dict.fromkeys(joined[part] for part in parts if part in joined)
        none = dict.fromkeys(("stations", "variables", "correlations", "populations"), ())
        return self.replaced(parts=parts, joints=joints, **settings_of(self, station), **none)

    def body_of(self, part: Part) -> tuple[Part, ...]:
        """Return the parts of the rigid body of a part in a scene; its pose is the pose of the first one."""
        return next((joint.members for joint in self.joints if part in joint.members), (part,))

    def support_chain(self, part: Part) -> tuple[Part, ...]:
        """Return the first part of a part's body, the first one of the body that it is located on, and so on to the ground.

        A circle of locations ends with the part that closes it, which is in the chain twice.
        """
        chain: list[Part] = []
        support: Part | None = part
        while support is not None:
            carrier = self.body_of(support)[0]
            is_closed = carrier in chain
            chain.append(carrier)
            location = None if is_closed else self.location_of(carrier)
            support = location.parent if location else None
        return tuple(chain)

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
        measures = [measure for measure in self.measures if measure.units in UNITS and not any(measure.faults())]
        widths += [float(measure.width) * UNITS[measure.units] for measure in measures if measure.width is not None]
        return min((width for width in widths if width > CONSTANT_SHARE * max(widths)), default=math.inf)

    def omissions(self) -> Iterator[str]:
        """Yield the faults of a model that is not complete yet: declarations that only a run needs."""
        if not self.measures:
            yield "it measures nothing; declare at least one measurement with assembly.measure(...)"
        advice = "it is not located; call locate(...), or declare it fixed=True to hold it at its nominal place"
        for part in self.parts:
            if self.location_of(part) is None and part.fixed is not True:
                yield from part.located_faults(iter([advice]))

    def faults(self) -> Iterator[str]:
        """Yield the faults of the declarations, among them omissions: sentences that name a declaration and its script line."""
        if not (self.parts or self.variables):
            yield "it has no parts; declare at least one with assembly.part(name, geometry)"
        yield from self.omissions()
        yield from (*text_faults("assembly", [self.name]), *Checked.faults(self))
        yield from (f"title block: {fault}" for fault in (self.title_block.faults() if self.title_block else ()))
        yield from gravity_faults(self.acceleration, has_elastic=any(part.elasticity for part in self.parts))
        for name, most in MAX_COUNTS.items():
            if (count := len(self._declared[name])) > most:
                yield f"it has {count} {name}; expected at most {most}"
        keyed = {"part": "parts", "contact pair": "pairs", "measurement": "measures", "force": "forces"}
        for kind, name in keyed.items():
            yield from key_faults(kind, [thing.name for thing in self._declared[name]])
        yield from group_faults("part", [part.name for part in self.parts])
        for part in self.parts:
            yield from part.located_faults()
            if not self.stations:
                yield from part.located_faults(self._repetition_faults(part))
                yield from part.located_faults(self._location_faults(part))
            yield from self._feature_faults(part)
        things: tuple[Location | ContactPair | Force | Measure | Overlap, ...] = (
            *self.locations, *self.pairs, *self.forces, *self.measures, *self.overlaps,
        )  # fmt: skip
        for thing in things:
            yield from thing.located_faults()
            label = f'locators of "{thing.name}"' if isinstance(thing, Location) else f'{thing.noun} "{thing.name}"'
            yield from self._unknown_parts(f"{label} ({thing.declared_at})", *thing.parts)
        for cause in (*self.variables, *self.correlations, *self.populations):
            yield from cause.located_faults()
        yield from key_faults("variable", [variable.name for variable in self.variables])
        for number, measure in enumerate(self.measures):
            earlier = [other for other in self.measures[:number] if other.station == measure.station]
            yield from measure.located_faults(measure.reference_faults(earlier))
        if self.stations:
            yield from sequence_faults(self)
            for scene in self.scenes:
                yield from (fault for part in scene.parts for fault in part.located_faults(scene._location_faults(part)))

    def _feature_faults(self, part: Part) -> Iterator[str]:
        letters = [declared.datum for declared in part.toleranced if declared.datum] + [datum.letter for datum in part.targets]
        names = [declared.name for declared in dict.fromkeys((*part.toleranced, *part.features))]
        yield from key_faults(f'part "{part.name}": feature', names)
        yield from repetitions(f'part "{part.name}": datum', letters)
        for datum in part.targets:
            yield from datum.located_faults(owner=f'part "{part.name}": ')
            for feature in datum.features:
                if feature not in part.features:
                    yield (
                        f'part "{part.name}": datum "{datum.letter}" ({datum.declared_at}): its target is on feature '
                        f'"{feature.name}", which is no feature of the part; take one of the part'
                    )
        for declared in part.toleranced:
            yield from declared.located_faults(owner=f'part "{part.name}": ')
            for tolerance in declared.geometric:
                for letter in tolerance.letters:
                    if letter not in letters:
                        datums = ", ".join(sorted(set(letters))) or "none"
                        yield (
                            f'part "{part.name}": {declared.designation}: {tolerance.kind} refers to '
                            f"datum {letter}, which no feature of the part is; its datums are: {datums}; "
                            f'declare it with part.feature(..., datum="{letter}")'
                        )

    def _repetition_faults(self, part: Part) -> Iterator[str]:
        count = sum(location.part is part for location in self.locations)
        if count > 1:
            yield f"it is located {count} times; locate it once"

    def _location_faults(self, part: Part) -> Iterator[str]:
        location = self.location_of(part)
        if location is not None and location.floating:
            body = self.body_of(part)
            touches = any(side.part in body for pair in self.pairs for side in (pair.moving, pair.reference))
            if not (touches or location.has_supports):
                yield (
                    "it is floating, in no contact pair and on no one-sided locator, so nothing decides its place; "
                    "declare its contacts"
                )
            if part.fixed is True:
                yield "it is floating, so contact has to move it; leave fixed out"
        first, *rest = self.support_chain(part)
        if first in rest:
            circle = " on ".join(f'"{link.name}"' for link in (first, *rest))
            yield f"it is located on itself: {circle}; locate one of them on another part, or on the ground"

    def _unknown_parts(self, label: str, *parts: Part | None) -> Iterator[str]:
        for part in parts:
            if part is not None and not any(part is member for member in self.parts):
                names = ", ".join(member.name for member in self.parts) or "none"
                yield f'{label}: unknown part "{getattr(part, "name", part)}"; the parts of "{self.name}" are: {names}'

    def __str__(self) -> str:
        causes = *self.variables, *self.correlations, *self.populations
        declared = (row for part in self.parts for row in (*part.toleranced, *part.targets, *filter(None, [part.elasticity])))
        rows = *self.parts, *declared, *causes, *self.locations, *self.pairs, *self.overlaps, *self.forces, *self.measures
        for scene, station in zip(self.scenes, self.stations, strict=False):
            settings = *scene.locations, *scene.pairs, *scene.forces, *scene.measures
            joined = [joint for joint in self.joints if joint.station == station.name]
            rows = *(row for row in rows if row not in settings), station, *settings, *joined
        return "\n".join([f"assembly {self.name}", *(f"  {row}" for row in rows)])
