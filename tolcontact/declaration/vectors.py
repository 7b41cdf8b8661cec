"""Vectors, directions and lengths of declarations, and the script line that states them."""

import math
import numbers
import sys
from pathlib import Path
from typing import Any

from tolcontact.errors import shown

Vector = tuple[float, float, float]

_PACKAGE = str(Path(__file__).resolve().parents[1])
_AXES: dict[str, Vector] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
DIRECTIONS = tuple(sign + axis for axis in _AXES for sign in "+-")
NOT_A_VECTOR: Vector = (math.nan, math.nan, math.nan)


def vector(value: Any) -> Vector:
    """Return three floats; NaN if `value` is not a vector, so that `faults()` reports it with all others."""
    try:
        x, y, z = (float(component) for component in value)
    except (TypeError, ValueError):
        return NOT_A_VECTOR
    return (x, y, z)


def direction(value: Any) -> Vector:
    """Return the unit vector of "+x", "-z", "y" or of three numbers; NaN if `value` is not a direction."""
    if isinstance(value, str):
        sign, axis = (-1.0, value[1:]) if value.startswith("-") else (1.0, value.removeprefix("+"))
        if axis not in _AXES:
            return NOT_A_VECTOR
        x, y, z = _AXES[axis]
        return (sign * x + 0.0, sign * y + 0.0, sign * z + 0.0)
    x, y, z = vector(value)
    length = math.hypot(x, y, z)
    if not (math.isfinite(length) and length > 0):
        return NOT_A_VECTOR
    return (x / length, y / length, z / length)


def is_finite(value: Vector) -> bool:
    """Return True if all three components are finite."""
    return all(math.isfinite(component) for component in value)


def is_length(value: Any) -> bool:
    """Return True for a finite number; a truth value is not a number."""
    return isinstance(value, numbers.Real) and not isinstance(value, bool) and math.isfinite(value)


def script_line() -> str:
    """Return the innermost line outside this package as `file.py:12`; empty if all lines are inside."""
    frame = sys._getframe(1)
    while frame is not None:
        name = frame.f_code.co_filename
        if not name.startswith((_PACKAGE, "<")):
            return shown(f"{Path(name).name}:{frame.f_lineno}")
        frame = frame.f_back  # type: ignore[assignment]
    return ""
