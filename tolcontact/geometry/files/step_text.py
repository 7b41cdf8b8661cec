"""The records in the text of a STEP file (ISO 10303-21), taken in one pass; and its units, extent and references.

Time and memory are linear in the size of any text: the patterns are possessive and never backtrack.
"""

import contextlib
import re
import sys
from collections import defaultdict
from collections.abc import Iterable
from functools import cached_property
from pathlib import PurePosixPath, PureWindowsPath

import numpy as np

from tolcontact.declaration.geometry import UNITS

# Up to a semicolon outside strings: number, entity, parameters, semicolon. A longer number is no number.
STATEMENT = re.compile(rb"\s*+(?:#(\d{1,18}+)\s*+=\s*+)?+([A-Za-z_]\w*+)?+((?:[^';]++|'[^']*+'?)*+)(;?)")
_COMMENT = re.compile(rb"('[^']*+'?)|/\*(?:[^*]++|\*(?!/))*+(?:\*/)?")
_STRINGS = re.compile(rb"'[^']*+'?")
_STRING = re.compile(rb"'((?:[^']|'')*+)'")
_ENTITY = re.compile(rb"([A-Za-z_]\w*+)\s*+\(")
_REFERENCE = re.compile(rb"#(\d+)")
_WIDE = re.compile(r"\\X2\\((?:[0-9A-F]{4})*)\\X0\\|\\X\\([0-9A-F]{2})")
# What strings consist of in the encodings that systems write in place of UTF-8; of Chinese and Japanese the common characters.
_ENCODINGS = {
    "gb18030": re.compile(rb"(?:[\0-\x7f]|[\xb0-\xd7][\xa1-\xfe]|[\xa1\xa3][\xa1-\xfe])*+"),
    "shift_jis": re.compile(rb"(?:[\0-\x7f]|[\x81-\x97][\x40-\xfc])*+"),
}
_POINT = re.compile(
    rb"CARTESIAN_POINT\s*\(\s*'(?:[^']|'')*+'\s*,\s*\(\s*([-+.\dEe]+)\s*,\s*([-+.\dEe]+)\s*,\s*([-+.\dEe]+)\s*\)"
)
_METRES = re.compile(rb"SI_UNIT\s*\(\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.")
_NAMED_FACE = re.compile(rb"\b(?:ADVANCED_FACE|FACE_SURFACE)\s*\(\s*'(?!'|NONE')")
# NaN, or a number that exceeds double precision.
_ENDLESS = re.compile(
    rb"[(,]\s*+([-+]?(?:nan|inf|infinity|\d++\.?+\d*+e\+?+0*+(?:\d{4,}|[4-9]\d\d|3[1-9]\d|309)))\s*+(?=[,)])", re.IGNORECASE
)
_UNIT_NAMES = {
    "micrometre": "um", "millimetre": "mm", "centimetre": "cm", "metre": "m", "inch": "in", "foot": "ft", "feet": "ft",
}  # fmt: skip
_DOCUMENTS = ("DOCUMENT_FILE", "APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT")
FACES = ("ADVANCED_FACE", "FACE_SURFACE")
SOLIDS = ("MANIFOLD_SOLID_BREP", "BREP_WITH_VOIDS", "FACETED_BREP")
USAGES = ("GEOMETRIC_ITEM_SPECIFIC_USAGE", "ITEM_IDENTIFIED_REPRESENTATION_USAGE")  # link PMI and faces
OPERATOR = "CARTESIAN_TRANSFORMATION_OPERATOR_3D"  # places a shape, maybe mirrored
SHAPE_SUFFIXES = (".step", ".stp", ".p21", ".stpz", ".stpx", ".stpnc")
# Shapes are most of a file, and nobody asks for their records.
_SHAPES = frozenset(
    (b"CARTESIAN_POINT", b"DIRECTION", b"VECTOR", b"LINE", b"VERTEX_POINT", b"EDGE_CURVE", b"ORIENTED_EDGE", b"EDGE_LOOP",
     b"FACE_BOUND", b"FACE_OUTER_BOUND", b"AXIS2_PLACEMENT_3D", b"CIRCLE", b"PCURVE", b"SURFACE_CURVE", b"SEAM_CURVE", b"PLANE",
     b"CYLINDRICAL_SURFACE", b"B_SPLINE_CURVE_WITH_KNOTS", b"B_SPLINE_SURFACE_WITH_KNOTS", b"COORDINATES_LIST", b"POLYLINE",
     b"TESSELLATED_CURVE_SET", b"DEFINITIONAL_REPRESENTATION", b"STYLED_ITEM", b"COMPOSITE_CURVE_SEGMENT")
)  # fmt: skip


