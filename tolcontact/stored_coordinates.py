"""Spacing of the coordinates that a mesh file can store: by their bits, or by the digits of a text.

A coordinate in a file is up to half a spacing away from the coordinate that was written. The process that reads shape files
imports this module, so it needs NumPy alone.
"""

import itertools
import re
from collections.abc import Iterator

import numpy as np

MIN_DIGITS = 6  # that programs print by default: if all numbers of a text are shorter, they are most probably exact
DOUBLE_DIGITS = 15  # or more: a text of double precision
MIN_NUMBERS, MIN_SHARE = 16, 0.6  # different shorter numbers, and the share with all decimals, or digits: they are rounded
FEWEST_DIGITS = 4  # of rounded numbers; 5 with a single decimal, which designs in whole inches have, too
HALF_UNIT = 0.6  # of the last digit: as far a printed number is from the stored one, and rounding
MAX_VERTICES = 20_000  # the first ones, which tell how a text prints numbers
_PLY_TYPE = re.compile(rb"^property\s+(\w+)\s+x\s*$", re.MULTILINE)
_PLY_VERTICES = re.compile(rb"^element\s+vertex\s+(\d+)", re.MULTILINE)
_VERTEX = {
    "stl": re.compile(rb"^\s*vertex\s+(\S+)\s+(\S+)\s+(\S+)", re.MULTILINE | re.IGNORECASE),
    "obj": re.compile(rb"^\s*v\s+(\S+)\s+(\S+)\s+(\S+)", re.MULTILINE),
    "ply": re.compile(rb"^\s*(\S+)\s+(\S+)\s+(\S+)", re.MULTILINE),
}
_NUMBER = re.compile(rb"[+-]?(\d*)(?:\.(\d*))?(?:[eE]([+-]?\d+))?")


def is_binary_stl(content: bytes) -> bool:
    """Return whether the content of an STL file is binary, by its length."""
    return len(content) == 84 + 50 * int.from_bytes(content[80:84], "little")


def is_single(content: bytes, kind: str) -> bool:
    """Return whether a file of a kind ("stl", "glb", ...) stores coordinates as binary numbers of single precision."""
    if kind == "stl":
        return is_binary_stl(content)
    if kind == "ply":
        match = _PLY_TYPE.search(_ply_header(content))
        return match is not None and match[1] in (b"float", b"float32")
    return kind in ("glb", "gltf")


def single_spacing(vertices: np.ndarray) -> np.ndarray:
    """Return the spacing (3,) of numbers of single precision along each axis, at the largest of the vertices (vertex, 3)."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.spacing(np.abs(vertices).max(axis=0, initial=0.0).astype(np.float32)).astype(float)


def printed_spacing(content: bytes, kind: str) -> float:
    """Return the unit of the last digit of the largest coordinate that a text prints; 0 for binary content and exact numbers.

    Trailing zeros may be left out in print, so the last digit follows from all numbers. A text that prints numbers of single
    precision to more digits than they have is no more accurate than these.
    """
    numbers = dict.fromkeys(_printed(content, kind))
    values = np.array([abs(float(number)) for number in numbers])
    if not (values.size and np.isfinite(values).all() and values.any()):
        return 0.0
    digits, decimals = np.array([_digits_and_decimals(number) for number in numbers]).T
    most = int(digits.max())
    share = max((decimals == decimals.max()).mean(), (digits == most).mean())
    is_rounded = len(numbers) >= MIN_NUMBERS and share >= MIN_SHARE and most >= FEWEST_DIGITS + (decimals.max() < 2)
    if most < MIN_DIGITS and not is_rounded:
        return 0.0
    magnitude = int(np.floor(np.log10(values.max())))
    last = max(int(decimals[values >= 10.0**magnitude].max()), most - 1 - magnitude)
    unit, single = 10.0**-last, float(single_spacing(values[:, None])[0])
    if single > unit and (np.abs(values.astype(np.float32) - values) <= HALF_UNIT * unit).all():
        return single
    return unit if most < DOUBLE_DIGITS else 0.0


def _ply_header(content: bytes) -> bytes:
    return content.partition(b"end_header")[0].replace(b"\r", b"\n")


def _printed(content: bytes, kind: str) -> Iterator[bytes]:
    """Yield the coordinates of the first vertices of a text as they are printed."""
    count = MAX_VERTICES
    if kind not in _VERTEX or (kind == "stl" and is_binary_stl(content)):
        return
    if kind == "ply":
        header, match = _ply_header(content), _PLY_VERTICES.search(_ply_header(content))
        if match is None or b"format ascii" not in header:
            return
        count, content = min(count, int(match[1])), content.partition(b"end_header")[2].replace(b"\r", b"\n")
    for vertex in itertools.islice(_VERTEX[kind].finditer(content), count):
        yield from (number for number in vertex.groups() if _NUMBER.fullmatch(number) and number.strip(b"+-.eE"))


def _digits_and_decimals(number: bytes) -> tuple[int, int]:
    """Return the number of significant digits of a printed number, and of its decimals, without trailing zeros."""
    match = _NUMBER.fullmatch(number)
    assert match is not None
    whole, fraction, exponent = match[1] or b"", match[2] or b"", int(match[3] or 0)
    mantissa = whole + fraction
    stripped = mantissa.rstrip(b"0")
    if not stripped:
        return 0, 0
    return len(stripped.lstrip(b"0")), len(fraction) - (len(mantissa) - len(stripped)) - exponent
