"""The declarations that an assembly and each of its stations take; stations, and what each of them holds."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, ClassVar, Literal, TypeVar

from tolcontact.declaration.checks import Declaration
from tolcontact.declaration.contact_pair import ContactPair, Force, Joint
from tolcontact.declaration.locator import Location, Locator, Placing, ThreeTwoOne
from tolcontact.declaration.measure import Measure
from tolcontact.declaration.measurement import Measurement
from tolcontact.declaration.part import Face, Feature, Part, Point, face_of
from tolcontact.declaration.tolerance import tolerance as _tolerance
from tolcontact.declaration.values import Direction, direction, script_line, vector as _vector
from tolcontact.user_functions import refuse_in_functions

T = TypeVar("T")
Line = Any  # the assembly that stations build; its module imports this one
SETTINGS = {"locations": "locate", "pairs": "contact", "measures": "measure", "forces": "force"}  # lists, and their methods


class Declarations:
    """The methods that declare how parts are located and fastened, where they touch, what presses them, what is measured."""

    _station = ""  # the name of the station; empty for an assembly without stations

    @property
    def assembly(self) -> Any:
        """The assembly that takes the declarations."""
        raise NotImplementedError

    def _add(self, name: str, thing: T) -> T:
        """Append a declaration to a list of the assembly and return it."""
        refuse_in_functions()
        self.assembly._declared[name].append(thing)
        return thing

    def locate(
        self, part: Part | Joint, scheme: ThreeTwoOne | Sequence[Locator], *, tolerance: Any = None,
        on: Part | Feature | Joint | None = None, floating: bool = False, placing: Placing = "first order",
    ) -> Location:  # fmt: skip
        """Locate a part by six locators, or by fewer if it is floating (see Location).

        part        the part; or a joint, which is located by points of its parts
        scheme      tc.three_two_one(...), or a list of tc.Locator
        tolerance   of each locator without one: the full width of its zone [mm], limit deviations ("±0.1", "+0.1/-0.05"), a
                    Tolerance, or a frozen scipy.stats distribution
        on          part that it is located on, or a feature of it, whose deviations it follows; by default the ground
        floating    True: contact and forces hold it in the directions that its locators leave open
        placing     "first order" (default), "exact", or "best fit" for more than six locators

        `model.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=0.2)`
        """
        expect("locate: the first argument", part, Part | Joint, "a part")
        expect(
            f'locate "{part.name}": on', on, Part | Feature | Joint | None, "a part, a feature of it, or None for the ground"
        )
        scheme = scheme if isinstance(scheme, ThreeTwoOne) else tuple(scheme)
        for locator in scheme if isinstance(scheme, tuple) else ():
            expect(f'locate "{part.name}": a locator', locator, Locator, "tc.Locator(name, point, direction)")
        zone = None if tolerance is None else _tolerance(tolerance)
        expect(f'locate "{part.name}": floating', floating, bool, "True or False")
        joint, part = (part.name, part.first) if isinstance(part, Joint) else ("", part)
        return self._add("locations", Location(
            part=part, scheme=scheme, tolerance=zone, on=on.first if isinstance(on, Joint) else on, declared_at=script_line(),
            floating=floating, station=self._station, joint=joint, placing=placing,
        ))  # fmt: skip

    def contact(
        self, name: str, *, moving: Face | Feature, reference: Face | Feature,
        points: int | Literal["vertices"] | None = None, spacing: float | None = None, within: float | None = None,
        mu: float | None = None, stiffness: float | None = None,
    ) -> ContactPair:  # fmt: skip
        """Declare that points of the `moving` face stay outside the `reference` face (see ContactPair).

        name        of the pair
        moving      face or feature with the contact points
        reference   face or feature that they stay outside of
        points      number of points, or "vertices" of the mesh; by default as many as the geometry needs
        spacing     distance of points [mm], in place of their number
        within      largest distance [mm] of the nominal faces at a point; by default a tenth of the part's diagonal
        mu          coefficient of friction, for tc.analyses.seating alone
        stiffness   [N/mm] of a compliant pair; by default the faces are rigid

        `model.contact("seat", moving=lid.face("-z"), reference=base.face("+z"), spacing=5)`
        """
        for side, face in (("moving", moving), ("reference", reference)):
            expect(f'contact "{name}": {side}', face, Face | Feature, 'part.face("+z"), or a feature')
        return self._add("pairs", ContactPair(
            name=name, moving=face_of(moving), reference=face_of(reference), points=points, spacing=spacing, within=within,
            mu=mu, stiffness=stiffness, declared_at=script_line(), station=self._station,
        ))  # fmt: skip

    def force(self, name: str, *, at: Point, vector: Any, tolerance: Any = None) -> Force:
        """Declare a force, which acts with the objective "seating" (see Force).

        name       of the force
        at         point of a part at which it acts
        vector     (x, y, z) [N] in the assembly frame
        tolerance  of its magnitude [N], which is then a variable of this name; by default the force is constant

        `model.force("weight", at=lid.point(50, 30, 4), vector=(0, 0, -20))`
        """
        expect(f'force "{name}": at', at, Point, "part.point(x, y, z)")
        if tolerance is not None:
            self.assembly.variable(name, tolerance, units="N", loads={name: 1.0})
        line, station = script_line(), self._station
        return self._add("forces", Force(name=name, at=at, vector=_vector(vector), declared_at=line, station=station))

    def measure(
        self, name: str, of: Point | Measurement | Callable[[Any], Any], *, to: Point | None = None,
        along: Direction | None = None, tolerance: Any = None, limits: Sequence[float | None] | None = None,
        absolute: bool | None = None, units: str | None = None,
    ) -> Measure:  # fmt: skip
        """Declare a measure (see Measure).

        name        of the measure
        of          a point, a measurement such as tc.Gap(...), or a function of the poses that returns a CasADi expression
        to          a second point: the measure is a distance, in place of a displacement
        along       direction "x", "y", "z" or a vector, of a displacement or a distance
        tolerance   width of its limits about the nominal value [mm or rad], or "+0.2/-0.1"
        limits      (lower, upper) values in place of a tolerance; None for an open side
        absolute    True: values are coordinates or distances; False: they are differences from nominal
        units       of its values and limits: "in", "um", ... for lengths, by default the assembly's; "deg" for angles,
                    by default "rad"; of a function, what it returns, by default mm

        `model.measure("flush", lid.point(100, 30, 4), to=base.point(100, 30, 24), along="x", limits=(-0.2, 0.2))`
        """
        axis = None if along is None else direction(along)
        if units is None:
            earlier = {measure.name: measure.units for measure in self.assembly.measures}
            units = min(of.units_among(earlier), default="mm") if isinstance(of, Measurement) else "mm"
            is_plain = isinstance(of, Point) or (isinstance(of, Measurement) and not of.names)
            units = self.assembly.units if units == "mm" and is_plain else units
        bounds: Any = tuple(limits) if isinstance(limits, list | tuple) else limits
        return self._add("measures", Measure(
            name, of, to=to, along=axis, tolerance=tolerance, units=units, limits=bounds, absolute=absolute,
            declared_at=script_line(), station=self._station,
        ))  # fmt: skip


def expect(label: str, value: Any, kind: Any, expected: str) -> None:
    """Raise TypeError at the script's own line if an argument has a type that no other check could handle."""
    if not isinstance(value, kind):
        raise TypeError(f"{label} is a {type(value).__name__}; expected {expected}")


