"""Product and manufacturing information (PMI) as a file states it. Lengths in mm, angles in rad.

Records are numbers of the file: #12 is 12. `face_records` are B-rep faces; `other_records` are edges, curves and points.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

from tolcontact.declaration.values import Vector
from tolcontact.readable import Readable
from tolcontact.texts import shown


class Modifier(NamedTuple):
    """A modifier of a tolerance, or of a datum.

    sign      on a drawing
    standard  that defines it
    declared  options of a tolerance (see GeometricTolerance) or the mark of a datum; or the reason why it is not declared
    meaning   of a modifier without options or mark
    remark    on what is declared with it
    """

    sign: str
    standard: str
    declared: dict[str, Any] | str
    meaning: str = "declared; it changes nothing here"
    remark: str = ""

    @property
    def outcome(self) -> str:
        """How it is declared, in words."""
        if isinstance(self.declared, str):
            return f"not declared: {self.declared}"
        if mark := self.declared.get("mark"):
            return f'`"A{mark}"`'
        return ", ".join(f"`{name}={value!r}`" for name, value in self.declared.items() if name != "mark") or self.meaning


THREADS = "threads have no such surface here"
FITTED = "zones are for surfaces as they are, and for their axes by least squares"
RIGID = "it is for the part in its free state; here the part is rigid and stays so when it is assembled"
CUSTOMIZED = "a datum locks all the freedoms that it can here, and not some of them alone"

# By their words in AP242.
OF_TOLERANCES = {
    "maximum material requirement": Modifier("M", "ISO 2692", {"material": "M"}),
    "least material requirement": Modifier("L", "ISO 2692", {"material": "L"}),
    "reciprocity requirement": Modifier("R", "ISO 2692", "sizes do not grow by what their zones leave unused"),
    "common zone": Modifier("CZ", "ISO 5458", {}, "one pattern of the features that its faces form"),
    "separate zone": Modifier("SZ", "ISO 5458", {}, "declared; positions of several features are one pattern all the same"),
    "simultaneous requirement": Modifier("SIM", "ISO 5458", {"simultaneous": True}),
    "separate requirement": Modifier("SEP REQT", "ASME Y14.5", {"simultaneous": False}),
    "statistical tolerance": Modifier("ST", "ASME Y14.5", {}),  # all draws are statistical
    "tangent plane": Modifier("T", "ASME Y14.5", {"tangent": True}),
    "free state": Modifier("F", "ISO 10579", {}, "declared, with a remark: parts are rigid here", RIGID),
    "unequally disposed": Modifier("UZ", "ISO 1660", "its displacement is not stated"),
    "offset zone": Modifier("OZ", "ISO 1660", "the offset of its zone is not stated, so that no displacement can be drawn"),
    "variable angle": Modifier("VA", "ISO 1660", "the angle of its zone is not stated, so that no displacement can be drawn"),
    "dynamic profile": Modifier("△", "ASME Y14.5", "the size of its zone is not stated, so that no displacement can be drawn"),
    "united feature": Modifier(
        "UF", "ISO 1101", "several surfaces count as one; declare them as a pattern with combined zones"
    ),
    "any cross section": Modifier("ACS", "ISO 1101", "it is for sections, and zones here are for whole surfaces"),
    "line element": Modifier("LE", "ISO 1101", "it is for lines, and zones here are for whole surfaces"),
    "each radial element": Modifier("EACH RADIAL ELEMENT", "ASME Y14.5", "it is for lines, and zones here are for surfaces"),
    "not convex": Modifier("NC", "ISO 1101", "forms are drawn convex and concave alike"),
    "major diameter": Modifier("MD", "ISO 1101", THREADS),
    "minor diameter": Modifier("LD", "ISO 1101", THREADS),
    "pitch diameter": Modifier("PD", "ISO 1101", THREADS),
    "associated minmax feature": Modifier("C", "ISO 1101", FITTED),
    "associated least square feature": Modifier("G", "ISO 1101", {}),
    "associated minimum inscribed feature": Modifier("N", "ISO 1101", FITTED),
    "associated maximum inscribed feature": Modifier("X", "ISO 1101", FITTED),
    "associated tangent feature": Modifier("T", "ISO 1101", {"tangent": True}),
}
OF_DATUMS = {
    "maximum material requirement": Modifier("M", "ISO 2692", {"mark": "(M)"}),
    "least material requirement": Modifier("L", "ISO 2692", {"mark": "(L)"}),
    "orientation": Modifier("><", "ISO 5459", {"mark": "><"}),
    "translation": Modifier("▷", "ASME Y14.5", "a datum whose simulator may translate locks no place, which is not declared"),
    "distance variable": Modifier("DV", "ISO 5459", "the distance within a common datum is fixed here"),
    "contacting feature": Modifier("CF", "ISO 5459", "a datum follows from its own surface here"),
    "any cross section": Modifier("ACS", "ISO 5459", "it is for sections, and datums here are whole surfaces"),
    "any longitudinal section": Modifier("ALS", "ISO 5459", "it is for sections, and datums here are whole surfaces"),
    "point": Modifier("PT", "ISO 5459", "of a situation feature all freedoms count here"),
    "line": Modifier("SL", "ISO 5459", "of a situation feature all freedoms count here"),
    "plane": Modifier("PL", "ISO 5459", "of a situation feature all freedoms count here"),
    "basic": Modifier("TED", "ASME Y14.5", "the size of a datum's simulator is not read"),
    "free state": Modifier("F", "ISO 10579", {"mark": ""}),  # a rigid part has one state
    "major diameter": Modifier("MD", "ISO 5459", THREADS),
    "minor diameter": Modifier("LD", "ISO 5459", THREADS),
    "pitch diameter": Modifier("PD", "ISO 5459", THREADS),
    **{f"degree of freedom constraint {letter}": Modifier(letter, "ASME Y14.5", CUSTOMIZED) for letter in "xyzuvw"},
}  # fmt: skip


def sign(modifier: str) -> str:
    """Return the sign of a modifier on a drawing, such as M, or the modifier itself."""
    known = OF_TOLERANCES.get(modifier) or OF_DATUMS.get(modifier)
    return modifier if known is None else known.sign


_ZONES = {
    "cylindrical or circular": "diameter", "within a cylinder": "diameter", "within a circle": "diameter",
    "between two equidistant surfaces": "equidistant surfaces",
}  # fmt: skip


@dataclass(frozen=True, repr=False)
class DatumReference(Readable):
    """A place in a datum system.

    letters     of its datum, or of the datums of a common datum (A-B)
    modifiers   in words: "maximum material requirement", "translation", ...
    """

    letters: tuple[str, ...]
    modifiers: tuple[str, ...] = ()

    def __str__(self) -> str:
        return shown("-".join(self.letters) + "".join(f" ({sign(modifier)})" for modifier in self.modifiers))


@dataclass(frozen=True, repr=False)
class Tolerance(Readable):
    """A geometric tolerance.

    number         from 1, in the order of records
    record, name   of the tolerance in the file
    kind           "position", "surface profile", "flatness", ...; empty if the file states none
    value          width or diameter of the zone [mm]; None if the file states none
    zone           form of the zone in the file's words: "cylindrical or circular", "spherical", ...; often empty
    projected      length of a projected zone [mm]
    modifiers      in words: "maximum material requirement", "free state", "tangent plane", ...
    per_unit       [mm] length that the value applies to, or the lengths of the sides or the diameter of an area
    unit_shape     shape of that area: "square", "circular", "rectangular"
    displacement   of an unequally disposed zone [mm]
    maximum        upper bound of the value [mm]
    extent         "all around", "between", "all over", or empty
    datums         the datum system, in order of precedence
    refines        number of the tolerance above it in a composite frame
    """

    number: int
    record: int
    kind: str
    name: str
    value: float | None
    zone: str
    projected: float | None
    modifiers: tuple[str, ...]
    per_unit: tuple[float, ...]
    unit_shape: str
    displacement: float | None
    maximum: float | None
    extent: str
    datums: tuple[DatumReference, ...]
    refines: int | None
    face_records: tuple[int, ...]
    other_records: tuple[int, ...]

    def __str__(self) -> str:
        value = "without a value" if self.value is None else f"{self.value:.6g} mm"
        system = f", datums {self.datum_system}" if self.datums else ""
        details = f" ({self.details})" if self.details else ""
        return f"{self.number}. {self.kind or 'tolerance'} {value}{details}{system}, {len(self.face_records)} faces"

    @property
    def datum_system(self) -> str:
        """The datum system in one line: "A | B (M) | C"."""
        return " | ".join(map(str, self.datums))

    @property
    def details(self) -> str:
        """The zone and everything that modifies it, in one line."""
        details = [_ZONES.get(self.zone, self.zone)]
        details += [] if self.projected is None else [f"projected {self.projected:.6g}"]
        details += map(sign, self.modifiers)
        shape = f" {self.unit_shape}" if self.unit_shape else ""
        details += [f"per {' x '.join(f'{side:.6g}' for side in self.per_unit)}{shape}"] if self.per_unit else []
        details += [] if self.displacement is None else [f"unequal {self.displacement:.6g}"]
        details += [] if self.maximum is None else [f"at most {self.maximum:.6g}"]
        details += [self.extent, "" if self.refines is None else f"refines {self.refines}"]
        return shown(", ".join(filter(None, details)))


@dataclass(frozen=True, repr=False)
class Dimension(Readable):
    """A size of a feature, or the distance or angle from one feature to another.

    number         from 1, in the order of records
    record, name   of the dimension in the file; the name says what it measures: "diameter", "radius", "linear distance", ...
    kind           "size", "angular size", "location", "directed location", "angular location", ...
    unit           "mm" or "rad"; empty without values
    nominal        None if the file states none
    lower, upper   limits of the dimension, not deviations; None on a side where the file states none
    fit            tolerance class of ISO 286, such as "H7 hole"; `lower` and `upper` are stated by the file alone
    modifiers      in words: "theoretical", "auxiliary", "statistical", "controlled radius", "maximum", ...
    face_records, other_records           of the feature of a size, or of the feature where a location begins
    end_face_records, end_other_records   of the feature where a location ends
    """

    number: int
    record: int
    kind: str
    name: str
    unit: str
    nominal: float | None
    lower: float | None
    upper: float | None
    fit: str
    modifiers: tuple[str, ...]
    face_records: tuple[int, ...]
    other_records: tuple[int, ...]
    end_face_records: tuple[int, ...]
    end_other_records: tuple[int, ...]

    def __str__(self) -> str:
        nominal = "without a value" if self.nominal is None else f"{self.nominal:.6g} {self.unit}"
        limits = f" [{_bound(self.lower)}, {_bound(self.upper)}]" if (self.lower, self.upper) != (None, None) else ""
        return f"{self.number}. {self.kind}{f' ({shown(self.name)})' if self.name else ''} {nominal}{limits}"

    @property
    def details(self) -> str:
        """The fit and the modifiers, in one line."""
        return shown(", ".join(filter(None, (self.fit, *map(sign, self.modifiers)))))


@dataclass(frozen=True, repr=False)
class DatumTarget(Readable):
    """A datum target: its `label` (A1), its `kind` in the file's words ("point", "circle", ...), and its records.

    point   its place in the frame of its product [mm]; None if the file states none
    """

    label: str
    kind: str
    record: int
    point: Vector | None
    face_records: tuple[int, ...]
    other_records: tuple[int, ...]

    def __str__(self) -> str:
        return shown(f"{self.label} {self.kind}".strip())


@dataclass(frozen=True, repr=False)
class Datum(Readable):
    """A datum with its `letter`, the records of its datum features, and its datum targets."""

    letter: str
    record: int
    targets: tuple[DatumTarget, ...]
    face_records: tuple[int, ...]
    other_records: tuple[int, ...]

    def __str__(self) -> str:
        return f"datum {shown(self.letter)}: {len(self.face_records)} faces, {len(self.targets)} targets"


@dataclass(frozen=True, repr=False)
class Pmi(Readable):
    """The product and manufacturing information of a STEP file.

    schema           as the file states it, with its object identifier
    edition          of AP242: 1, 2 or 3; None if it is not stated, and for other application protocols
    is_ap242         whether the file's application protocol is AP242; nothing is read from others
    is_tessellated   whether its shapes are triangles only, without B-rep faces
    drawings         number of annotations that are drawn, as lines or triangles; these are not read
    """

    schema: str
    edition: int | None
    is_ap242: bool
    is_tessellated: bool
    drawings: int
    tolerances: tuple[Tolerance, ...]
    dimensions: tuple[Dimension, ...]
    datums: tuple[Datum, ...]

    def __str__(self) -> str:
        edition = f"AP242 edition {self.edition}" if self.edition else "AP242" if self.is_ap242 else shown(self.schema)
        counts = f"{len(self.tolerances)} tolerances, {len(self.dimensions)} dimensions, {len(self.datums)} datums"
        return f"{edition}: {counts}"

    @property
    def is_empty(self) -> bool:
        """Whether the file states no tolerances, dimensions or datums."""
        return not (self.tolerances or self.dimensions or self.datums)


def _bound(limit: float | None) -> str:
    return "" if limit is None else f"{limit:.6g}"