class StepText:
    """The records of a STEP file; of a damaged file, what is legible.

    content       the text without comments
    schema        name of the schema and its object identifier, as the file states them
    is_complete   whether the file ends with END-ISO-10303-21
    order         numbers of all records in the order of the file
    bodies        entity and parameters of each record by its number, without most shapes
    entities      the entity of a record by its number; none of a complex instance, which has several
    numbers       record numbers of each entity, by its name
    documents     names of other files that the file refers to, each once
    """

    def __init__(self, content: bytes) -> None:
        self.content = _COMMENT.sub(rb"\1", content) if b"/*" in content else content
        self.schema = ""
        self.order: list[int] = []
        self.bodies: dict[int, bytes] = {}
        self.entities: dict[int, str] = {}
        self.numbers: dict[str, list[int]] = defaultdict(list)
        self._points: list[bytes] = []
        self._documents: list[str] = []
        self.is_complete = self._scan()
        self.documents = tuple(name for name in dict.fromkeys(self._documents) if name.strip())

    @property
    def shape_files(self) -> tuple[str, ...]:
        """The documents that are files of shapes."""
        suffixes = {name: PurePosixPath(PureWindowsPath(name).name).suffix.lower() for name in self.documents}
        return tuple(name for name, suffix in suffixes.items() if suffix in SHAPE_SUFFIXES)

    def has_any(self, entities: Iterable[str]) -> bool:
        """Return whether there is a record of one of some entities."""
        return any(entity in self.numbers for entity in entities)

    @property
    def has_face_names(self) -> bool:
        """Whether a B-rep face has a name."""
        return any(_NAMED_FACE.search(self.bodies[number]) for entity in FACES for number in self.numbers.get(entity, ()))

    @cached_property
    def units(self) -> tuple[str, ...]:
        """The units of lengths of shapes, each once, as the file names them: "millimetre", "inch"; none if it states none.

        Files with inches define them in mm first, so that they have both.
        """
        units = {}
        for number in self.numbers.get("LENGTH_UNIT", ()):
            metres, name = _METRES.search(self.bodies[number]), _STRING.search(self.bodies[number])
            units[number] = (f"{(metres[1] or b'').decode()}metre" if metres else decoded(name[1]) if name else "").lower()
        contexts = dict.fromkeys(self.numbers.get("GLOBAL_UNIT_ASSIGNED_CONTEXT", ()))
        shapes = (n for entity, numbers in self.numbers.items() if entity.endswith("SHAPE_REPRESENTATION") for n in numbers)
        of_shapes = [context for shape in shapes for context in self._references(shape) if context in contexts]
        assigned = [n for context in dict.fromkeys(of_shapes) or contexts for n in self._references(context) if n in units]
        if assigned:
            return tuple(dict.fromkeys(units[number] for number in assigned))
        return tuple(sorted(units.values(), key=lambda unit: unit.endswith("metre"))[:1])

    @property
    def unit(self) -> float:
        """The unit of length [mm], the smallest one if components have different units; 1 if none is stated."""
        return min((UNITS[_UNIT_NAMES.get(unit.removesuffix("es"), "mm")] for unit in self.units), default=1.0)

    def _references(self, number: int) -> list[int]:
        """Return the numbers of the records that a record refers to."""
        return [int(reference) for reference in _REFERENCE.findall(self._outside_strings(number))]

    @cached_property
    def extent(self) -> float:
        """The longest side of the box around nearly all points, in units of the file; 0 without points.

        It holds 98 % of them along each axis: a few may be far off, on axes, or on planes that a body does not reach.
        """
        numbers = np.array([corner for point in _POINT.findall(b";".join(self._points)) for corner in point], dtype="S32")
        try:
            points = numbers.astype(float).reshape(-1, 3)
        except ValueError:  # damaged
            return 0.0
        finite = points[np.isfinite(points).all(axis=1)]
        return float(np.ptp(np.quantile(finite, [0.01, 0.99], axis=0), axis=0).max()) if len(finite) else 0.0

    @property
    def encoding(self) -> str:
        """The encoding that its strings seem to have."""
        if self.content.isascii():
            return "utf-8"
        return encoding_of(string for string in _STRING.findall(self.content) if not string.isascii())

    @property
    def endless_number(self) -> str:
        """The first number that is NaN or too large; "" if all numbers are finite."""
        if _ENDLESS.search(self.content) is None:  # the usual case: strings need not be left out
            return ""
        match = _ENDLESS.search(_STRING.sub(b"''", self.content))
        return match[1].decode() if match else ""

    def _scan(self) -> bool:
        """Take the records, and return whether the text is complete."""
        for match in STATEMENT.finditer(self.content):
            number, entity, body, end = match.groups()
            if number is not None:
                self._take(int(number), entity, body)
            elif entity == b"FILE_SCHEMA" and (schema := _STRING.search(body)):
                self.schema = decoded(schema[1])
            elif entity == b"END" and body.startswith(b"-ISO-10303-21"):
                return bool(end)
        return False

    def _take(self, number: int, entity: bytes | None, body: bytes) -> None:
        self.order.append(number)
        if entity == b"CARTESIAN_POINT" or (entity is None and b"CARTESIAN_POINT" in body):
            self._points.append((entity or b"") + body)
        if entity in _SHAPES or number in self.bodies:
            return
        if entity is None:
            self.bodies[number] = body
            if body.startswith(b"<"):  # a link to a record of another file
                self._documents.append(decoded(body[1:].partition(b">")[0]).partition("#")[0])
            names = [entity_name(name) for name in dict.fromkeys(_ENTITY.findall(self._outside_strings(number)))]
        else:
            self.bodies[number] = entity + body
            names = [entity_name(entity)]
            self.entities[number] = names[0]
        for name in names:
            self.numbers[name].append(number)
            if name in _DOCUMENTS and (document := _STRING.search(body)):
                self._documents.append(decoded(document[1]))

    def _outside_strings(self, number: int) -> bytes:
        return _STRINGS.sub(b"", self.bodies[number])


def entity_name(text: bytes) -> str:
    """Return the name of an entity in capital letters."""
    return sys.intern(text.decode("latin-1").upper())


def decoded(string: bytes) -> str:
    """Return a string of a STEP file, without its quotes, as a text."""
    text = string.decode(encoding_of([string]), errors="replace")
    return _WIDE.sub(_wide, text.replace("''", "'"))


def encoding_of(strings: Iterable[bytes]) -> str:
    """Return the encoding in which strings consist of common characters: UTF-8, or one of older systems; Latin if in none."""
    joined = b"\n".join(strings)
    with contextlib.suppress(UnicodeDecodeError):
        joined.decode()
        return "utf-8"
    return next((encoding for encoding, common in _ENCODINGS.items() if common.fullmatch(joined)), "latin-1")


def _wide(match: re.Match[str]) -> str:
    return bytes.fromhex(match[2]).decode("latin-1") if match[2] else bytes.fromhex(match[1]).decode("utf-16-be", "replace")