class Station(Declarations, Declaration):
    """A step of building or measuring an assembly: `assembly.station(name)` declares it, in the order of the steps.

    Parts and joints are located again in each station; a station that only measures is an inspection. Features belong to parts:
    their deviations are equal in all stations. A locator is a separate contributor in each station, "weld.panel.A1".
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

    def join(self, name: str, *bodies: Part | Joint, at: Sequence[Point] = (), pad: float | None = None) -> Joint:
        """Declare that `bodies`, parts or joints of earlier stations, are joined at the end of this station; return the joint.

        `weld.join("rail", left, right)` has the `name` "rail". Later stations locate the joint by points of any of its parts.
        Elastic parts are joined `at` points of one of them, each over a `pad` [mm] (see Joint).
        """
        for body in bodies:
            expect(f'join "{name}": a body', body, Part | Joint, "parts and joints, as in weld.join(name, left, right)")
        for point in at:
            expect(f'join "{name}": a point', point, Point, "part.point(x, y, z)")
        parts = tuple(part for body in bodies for part in (body.members if isinstance(body, Joint) else (body,)))
        return self._add("joints", Joint(name, parts, self.name, script_line(), tuple(at), pad))

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


def joined_before(line: Line, station: Station) -> dict[Part, Joint]:
    """Return the joint of each part that is joined when a station begins: the latest one."""
    names = [earlier.name for earlier in line.stations[: line.stations.index(station)]]
    # Two joints of one station are a fault; the first one counts.
    joints = [joint for name in names for joint in reversed(line.joints) if joint.station == name]
    return {part: joint for joint in joints for part in joint.members}


def settings_of(line: Line, station: Station) -> dict[str, list[Any]]:
    """Return the declarations of a station by the name of their list."""
    return {name: [thing for thing in getattr(line, name) if thing.station == station.name] for name in SETTINGS}


def in_order(line: Line) -> dict[str, list[Any]]:
    """Return the declarations of all stations by the name of their list, station by station."""
    return {name: [thing for station in line.stations for thing in settings_of(line, station)[name]] for name in SETTINGS}


def present_parts(line: Line, station: Station) -> tuple[Part, ...]:
    """Return the parts in a station: those that it locates, with all parts of their joints, and fixed ones that it mentions.

    Parts that no station holds are in the first one.
    """
    present = _held_parts(line, station)
    if station is line.stations[0]:
        held = {part for other in line.stations for part in _held_parts(line, other)}
        present |= {part for part in line.parts if part not in held}
    return tuple(part for part in line.parts if part in present)


def _held_parts(line: Line, station: Station) -> set[Part]:
    joined, settings = joined_before(line, station), settings_of(line, station)
    located = {
        part
        for location in settings["locations"]
        for part in (joined[location.part].members if location.part in joined else (location.part,))
    }
    mentioned = {part for things in settings.values() for thing in things for part in thing.parts}
    return {part for part in line.parts if part in located or (part.fixed is True and part in mentioned)}
