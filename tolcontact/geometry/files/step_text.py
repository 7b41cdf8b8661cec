"""Units, lengths and references in the text of a STEP file (ISO 10303-21)."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath, PureWindowsPath
from typing import NamedTuple

import numpy as np

from tolcontact.declaration.geometry import UNITS

# Up to a semicolon outside strings and comments. Possessive: no text makes it backtrack.
_RECORD = re.compile(rb"(?:[^';/]++|'[^']*+'?|/\*(?:[^*]++|\*(?!/))*+(?:\*/)?|/)++;?")
_COMMENT = re.compile(rb"/\*(?:[^*]++|\*(?!/))*+\*/")
_INSTANCE = re.compile(rb"\s*#(\d+)\s*=\s*(.*)", re.DOTALL)
_DOCUMENTS = (b"DOCUMENT_FILE", b"APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT")
_ENTITY = re.compile(rb"\b(%b|GLOBAL_UNIT_ASSIGNED_CONTEXT|LENGTH_UNIT)\s*\(" % b"|".join(_DOCUMENTS))
_IGNORED = re.compile(rb"'[^']*+'|" + _COMMENT.pattern)  # together: strings may hold signs of comments, and these quotes
_NUMBER = re.compile(rb"(?:^|;)\s*#(\d+)\s*=")
_STRING = re.compile(rb"'((?:[^']|'')*+)'")
_REFERENCE = re.compile(rb"#(\d+)")
_LINK = re.compile(rb"<([^<>]*)>")
_WIDE = re.compile(r"\\X2\\((?:[0-9A-F]{4})*)\\X0\\|\\X\\([0-9A-F]{2})")
_POINT = re.compile(
    rb"CARTESIAN_POINT\s*\(\s*'(?:[^']|'')*+'\s*,\s*\(\s*([-+.\dEe]+)\s*,\s*([-+.\dEe]+)\s*,\s*([-+.\dEe]+)\s*\)"
)
_METRES = re.compile(rb"SI_UNIT\s*\(\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.")
# NaN, or a number that exceeds double precision.
_ENDLESS = re.compile(
    rb"[(,]\s*+([-+]?(?:nan|inf|infinity|\d++\.?+\d*+e\+?+0*+(?:\d{4,}|[4-9]\d\d|3[1-9]\d|309)))\s*+(?=[,)])", re.IGNORECASE
)
_UNIT_NAMES = {
    "micrometre": "um", "millimetre": "mm", "centimetre": "cm", "metre": "m", "inch": "in", "foot": "ft", "feet": "ft",
}  # fmt: skip
SHAPES = (".step", ".stp", ".p21", ".stpz", ".stpx", ".stpnc")


@dataclass(frozen=True)
class StepText:
    """The names of shape `files` and other `documents` to which a STEP file refers, and its lengths.

    units   of lengths of shapes, as the file names them: "millimetre", "inch"; empty if not stated
    extent  the longest side of the box around nearly all points (98 % along each axis), in these units; 0 without points
    """

    files: tuple[str, ...]
    documents: tuple[str, ...]
    units: str
    extent: float

    @property
    def unit(self) -> float:
        """The unit of length [mm]; 1 if none is stated."""
        return UNITS[_UNIT_NAMES.get(self.units.removesuffix("es"), "mm")]


class _Record(NamedTuple):
    """An instance of an entity: its number and text, the strings in it, and the numbers of the instances that it names."""

    number: int
    entity: bytes
    text: bytes
    strings: list[str]
    references: list[int]

    @property
    def name(self) -> str:
        return self.strings[0] if self.strings else ""


def step_text(content: bytes) -> StepText:
    """Return what a STEP file's `content` states; for a damaged file, what is legible."""
    records = list(_records(content))
    documents = _documents(records, content)
    files = tuple(name for name in documents if _suffix(name) in SHAPES)
    others = tuple(name for name in documents if name not in files)
    return StepText(files, others, _units(records), _extent(content))


def endless_number(content: bytes) -> str:
    """Return the first number in a STEP file's `content` that is NaN or too large; "" if all numbers are finite."""
    if _ENDLESS.search(content) is None:  # the usual case, in which strings and comments need not be left out
        return ""
    match = _ENDLESS.search(b"".join(_STRING.sub(b"''", _COMMENT.sub(b"", record[0])) for record in _RECORD.finditer(content)))
    return match[1].decode() if match else ""


def record_numbers(content: bytes) -> list[int]:
    """Return the numbers of all records in a STEP file, in their order."""
    return [int(number) for number in _NUMBER.findall(_IGNORED.sub(b"", content))]


def _records(content: bytes) -> Iterator[_Record]:
    """Yield the instances of the entities in _ENTITY."""
    for match in _RECORD.finditer(content):
        instance = _INSTANCE.match(_COMMENT.sub(b"", match[0])) if _ENTITY.search(match[0]) else None
        if instance is None:
            continue
        text = instance[2]
        outside = _STRING.sub(b"", text)
        if entity := _ENTITY.search(outside):
            strings = [decoded(string) for string in _STRING.findall(text)]
            yield _Record(int(instance[1]), entity[1], text, strings, [int(number) for number in _REFERENCE.findall(outside)])


def _documents(records: Sequence[_Record], content: bytes) -> list[str]:
    """Return the names of the files to which a file refers, each once."""
    links = re.search(rb"\bREFERENCE\s*;(.*?)\bENDSEC\s*;", content, re.DOTALL)
    names = [record.name for record in records if record.entity in _DOCUMENTS]
    names.extend(decoded(link).partition("#")[0] for link in _LINK.findall(links[1] if links else b""))
    return [name for name in dict.fromkeys(names) if name.strip()]


def _units(records: Sequence[_Record]) -> str:
    """Return the unit of shapes. Files with inches define them in mm first, so that they have both."""
    units = {}
    for record in (record for record in records if record.entity == b"LENGTH_UNIT"):
        metres = _METRES.search(record.text)
        units[record.number] = f"{(metres[1] or b'').decode()}metre".lower() if metres else record.name.lower()
    contexts = [record for record in records if record.entity == b"GLOBAL_UNIT_ASSIGNED_CONTEXT"]
    assigned = [units[number] for record in contexts for number in record.references if number in units]
    candidates = assigned or list(units.values())
    return next((unit for unit in candidates if not unit.endswith("metre")), candidates[0] if candidates else "")


def _extent(content: bytes) -> float:
    """Return the extent of StepText: a few points may be far off, on axes, or on planes that a body does not reach."""
    numbers = np.array([corner for point in _POINT.findall(content) for corner in point], dtype="S32")
    try:
        points = numbers.astype(float).reshape(-1, 3)
    except ValueError:  # damaged
        return 0.0
    finite = points[np.isfinite(points).all(axis=1)]
    return float(np.ptp(np.quantile(finite, [0.01, 0.99], axis=0), axis=0).max()) if len(finite) else 0.0


def decoded(string: bytes) -> str:
    """Return a string of a STEP file, without its quotes, as a text."""
    text = string.decode("utf-8", errors="replace").replace("''", "'")
    return _WIDE.sub(_wide, text)


def _wide(match: re.Match[str]) -> str:
    return bytes.fromhex(match[2]).decode("latin-1") if match[2] else bytes.fromhex(match[1]).decode("utf-16-be", "replace")


def _suffix(name: str) -> str:
    return PurePosixPath(PureWindowsPath(name).name).suffix.lower()
