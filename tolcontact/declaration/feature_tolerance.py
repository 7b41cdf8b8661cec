"""Tolerances of features, in the words of ISO 1101, ISO 5459 and ISO 2692."""

import re
from collections.abc import Iterator
from dataclasses import KW_ONLY, dataclass
from typing import Any, ClassVar, Literal, TypedDict, Unpack, cast, get_args

from tolcontact.declaration.checks import LENGTH, LENGTH_OR_0, TRUTH, Check, Checked, direction_faults, one_of
from tolcontact.declaration.size import Form
from tolcontact.declaration.tolerance import Side, side_faults
from tolcontact.declaration.values import Direction, Vector, direction as _direction, is_length
from tolcontact.readable import Readable
from tolcontact.tables import MAX_NUMBER

Rule = Literal["99.73 % inside", "6 sigma at the extremes", "translation"]  # the last one is without tilts
INSIDE, EXTREMES, TRANSLATION = RULES = get_args(Rule)
Material = Literal["", "M", "L"]
SYMBOLS = {"M": "Ⓜ", "L": "Ⓛ"}
ZoneShape = Literal["round", "flat"]
USUAL_FORM = Form()


def _lengths(per: Any) -> tuple[Any, ...]:
    return tuple(per) if isinstance(per, list | tuple) else (per,)


# What the values of options must be; a direction `along` has its own sentence.
OPTION_CHECKS = {
    "zone": one_of(get_args(ZoneShape)),
    "material": one_of(get_args(Material)),
    "projected": LENGTH,
    "outside": LENGTH_OR_0,
    "per": Check(
        lambda per: len(_lengths(per)) in (1, 2) and all(map(LENGTH.holds, _lengths(per))),
        "a length in mm above 0, or two of them, as in per=(25, 25)",
    ),
    "tangent": TRUTH,
    "combined": TRUTH,
}
COMPARTMENT = re.compile(r"([A-Z]{1,2}(?:-[A-Z]{1,2})*)(?:\(([ML])\))?(><)?")


class ToleranceOptions(TypedDict, total=False):
    """The named arguments of a kind of tolerance; GeometricTolerance describes them, and has their defaults."""

    zone: ZoneShape | None
    along: Direction | None
    material: Material
    projected: float | None
    outside: float | None
    per: float | tuple[float, float] | None
    tangent: bool
    combined: bool | None
    simultaneous: bool | None
    form: Form | None
    rule: Rule
    cp: float
    cpk: float | None
    side: Side | None


@dataclass(frozen=True, repr=False)
class ToleranceKind(Readable):
    """A kind of geometric tolerance; to call it with a width and datums makes a tolerance (see GeometricTolerance).

    kind          its name in messages, JSON and archives
    meaning       what it limits, with its clause of ISO 1101
    options       the fields among zone, along, material, projected, outside, per, tangent and combined that it accepts
    is_form       whether it limits form alone, and draws it by its `form`
    is_round      whether this form is one of round walls, which the zones of axes do not contain
    limits_wall   whether the zone of a round feature contains its wall with its form, and not its axis alone
    has_any_size  whether that zone may have any radius
    """

    kind: str
    meaning: str
    options: tuple[str, ...] = ()
    needs_datums: bool = True
    is_form: bool = False
    is_round: bool = False
    limits_wall: bool = False
    has_any_size: bool = False

    def __call__(self, width: float, datums: str = "", **options: Unpack[ToleranceOptions]) -> "GeometricTolerance":
        """Return a tolerance of a full `width` [mm] to `datums`, as in `tc.Position(0.2, "A|B|C", material="M")`.

        GeometricTolerance describes the options and their defaults.
        """
        return GeometricTolerance(self, width, datums, **options)

    @property
    def name(self) -> str:
        """The name in scripts."""
        return "".join(word.capitalize() for word in self.kind.replace("-", "").split())

    def __str__(self) -> str:
        return f"tc.{self.name}: {self.meaning}"


