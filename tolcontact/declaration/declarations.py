"""The declarations that an assembly and each of its stations take: locations, contact pairs, forces and measures."""

from collections.abc import Callable, Sequence
from typing import Any, Literal, TypeVar

from tolcontact.declaration.contact_pair import ContactPair, Force, Joint
from tolcontact.declaration.locator import Location, Locator, Placing, ThreeTwoOne
from tolcontact.declaration.measure import Measure
from tolcontact.declaration.measurement import Measurement
from tolcontact.declaration.part import Face, Feature, Part, Point, face_of
from tolcontact.declaration.tolerance import tolerance as _tolerance
from tolcontact.declaration.values import Direction, direction, script_line, vector as _vector
from tolcontact.user_functions import refuse_in_functions

T = TypeVar("T")


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
        self,
        part: Part | Joint,
        scheme: ThreeTwoOne | Sequence[Locator],
        *,
        tolerance: Any = None,
        on: Part | Feature | Joint | None = None,
        floating: bool = False,
        placing: Placing = "first order",
    ) -> Location:
        """Locate a part by six locators, or by fewer if it is `floating`, on the ground or `on` another part (see Location).

        On a feature of another part, it also follows the deviations of that feature. A joint is located by points of its parts.
        `tolerance` applies to each locator without a tolerance: the full width of its zone [mm], limit deviations ("±0.1",
        "+0.1/-0.05"), a Tolerance, or a frozen scipy.stats distribution.
        `placing` is "first order", "exact" or "best fit".
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
        ground = on.first if isinstance(on, Joint) else on
        location = Location(
            part=part, scheme=scheme, tolerance=zone, on=ground, declared_at=script_line(), floating=floating,
            station=self._station, joint=joint, placing=placing,
        )  # fmt: skip
        return self._add("locations", location)

    def contact(
        self,
        name: str,
        *,
        moving: Face | Feature,
        reference: Face | Feature,
        points: int | Literal["vertices"] | None = None,
        spacing: float | None = None,
        within: float | None = None,
        mu: float | None = None,
        stiffness: float | None = None,
    ) -> ContactPair:
        """Declare that points of the `moving` face stay outside the `reference` face (see ContactPair)."""
        for side, face in (("moving", moving), ("reference", reference)):
            expect(f'contact "{name}": {side}', face, Face | Feature, 'part.face("+z"), or a feature')
        pair = ContactPair(
            name=name, moving=face_of(moving), reference=face_of(reference), points=points, spacing=spacing, within=within,
            mu=mu, stiffness=stiffness, declared_at=script_line(), station=self._station,
        )  # fmt: skip
        return self._add("pairs", pair)

    def force(self, name: str, *, at: Point, vector: Any) -> Force:
        """Declare a force `vector` [N], in the assembly frame, at a point of a part (see Force)."""
        expect(f'force "{name}": at', at, Point, "part.point(x, y, z)")
        line, station = script_line(), self._station
        return self._add("forces", Force(name=name, at=at, vector=_vector(vector), declared_at=line, station=station))

    def measure(
        self,
        name: str,
        of: Point | Measurement | Callable[[Any], Any],
        *,
        to: Point | None = None,
        along: Direction | None = None,
        tolerance: Any = None,
        limits: Sequence[float | None] | None = None,
        absolute: bool | None = None,
        units: str | None = None,
    ) -> Measure:
        """Declare a measure of a point, of two points, of a measurement, or of a CasADi expression of the poses (see Measure).

        `units` apply to an expression, by default mm. A measurement has its own.
        """
        axis = None if along is None else direction(along)
        if units is None:
            earlier = {measure.name: measure.units for measure in self.assembly.measures}
            units = min(of.units_among(earlier), default="mm") if isinstance(of, Measurement) else "mm"
        bounds: Any = tuple(limits) if isinstance(limits, list | tuple) else limits
        measure = Measure(
            name, of, to=to, along=axis, tolerance=tolerance, units=units, limits=bounds, absolute=absolute,
            declared_at=script_line(), station=self._station,
        )  # fmt: skip
        return self._add("measures", measure)


def expect(label: str, value: Any, kind: Any, expected: str) -> None:
    """Raise TypeError at the script's own line if an argument has a type that no other check could handle."""
    if not isinstance(value, kind):
        raise TypeError(f"{label} is a {type(value).__name__}; expected {expected}")
