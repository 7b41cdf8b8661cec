"""What the text of a STEP file (ISO 10303-21) states about its solids, and about files that it refers to."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath, PureWindowsPath
from typing import NamedTuple

import numpy as np

from tolcontact.declaration.geometry import UNITS

# Up to a semicolon that stands in no string and no comment. Possessive: no text makes it go back.
_RECORD = re.compile(rb"(?:[^';/]++|'[^']*+'?|/\*(?:[^*]++|\*(?!/))*+(?:\*/)?|/)++;?")
_COMMENT = re.compile(rb"/\*(?:[^*]++|\*(?!/))*+\*/")
_INSTANCE = re.compile(rb"\s*#(\d+)\s*=\s*(.*)", re.DOTALL)
_KINDS = {
    b"PLANE": "plane", b"CYLINDRICAL_SURFACE": "cylinder", b"CONICAL_SURFACE": "cone", b"SPHERICAL_SURFACE": "sphere",
    b"TOROIDAL_SURFACE": "torus",
}  # fmt: skip
_ENTITY = re.compile(
    rb"\b(MANIFOLD_SOLID_BREP|BREP_WITH_VOIDS|FACETED_BREP|(?:ORIENTED_)?CLOSED_SHELL|ADVANCED_FACE|AXIS2_PLACEMENT_3D|%b"
    rb"|DOCUMENT_FILE|APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT|GLOBAL_UNIT_ASSIGNED_CONTEXT|LENGTH_UNIT)\s*\("
    % b"|".join(_KINDS)
)
_NAMELESS = ("NONE", "")  # what systems write where a face has no name
_STRING = re.compile(rb"'((?:[^']|'')*+)'")
_LINK = re.compile(rb"<([^<>]*)>")
_WIDE = re.compile(r"\\X2\\((?:[0-9A-F]{4})*)\\X0\\|\\X\\([0-9A-F]{2})")
_POINT = re.compile(
    rb"#(\d++)\s*+=\s*+CARTESIAN_POINT\s*\(\s*'(?:[^']|'')*+'\s*,\s*\(\s*([-+.\dEe]+)\s*,\s*([-+.\dEe]+)\s*,\s*([-+.\dEe]+)\s*\)"
)
_METRES = re.compile(rb"SI_UNIT\s*\(\s*(?:\.(\w+)\.|\$)\s*,\s*\.METRE\.")
_WORDS = {
    "micrometre": "um", "millimetre": "mm", "centimetre": "cm", "metre": "m", "inch": "in", "foot": "ft", "feet": "ft",
}  # fmt: skip
SHAPES = (".step", ".stp", ".p21", ".stpz", ".stpx", ".stpnc")


class NamedFace(NamedTuple):
    """A B-rep face: its `name`, "" if it has none, and the `kind` of its surface, one of SURFACE_KINDS, "" of any other.

    location   a point of a plane or of the axis, or the centre, in the file's units; None if it is not known
    """

    name: str = ""
    kind: str = ""
    location: tuple[float, ...] | None = None


@dataclass(frozen=True)
class Solid:
    """A solid with its `name`, and the B-rep `faces` of its shells in their order, those of its cavities, too."""

    name: str
    faces: tuple[NamedFace, ...]


@dataclass(frozen=True)
class StepText:
    """Solids in the file's order, the names of `files` that hold shapes that it refers to, and of other `documents`.

    units   of lengths of shapes, in the file's words: "millimetre", "inch"; empty if not stated
    extent  the longest side of the box that holds nearly all points (98 % along each axis), in these units; 0 if there are none
    unit    [mm] of length; that of mm if none is stated
    """

    solids: tuple[Solid, ...]
    files: tuple[str, ...]
    documents: tuple[str, ...]
    units: str
    extent: float

    @property
    def unit(self) -> float:
        return UNITS[_WORDS.get(self.units.removesuffix("es"), "mm")]


def step_text(content: bytes) -> StepText:
    """What a STEP file's `content` states; of damaged ones, what is still legible."""
    solids: list[tuple[str, list[int]]] = []
    shells: dict[int, list[int]] = {}
    faces: dict[int, tuple[str, int]] = {}
    surfaces: dict[int, tuple[str, int]] = {}
    placements: dict[int, int] = {}
    oriented: dict[int, list[int]] = {}
    named: list[str] = []
    units: dict[int, str] = {}
    assigned: list[int] = []
    for number, entity, record in _entities(content):
        strings = [_decoded(string) for string in _STRING.findall(record)]
        references = [int(reference) for reference in re.findall(rb"#(\d+)", _STRING.sub(b"", record))]
        if entity == b"CLOSED_SHELL":
            shells[number] = references
        elif entity == b"ADVANCED_FACE":
            name = strings[0].strip() if strings else ""
            faces[number] = "" if name in _NAMELESS else name, references[-1] if references else 0
        elif entity in _KINDS:
            surfaces[number] = _KINDS[entity], references[0] if references else 0
        elif entity == b"AXIS2_PLACEMENT_3D":
            placements[number] = references[0] if references else 0
        elif entity == b"ORIENTED_CLOSED_SHELL":
            oriented[number] = references
        elif entity in (b"DOCUMENT_FILE", b"APPLIED_EXTERNAL_IDENTIFICATION_ASSIGNMENT"):
            named.extend(strings[:1])
        elif entity == b"LENGTH_UNIT":
            metres = _METRES.search(record)
            units[number] = f"{(metres[1] or b'').decode()}metre".lower() if metres else "".join(strings[:1]).lower()
        elif entity == b"GLOBAL_UNIT_ASSIGNED_CONTEXT":
            assigned += references
        else:
            solids.append((strings[0] if strings else "", references))
    links = re.search(rb"\bREFERENCE\s*;(.*?)\bENDSEC\s*;", content, re.DOTALL)
    named.extend(_decoded(link).partition("#")[0] for link in _LINK.findall(links[1] if links else b""))
    named = [name for name in dict.fromkeys(named) if name.strip()]
    files = tuple(name for name in named if _suffix(name) in SHAPES)
    points = _points(content) if any(name for name, _ in faces.values()) else {}
    named_faces = {}
    for number, (name, surface) in faces.items():
        kind, placement = surfaces.get(surface, ("", 0))
        named_faces[number] = NamedFace(name, kind, points.get(placements.get(placement, 0)))
    return StepText(
        tuple(
            Solid(name, tuple(named_faces.get(face, NamedFace()) for face in _faces(references, shells, oriented)))
            for name, references in solids
        ),
        files,
        tuple(name for name in named if name not in files),
        _of_shapes([units[number] for number in assigned if number in units] or list(units.values())),
        _extent(content),
    )