@dataclass(frozen=True, repr=False)
class GeometricTolerance(Checked):
    """A zone of full width `width` [mm] (of a round zone the diameter) for a feature.

    of          its kind, with the options that it accepts; `features/tolerance_kinds.py` defines the zones
    datums      the datum system, "A|B|C": primary, secondary, tertiary; "A-B" is a common datum, "B(M)" one with a modifier,
                and "A><" one that locks directions alone, and no places, as in the lower segment of a composite frame
    zone        "round" or "flat", for axes; by default round. `along` is the direction across a flat zone's planes
    material    "M" or "L": the zone grows as the feature's size departs from its maximum (least) material size, and is filled
    projected   [mm] the zone lies beyond the material, from the face of the primary datum up to this height
    outside     [mm] of a profile: the part of the zone that lies outside the material; by default half
    per         [mm] of flatness or straightness: it applies to any part of the surface of this length, or of two such lengths
    tangent     True for a zone of the plane that touches a plane from outside the material; its form may then be outside
    combined    of a pattern: True if the zones of its members keep their places to each other (CZ of ISO 5458), False if each
                has its own (SZ); by default as the `standard` of the part has it: separate under ISO, else combined
    simultaneous  of datums at their material boundary, such as "B(M)": True if their gauge lies in one place for all tolerances
                with the same datums (SIM), False if each may shift it (SEP REQT); by default as the `standard` of the part has
                it: True under ASME, else False
    form        of a tolerance of form, or a profile without datums: how the form deviates; None if it is stated alone, and the
                feature keeps its shape
    rule        from the zone to the spread of all freedoms together. "99.73 % inside" (default): this share of features lies
                inside, where components are equal, independent and normal. "6 sigma at the extremes": six standard deviations
                at the worst extreme of the feature equal the width. "translation": the default without tilts
    cp, cpk     process capability: the spread is divided by `cp`, and the mean is shifted until `cpk` results
    side        "up", "down" or "either": the sense of this shift in the first freedom that the tolerance adds, such as
                "shift x", or "offset", which points out of the material; for "either" see tc.Tolerance
    """

    of: ToleranceKind
    width: float
    datums: str = ""
    _: KW_ONLY
    zone: ZoneShape | None = None
    along: Direction | None = None
    material: Material = ""
    projected: float | None = None
    outside: float | None = None
    per: float | tuple[float, float] | None = None
    tangent: bool = False
    combined: bool | None = None
    simultaneous: bool | None = None
    form: Form | None = USUAL_FORM
    rule: Rule = "99.73 % inside"
    cp: float = 1.0
    cpk: float | None = None
    side: Side | None = None

    checks: ClassVar = {**OPTION_CHECKS, "simultaneous": TRUTH, "rule": one_of(RULES)}

    @property
    def kind(self) -> str:
        """The name of its kind in messages, JSON and archives."""
        return self.of.kind

    @property
    def is_form(self) -> bool:
        """Whether it limits form alone."""
        return self.of.is_form

    @property
    def system(self) -> tuple[tuple[str, ...], ...]:
        """The letters of the datum system: one for each compartment, or several for a common datum."""
        return tuple(tuple(match[1].split("-")) for match in map(COMPARTMENT.fullmatch, self._compartments) if match)

    @property
    def letters(self) -> tuple[str, ...]:
        """The letters of all its datums."""
        return tuple(letter for compartment in self.system for letter in compartment)

    @property
    def orientation_only(self) -> tuple[bool, ...]:
        """Whether a compartment locks directions alone: one for each."""
        return tuple(compartment.endswith("><") for compartment in self._compartments)

    @property
    def modifiers(self) -> tuple[Material, ...]:
        """The material modifier of each compartment: "M", "L" or none."""
        return tuple(cast(Material, match[2] or "") for match in map(COMPARTMENT.fullmatch, self._compartments) if match)

    @property
    def _compartments(self) -> list[str]:
        has_datums = self.datums and isinstance(self.datums, str)
        return [compartment.strip() for compartment in self.datums.split("|")] if has_datums else []

    @property
    def across(self) -> Vector | None:
        """The unit vector across a flat zone."""
        return None if self.along is None else _direction(self.along)

    @property
    def _unit_lengths(self) -> tuple[float, ...]:
        """The lengths [mm] of the parts of a surface that it applies to; none for the surface as a whole."""
        return () if self.per is None else _lengths(self.per)

    @property
    def limits_form_alone(self) -> bool:
        """Whether it limits no displacement of a feature: a tolerance of form, or a profile without datums."""
        return self.is_form or not (self.of.needs_datums or self.datums)

    @property
    def uneven_shift(self) -> float:
        """The distance [mm], out of the material, from the nominal surface to the centre of an unequally disposed zone."""
        return 0.0 if self.outside is None else self.outside - self.width / 2

    def faults(self) -> Iterator[str]:
        if not (is_length(self.width) and (self.width > 0 or (self.width == 0 and self.material))):
            bound = f"{'0 or above' if self.material else 'above 0'}, up to {MAX_NUMBER:g}"
            yield f"width is {self.width!r}; expected the full width of the zone in mm, {bound}"
        yield from self._datum_faults()
        yield from self._zone_faults()
        yield from super().faults()
        if not (is_length(self.cp) and self.cp > 0):
            yield f"cp is {self.cp!r}; expected a number above 0"
        elif self.cpk is not None and not (is_length(self.cpk) and self.cpk <= self.cp):
            yield f"cpk is {self.cpk!r}; expected a number, at most cp"
        yield from side_faults(self.side, self.cpk)

    def _datum_faults(self) -> Iterator[str]:
        are_valid = isinstance(self.datums, str) and all(map(COMPARTMENT.fullmatch, self._compartments))
        if not are_valid or len(self._compartments) > 3:
            yield f'datums is {self.datums!r}; expected up to three datums, such as "A|B|C", "A|B(M)", "A-B" or "A><"'
            return
        if len(set(self.letters)) < len(self.letters):
            yield f"datums {self.datums!r} names a datum twice"
        if self.simultaneous is not None and not any(self.modifiers):
            yield 'simultaneous is given, but no datum is at its material boundary, as in "A|B(M)"; leave it out'

    def _zone_faults(self) -> Iterator[str]:
        for option in (*OPTION_CHECKS, "along"):
            value = getattr(self, option)
            is_given = value not in ("", False) if isinstance(value, str | bool) else value is not None
            if is_given and option not in self.of.options:
                yield f"{option} is given, which {self.kind} does not have; leave it out"
        yield from self._form_faults()
        if self.zone == "flat" and self.along is None:
            yield 'a flat zone needs a direction across it; give along="x", or a vector'
        yield from direction_faults("along", self.across)
        if self.outside is not None and is_length(self.outside) and is_length(self.width) and self.outside > self.width:
            yield f"outside is {self.outside!r}; expected a length in mm from 0 to the width"

    def _form_faults(self) -> Iterator[str]:
        if not self.limits_form_alone and self.form != USUAL_FORM:
            yield f"form is given, which {self.kind} does not have; leave it out"
        elif isinstance(self.form, Form):
            yield from (f"form: {fault}" for fault in self.form.faults())
        elif self.form is not None:
            yield f'form is {self.form!r}; expected tc.Form("squared exponential", length=, modes=), or None'
        if self.is_form and self.form is not None and self.cpk is not None:
            yield f"cpk is given, but the form of {self.kind} has no mean; leave it out"
        if self.is_form and self.form is not None and self.rule != INSIDE:
            yield f'the rule is "{self.rule}"; form is drawn by the rule "{INSIDE}" alone'

    def __str__(self) -> str:
        """Return the tolerance with the symbols of a drawing."""
        diameter, material = "⌀" if self.zone == "round" else "", f" {SYMBOLS[self.material]}" if self.material else ""
        unit = f"/{'×'.join(f'{length:g}' for length in self._unit_lengths)}" if self._unit_lengths else ""
        projected = "" if self.projected is None else f" Ⓟ{self.projected:g}"
        unequal = "" if self.outside is None else f" Ⓤ{self.outside:g}"
        tangent = " Ⓣ" if self.tangent else ""
        frame = f"{self.kind} {diameter}{self.width:g}{unit}{unequal}{material}{projected}{tangent}{self._zones}"
        datums = [re.sub(r"\(([ML])\)", lambda m: f" {SYMBOLS[m[1]]}", datum) for datum in self._compartments]
        return " ".join([frame, *datums, *{None: (), True: ("SIM",), False: ("SEP REQT",)}[self.simultaneous]])

    @property
    def archived_text(self) -> str:
        """The tolerance without symbols, as archives describe the contributors of a feature."""
        round_ = "diameter " if self.zone == "round" else ""
        unit = f" per {' x '.join(f'{length:g}' for length in self._unit_lengths)} mm" if self._unit_lengths else ""
        tangent, datums = " of the tangent plane" if self.tangent else "", f" to {self.datums}" if self.datums else ""
        uneven = "" if self.outside is None else f", {self.outside:g} mm of it outside,"
        return f"{self.kind} {round_}{self.width:g}{self.material} mm{unit}{uneven}{tangent}{self._zones}{datums}"

    @property
    def _zones(self) -> str:
        return {None: "", True: " CZ", False: " SZ"}[self.combined]


