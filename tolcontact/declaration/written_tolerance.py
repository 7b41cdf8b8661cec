"""Tolerances as drawings write them: limit deviations such as "±0.1" and "+0.1/-0.05", and lengths such as "0.2 mm", "0.01 in".

Plus and minus may be written "±", "+-" and "+/-", a minus as in Unicode. Two deviations are separated by a slash, a semicolon,
a space, or nothing. A comma between digits is a decimal comma. Deviations are pairs (lower, upper) everywhere else.
"""

import math
import re
from decimal import Decimal
from typing import Any, NamedTuple

from tolcontact.declaration.geometry import UNITS
from tolcontact.declaration.tolerance_class import UndefinedClass, tolerance_class
from tolcontact.declaration.values import is_length
from tolcontact.tables import MAX_NUMBER

EXAMPLES = '"±0.1", "+0.1/-0.05" or (-0.05, 0.1)'
MAX_SHOWN = 40  # characters of a text in a message
_NUMBER = r"(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?"
_LENGTH = re.compile(_NUMBER)
_BOTH = re.compile(rf"(?:±|\+ ?/? ?-|- ?/? ?\+) ?({_NUMBER})")
_LIMITS = re.compile(rf"([+-]? ?{_NUMBER})(?: ?[/;] ?| |, |(?=[+-]))([+-]? ?{_NUMBER})")
_ONE = re.compile(rf"([+-]) ?({_NUMBER})")
_THOUSANDS = re.compile(r"(?<![\d.,])[1-9]\d{0,2}(?:,\d{3})+(?!\d)")
_FIT = re.compile(r"([A-Z]{1,2}\d{1,2}) ?/ ?([a-z]{1,2}\d{1,2})")
_UNIT = re.compile(r"[\d.,] ?([^\W\d_]+|[°%\"'])$")
_DEGREES = re.compile(r" ?(?:°|deg)(?![^\W\d])")
_ALSO = {'"': "in", "inch": "in", "\N{MICRO SIGN}m": "um", "\N{GREEK SMALL LETTER MU}m": "um"}
_SIGNS = str.maketrans({"\N{MINUS SIGN}": "-", "\N{EN DASH}": "-", "\N{FULLWIDTH PLUS SIGN}": "+"})
DIGITS = 12  # of widths and middles after the point: more than a double has of a deviation


class TextFault(ValueError):
    """A text that is no tolerance; the message is the reason."""


class Deviations(NamedTuple):
    """The limit deviations from a nominal value."""

    lower: float
    upper: float

    @property
    def width(self) -> float:
        """The width of the zone between them."""
        return round(self.upper - self.lower, DIGITS)

    @property
    def middle(self) -> float:
        """The midpoint of the zone."""
        return round((self.upper + self.lower) / 2, DIGITS)

    def __str__(self) -> str:
        return " ".join(f"{limit:+g}" if limit else "0" for limit in (self.upper, self.lower))


def written(value: Any, *, units: str = "mm", nominal: float | None = None) -> Any:
    """Return Deviations for texts of limit deviations and for pairs, a number for the text of one; other values as they are.

    A tolerance class such as "H7" needs a `nominal` size [mm]. Degrees become radians if the `units` are "rad", and lengths in
    other units, such as "±0.005 in", lengths in `units`. NumPy numbers become Python numbers. Raises TextFault for other texts
    and pairs.
    """
    if isinstance(value, list | tuple):
        return _pair(value)
    if not isinstance(value, str):
        return float(value) if is_length(value) and not isinstance(value, int | float) else value
    text = " ".join(value.translate(_SIGNS).split())
    try:
        stated_class = tolerance_class(text)
        if stated_class and nominal is not None:
            return Deviations(*stated_class.deviations(nominal))
    except UndefinedClass as error:
        raise TextFault(str(error)) from error
    if stated_class:
        raise TextFault(f'a tolerance class is for sizes, as in tc.Size(10, "{stated_class}"); expected {EXAMPLES}')
    if fit := _FIT.fullmatch(text):
        raise TextFault(f'it is a fit of two parts; give "{fit[1]}" to the hole, and "{fit[2]}" to the shaft')
    if units == "rad" and _DEGREES.search(text):
        value = _parsed(_DEGREES.sub("", text))
        return Deviations(*map(math.radians, value)) if isinstance(value, Deviations) else math.radians(value)
    factor = 1.0
    if (match := _UNIT.search(text)) and {unit := _ALSO.get(match[1], match[1]), units} <= UNITS.keys():
        factor, units = UNITS[unit] / UNITS[units], match[1]
    return _scaled(_parsed(_without_units(text, units)), factor)


def _scaled(value: Deviations | float, factor: float) -> Deviations | float:
    if factor == 1.0:
        return value
    return Deviations(*(round(factor * limit, DIGITS) for limit in value)) if isinstance(value, Deviations) else factor * value


def _pair(pair: Any) -> Deviations:
    if len(pair) != 2 or not all(map(is_length, pair)):
        raise TextFault("expected two numbers, the lower and the upper limit deviation, as in (-0.05, 0.1)")
    lower, upper = map(float, pair)
    if lower > upper:
        raise TextFault(f"the lower limit {lower:+g} is above the upper one {upper:+g}; swap them")
    return Deviations(lower, upper)


def _without_units(text: str, units: str) -> str:
    if units and not any(character.isdigit() for character in units):
        text = re.sub(rf"(?<=[\d.,]) ?{re.escape(units)}(?![^\W\d])", "", text)
    if match := _UNIT.search(text):
        raise TextFault(f"its unit is {match[1][:MAX_SHOWN]}; expected {units}, or no unit")
    return text


def _parsed(text: str) -> Deviations | float:
    if _THOUSANDS.search(text):
        raise TextFault("its comma may separate decimals or thousands; write a decimal point")
    if _LENGTH.fullmatch(text):
        return _number(text)
    if match := _BOTH.fullmatch(text):
        return Deviations(-_number(match[1]), _number(match[1]))
    if match := _ONE.fullmatch(text):
        zone = f"{text}/0" if match[1] == "+" else f"0/{text}"
        raise TextFault(f'it states one of two limits; write "{zone}" if the other one is 0, "±{match[2]}" for both sides')
    if match := _LIMITS.fullmatch(text):
        if any(side[0] not in "+-" and _number(side) for side in match.groups()):
            raise TextFault(f"a limit has no sign; expected deviations from the nominal value, such as {EXAMPLES}")
        return Deviations(*sorted(map(_number, match.groups())))
    raise TextFault(f"expected a number, or limit deviations such as {EXAMPLES}")


def _number(text: str) -> float:
    number = float(Decimal(text.replace(",", ".").replace(" ", "")))
    if abs(number) > MAX_NUMBER:
        raise TextFault(f"expected numbers up to {MAX_NUMBER:g}")
    return number + 0.0


def text_fault(value: Any, *, units: str = "mm", nominal: float | None = None) -> str:
    """Return why a text or a pair is no tolerance; empty if it is one, and for other values."""
    try:
        written(value, units=units, nominal=nominal)
    except TextFault as fault:
        text = repr(value)
        return f"{text if len(text) <= MAX_SHOWN else text[:MAX_SHOWN] + '...'}; {fault}"
    return ""