def _of_shapes(units: Sequence[str]) -> str:
    """The unit of a file that assigns several to its shapes: inches are said in mm before they are assigned."""
    return next((unit for unit in units if not unit.endswith("metre")), units[0] if units else "")


def _points(content: bytes) -> dict[int, tuple[float, ...]]:
    """The points of a file by their numbers; none of a damaged one."""
    try:
        return {int(number): tuple(map(float, corner)) for number, *corner in _POINT.findall(content)}
    except ValueError:
        return {}


def _extent(content: bytes) -> float:
    """Some points may be far off: of axes, of planes that a body does not reach."""
    numbers = np.array([corner for _, *point in _POINT.findall(content) for corner in point], dtype="S32")
    try:
        points = numbers.astype(float).reshape(-1, 3)
    except ValueError:  # damaged ones
        return 0.0
    found = points[np.isfinite(points).all(axis=1)]
    return float(np.ptp(np.quantile(found, [0.01, 0.99], axis=0), axis=0).max()) if len(found) else 0.0


def _entities(content: bytes) -> Iterator[tuple[int, bytes, bytes]]:
    """Number, entity and record of each instance of an entity that matters here."""
    for found in _RECORD.finditer(content):
        entity = _ENTITY.search(found[0])
        instance = _INSTANCE.match(_COMMENT.sub(b"", found[0])) if entity else None
        outside = _ENTITY.search(_STRING.sub(b"", instance[2])) if instance else None
        if instance and outside:
            yield int(instance[1]), outside[1], instance[2]


def _faces(references: list[int], shells: Mapping[int, list[int]], oriented: Mapping[int, list[int]]) -> list[int]:
    own = [inner for reference in references for inner in oriented.get(reference, [reference])]
    return [face for shell in own for face in shells.get(shell, ())]


def _decoded(string: bytes) -> str:
    text = string.decode("utf-8", errors="replace").replace("''", "'")
    return _WIDE.sub(_wide, text)


def _wide(found: re.Match[str]) -> str:
    return bytes.fromhex(found[2]).decode("latin-1") if found[2] else bytes.fromhex(found[1]).decode("utf-16-be", "replace")


def _suffix(name: str) -> str:
    return PurePosixPath(PureWindowsPath(name).name).suffix.lower()
