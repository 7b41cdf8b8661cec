"""The assembly: it collects declarations in the order of a script."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, Generic, TypeVar, get_args, overload

from tolcontact.declaration.checks import FRICTION, Checked, one_of
from tolcontact.declaration.contact_pair import ContactPair, Force, Joint, Overlap
from tolcontact.declaration.declarations import (
    Declarations,
    Station,
    expect,
    in_order,
    joined_before,
    present_parts,
    settings_of,
)
from tolcontact.declaration.dependence import Correlation, CorrelationKind, Variable
from tolcontact.declaration.geometry import UNITS, Geometry, Unit
from tolcontact.declaration.locator import Location
from tolcontact.declaration.measure import Measure
from tolcontact.declaration.measured_table import Gaps, population
from tolcontact.declaration.mirroring import Plane, mirrored
from tolcontact.declaration.model_faults import declaration_faults, omissions, setting_faults
from tolcontact.declaration.part import Feature, Part, Standard
from tolcontact.declaration.population import Population
from tolcontact.declaration.size import Size
from tolcontact.declaration.title_block import TitleBlock
from tolcontact.declaration.tolerance import tolerance as _tolerance
from tolcontact.declaration.values import Mirror, Vector, is_length, script_line, text_faults, vector as _vector
from tolcontact.declaration.widening import widened
from tolcontact.declaration.written_tolerance import TextFault, written
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


class Assembly(Declarations, Pictured, Checked):
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
        self, name: str, *, method: Method | None = None, title_block: TitleBlock | None = None, mu: float | None = None,
        standard: Standard = "", units: str = "mm",
    ) -> None:  # fmt: skip
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
        Both models have the same draws, so that tc.compare_runs is by pairs. Raises ValueError for an unknown name, and for an
        unequally disposed zone that would become too narrow to contain the nominal surface.
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
        self, name: str, geometry: Geometry, *, at: Any = (0, 0, 0), rotation: Any = (0, 0, 0), fixed: bool | None = None,
        standard: Standard = "", mirror: Mirror = "",
    ) -> Part:  # fmt: skip
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

    def variable(
        self, name: str, tolerance: Any, *, drives: Mapping[str, float] | None = None, units: str = "mm",
        nominal: float | None = None, expands: Mapping[Part | str, float] | None = None,
        loads: Mapping[str, float] | None = None,
    ) -> Variable:  # fmt: skip
        """Declare a cause that drives several contributors or expands parts, or a dimension that chains measure (see Variable).

        name        of the cause
        tolerance   full width of its range in its `units`, a text such as "±5 K", or a tc.Tolerance
        drives      factor [mm per unit] of each contributor, by its label
        units       of the cause, by default mm
        nominal     value of a dimension in its `units`, which may drive nothing
        expands     coefficient of thermal expansion [1/K] of each part, or of its name; deviations are from the temperature
                    at which dimensions hold
        loads       factor [N per unit] on the magnitude of each force, by its name

        `model.variable("warmth", 20, drives={"cover.width.size": 0.0007}, units="K")`
        """
        for option, factors in (("drives", drives), ("expands", expands), ("loads", loads)):
            expect(f'variable "{name}": {option}', factors, Mapping | None, f'a factor for each name: {option}={{"name": 0.1}}')
        if isinstance(tolerance, str) and isinstance(units, str) and units != "mm":
            try:
                tolerance = written(tolerance, units=units)
            except TextFault as fault:
                raise ValueError(f'variable "{name}": tolerance is {tolerance!r}; {fault}') from fault
        by_name = {part.name if isinstance(part, Part) else part: alpha for part, alpha in (expands or {}).items()}
        return self._add("variables", Variable(
            name=name, tolerance=_tolerance(tolerance), drives=dict(drives or {}), units=units, nominal=nominal,
            declared_at=script_line(), expands=by_name, loads=dict(loads or {}),
        ))  # fmt: skip

    def correlate(self, labels: Sequence[str], matrix: Any, *, kind: CorrelationKind = "copula") -> Correlation:
        """Declare that contributors with these `labels` are correlated: a `matrix`, or one coefficient for two of them.

        `kind` is what the coefficients are of: "copula" (default), "pearson" or "rank" (see Correlation).
        `model.correlate(["top.A1", "top.A2"], 0.5)`
        """
        coefficients = [[1.0, matrix], [matrix, 1.0]] if is_length(matrix) else matrix
        try:
            rows = tuple(tuple(float(number) for number in row) for row in coefficients)
        except (TypeError, ValueError):  # faults() reports it
            rows = ()
        return self._add("correlations", Correlation(tuple(labels), rows, script_line(), kind))

    def population(
        self, source: Any, columns: Mapping[str, str] | None = None, *, absolute: bool = False, units: Unit | None = None,
        gauge: float | Mapping[str, float] = 0.0, lots: str | None = None, gaps: Gaps = "refused",
    ) -> Population:  # fmt: skip
        """Declare that contributors are drawn from measured rows (see Population).

        source    a CSV file, a DataFrame, a Dataset or a mapping of columns, with deviations from nominal values
        columns   label of the contributor of each column; by default the names of the columns are labels
        absolute  True: columns of sizes, of features declared before, hold sizes in place of deviations
        units     of lengths: "um", "in", ...; by default, and of all else, the numbers are in the contributor's own units
        gauge     standard uncertainty of measurement in `units`, or one for each label: its variance is taken off the spread of
                  the parts; by default it stays in it
        lots      column with the lot of each row: realizations draw a lot, then a part of it; by default they draw any row
        gaps      "left out": rows with an empty cell are left out, as a whole; by default they are refused

        `model.population("batch.csv", columns={"block.top.offset": "height"}, units="um")`
        """
        expect("population: absolute", absolute, bool, "True or False")
        sizes = {f"{feature.label}.size": feature.size.nominal for feature in self.features if feature.size}
        expect("population: lots", lots, str | None, "the name of a column")
        table = population(
            source, columns, script_line(), units=units, variables={cause.name: cause.units for cause in self.variables},
            sizes=sizes if absolute else None, gauge=gauge, lots=lots, gaps=gaps,
        )  # fmt: skip
        return self._add("populations", table)

    @overload
    def mirrored(self, part: Part, /, *, plane: Plane, names: Sequence[str], at: float = 0.0) -> Part: ...
    @overload
    def mirrored(self, *parts: Part, plane: Plane, names: Sequence[str], at: float = 0.0) -> tuple[Part, ...]: ...
    def mirrored(self, *parts: Part, plane: Plane, names: Sequence[str], at: float = 0.0) -> Part | tuple[Part, ...]:
        """Declare the mirror images of parts, and return them: a part for one, a tuple for several.

        plane   axis of the nominal assembly that is normal to the mirror plane: "x", "y" or "z"
        names   a text in names of parts, pairs and forces, and the text in its place: ("left", "right") makes "right door" of
                "left door". A name without the first text gets the second one at its end
        at      coordinate of the plane on this axis [mm], by default 0

        `right = model.mirrored(left, plane="y", names=("left", "right"))`

        Features, datums, tolerances, forms and elasticity of the parts come with them, and so do their locators on the ground,
        on a part, or on a feature that is mirrored, too; forces on them; contact pairs and meant overlaps between them. Contact
        with other parts, measures, joints, and causes of deviations do not, and neither does what is declared later.
        Coordinates, directions and faces in the frame of an image are the same as in the frame of its part; the mirror makes
        this frame left-handed. Images have draws of their own; equal deviations give mirrored parts.
        Raises ValueError or TypeError for wrong arguments.
        """
        return mirrored(self, parts, plane, names, at)

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
        zones = [locator.tolerance or location.tolerance for location in self.locations for locator in location.locators]
        zones += [location.tolerance for location in self.locations if location.faces]
        widths = [zone.width for zone in zones if zone is not None]
        sound = [control for feature in self.features for control in feature.tolerances if not any(control.faults())]
        widths += [control.tolerance.width if isinstance(control, Size) else float(control.width) for control in sound]
        measures = [measure for measure in self.measures if measure.units in UNITS and not any(measure.faults())]
        widths += [float(measure.width) * UNITS[measure.units] for measure in measures if measure.width is not None]
        return min((width for width in widths if width > CONSTANT_SHARE * max(widths)), default=math.inf)

    def omissions(self) -> Iterator[str]:
        """Yield the faults of a model that is not complete yet: declarations that only a run needs."""
        return omissions(self)

    def faults(self) -> Iterator[str]:
        """Yield the faults of the declarations, among them omissions: sentences that name a declaration and its script line."""
        if not (self.parts or self.variables):
            yield "it has no parts; declare at least one with assembly.part(name, geometry)"
        yield from omissions(self)
        yield from (*text_faults("assembly", [self.name]), *super().faults())
        yield from setting_faults(self)
        for name, most in MAX_COUNTS.items():
            if (count := len(self._declared[name])) > most:
                yield f"it has {count} {name}; expected at most {most}"
        yield from declaration_faults(self)

    def __str__(self) -> str:
        causes = *self.variables, *self.correlations, *self.populations
        declared = (row for part in self.parts for row in (*part.toleranced, *part.targets, *filter(None, [part.elasticity])))
        rows = *self.parts, *declared, *causes, *self.locations, *self.pairs, *self.overlaps, *self.forces, *self.measures
        for scene, station in zip(self.scenes, self.stations, strict=False):
            settings = *scene.locations, *scene.pairs, *scene.forces, *scene.measures
            joined = [joint for joint in self.joints if joint.station == station.name]
            rows = *(row for row in rows if row not in settings), station, *settings, *joined
        return "\n".join([f"assembly {self.name}", *(f"  {row}" for row in rows)])
