"""Names, vectors, directions and lengths of declarations, and the script line that states them."""

import math
import numbers
import re
import reprlib
import sys
import unicodedata
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Literal, get_args, overload

import numpy as np

from tolcontact.tables import MAX_NUMBER
from tolcontact.texts import CONTROL_CHARACTERS, shown

MAX_NAME = 500  # characters
MAX_GROUP_NAME = 255  # bytes in UTF-8: the netCDF library's NC_MAX_NAME is 256, with which some groups cannot be written
_TEXT = re.compile(".*")
_KEY = re.compile(r"\w(?:[^/]*[^/\s])?")


def text_faults(
    kind: str, names: Sequence[Any], pattern: re.Pattern[str] = _TEXT, expected: str = "without control characters"
) -> Iterator[str]:
    """Yield the faults of names that are only shown, or have to match another `pattern`, which is `expected` in words."""
    for name in dict.fromkeys(names):
        if isinstance(name, str) and len(name) > MAX_NAME:
            yield f"{kind} {name[:40]!r}...: the name has {len(name)} characters; expected at most {MAX_NAME}"
        elif not (is_line(name) and pattern.fullmatch(name)):
            yield f"{kind} {name!r}: a name must be text {expected} (the archive uses it)"


def key_faults(kind: str, names: Sequence[Any]) -> Iterator[str]:
    """Yield the faults of names that identify things in the archive."""
    expected = 'that starts with a letter, digit or underscore, contains no "/" and no control character, and does not end in a'
    yield from text_faults(kind, names, _KEY, f"{expected} space")
    yield from repetitions(kind, names)


def group_faults(kind: str, names: Sequence[Any]) -> Iterator[str]:
    """Yield the faults of names that become names of groups in the archive, in addition to `key_faults`."""
    for name in dict.fromkeys(names):
        if isinstance(name, str) and len(name) <= MAX_NAME:
            size = len(unicodedata.normalize("NFC", name).encode("utf-8", "replace"))
            if size > MAX_GROUP_NAME:
                yield (
                    f"{kind} {name[:40]!r}...: the name takes {size} bytes in UTF-8; expected at most {MAX_GROUP_NAME} "
                    "(the archive has groups of that name)"
                )


def repetitions(kind: str, names: Sequence[Any]) -> Iterator[str]:
    """Yield a fault for each name that occurs more than once. Names are compared in the Unicode form NFC."""
    composed = Counter(unicodedata.normalize("NFC", name) for name in names if isinstance(name, str))
    for name, count in composed.items():
        if count > 1:
            yield f'{kind} "{name}" is declared {count} times; names must differ'


def is_line(text: Any) -> bool:
    """Return True for a text of one line without characters that control a terminal."""
    return isinstance(text, str) and not (CONTROL_CHARACTERS.search(text) or "\t" in text or "\n" in text)


Vector = tuple[float, float, float]
Mirror = Literal["", "x", "y", "z"]  # the axis of a part's frame that is reversed
Side = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Direction = Side | Literal["x", "y", "z"] | str | Sequence[float] | np.ndarray  # texts from elsewhere are checked later

_PACKAGE = str(Path(__file__).resolve().parents[1])
_AXES: dict[str, Vector] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
DIRECTIONS = get_args(Side)


class NotAVector(tuple[float, ...]):
    """Three times NaN in place of an `entry` that is no vector, as which it prints: `faults()` reports it with all others."""

    entry: Any

    def __new__(cls, entry: Any) -> Any:
        wrong = super().__new__(cls, (math.nan,) * 3)
        wrong.entry = entry
        return wrong

    def __repr__(self) -> str:
        return reprlib.repr(self.entry)


def vector(value: Any) -> Vector:
    """Return three floats; NotAVector if `value` is not a vector."""
    try:
        x, y, z = (math.nan if isinstance(component, bool) else float(component) for component in value)
    except (TypeError, ValueError, OverflowError):
        return NotAVector(value)  # type: ignore[no-any-return]
    return (x, y, z) if is_finite((x, y, z)) else NotAVector(value)


def direction(value: Any) -> Vector:
    """Return the unit vector of "+x", "-z", "y" or of three numbers; NotAVector if `value` is not a direction."""
    if isinstance(value, str):
        sign, axis = (-1.0, value[1:]) if value.startswith("-") else (1.0, value.removeprefix("+"))
        if axis not in _AXES:
            return NotAVector(value)  # type: ignore[no-any-return]
        x, y, z = _AXES[axis]
        return (sign * x + 0.0, sign * y + 0.0, sign * z + 0.0)
    x, y, z = vector(value)
    length = math.hypot(x, y, z)
    if not (math.isfinite(length) and length > 0):
        return NotAVector(value)  # type: ignore[no-any-return]
    return (x / length, y / length, z / length)


@overload
def degrees(angle: float, /) -> float: ...
@overload
def degrees(*angles: float) -> tuple[float, ...]: ...
def degrees(*angles: float) -> float | tuple[float, ...]:
    """Return angles in degrees as radians: a number for one, a tuple for several, as in `rotation=tc.degrees(0, 0, 90)`.

    A rotation is a vector along its axis, whose length is the angle. Raises TypeError for anything but numbers.
    """
    for angle in angles:
        if not is_length(angle):
            raise TypeError(f"degrees of {angle!r}; expected finite numbers, as in tc.degrees(0, 0, 90)")
    radians = tuple(math.radians(angle) for angle in angles)
    return radians[0] if len(radians) == 1 else radians


def is_finite(value: Vector) -> bool:
    """Return True if all three components are numbers up to MAX_NUMBER."""
    return all(map(is_length, value))


def is_length(value: Any) -> bool:
    """Return True for a finite number, up to MAX_NUMBER either way; a truth value is not a number."""
    number: Any = value  # the type of numbers.Real knows no comparison
    return isinstance(value, numbers.Real) and not isinstance(value, bool) and abs(number) <= MAX_NUMBER


def script_line() -> str:
    """Return the innermost line outside this package as `file.py:12`; empty if all lines are inside."""
    frame = sys._getframe(1)
    while frame is not None:
        name = frame.f_code.co_filename
        if not name.startswith((_PACKAGE, "<")):
            return shown(f"{Path(name).name}:{frame.f_lineno}")
        frame = frame.f_back  # type: ignore[assignment]
    return ""