AXIS_OPTIONS = ("zone", "along", "material", "tangent", "combined")
Position = ToleranceKind(
    "position", "position of an axis, a centre, or a plane (ISO 1101, 17.12); in a pattern without datums it is a common zone",
    (*AXIS_OPTIONS, "projected"),
)  # fmt: skip
Coaxiality = ToleranceKind(
    "coaxiality", "coaxiality of an axis with the axis of its datums: a round zone (ISO 1101, 17.13)", ("material", "combined")
)
Symmetry = ToleranceKind(
    "symmetry", "symmetry of the middle of two opposed planes, or of an axis between planes, to its datums (ISO 1101, 17.14)",
    ("zone", "along", "material", "combined"),
)  # fmt: skip
Profile = ToleranceKind(
    "profile", "profile of a surface (ISO 1101, 17.8): its location, if its datums lock it; without datums it is form alone",
    ("outside", "tangent", "combined"), needs_datums=False, limits_wall=True,
)  # fmt: skip
LineProfile = ToleranceKind(  # the zones of all lines are taken as one zone of the surface
    "line profile", "profile of any line of a surface (ISO 1101, 17.7)", ("outside", "combined"), needs_datums=False,
    limits_wall=True,
)  # fmt: skip
Parallelism = ToleranceKind("parallelism", "parallelism of a plane or an axis to its datums (ISO 1101, 17.9)", AXIS_OPTIONS)
Perpendicularity = ToleranceKind(
    "perpendicularity", "perpendicularity of a plane or an axis to its datums (ISO 1101, 17.10)", (*AXIS_OPTIONS, "projected")
)
Angularity = ToleranceKind(
    "angularity", "angularity of a plane or an axis: its angle to its datums (ISO 1101, 17.11)", AXIS_OPTIONS
)
CircularRunout = ToleranceKind(  # without form deviations it equals total run-out
    "circular run-out", "run-out of each section of a cylinder, or of each circle of a plane, to the axis of its datums "
    "(ISO 1101, 17.15)", limits_wall=True, has_any_size=True,
)  # fmt: skip
TotalRunout = ToleranceKind(
    "total run-out", "run-out of a cylinder or a plane to the axis of its datums (ISO 1101, 17.16)", limits_wall=True,
    has_any_size=True,
)  # fmt: skip
Straightness = ToleranceKind(  # the lines of a cylinder or cone are drawn; an axis, or lines of a plane, need form=None
    "straightness", "straightness of lines of a surface, or of an axis (ISO 1101, 17.3)", ("per",), needs_datums=False,
    is_form=True,
)  # fmt: skip
Flatness = ToleranceKind(
    "flatness", "flatness of a plane, or of any part of it (ISO 1101, 17.4)", ("per",), needs_datums=False, is_form=True
)
Roundness = ToleranceKind(
    "roundness", "roundness of sections of a cylinder, cone or sphere (ISO 1101, 17.5)", needs_datums=False, is_form=True,
    is_round=True,
)  # fmt: skip
Cylindricity = ToleranceKind("cylindricity", "cylindricity (ISO 1101, 17.6)", needs_datums=False, is_form=True, is_round=True)
KINDS = {
    row.kind: row
    for row in (
        Position, Coaxiality, Symmetry, Profile, LineProfile, Parallelism, Perpendicularity, Angularity, CircularRunout,
        TotalRunout, Straightness, Flatness, Roundness, Cylindricity,
    )
}  # fmt: skip
