"""Tolerances as drawings write them: limit deviations such as "±0.1", lengths such as "0.2 mm", classes of ISO 286-1:2010.

In limit deviations, such as "+0.1/-0.05", plus and minus may be written "±", "+-" and "+/-", a minus as in Unicode. Two of them
are separated by a slash, a semicolon, a space, or nothing. A comma between digits is a decimal comma. Deviations are pairs
(lower, upper) everywhere else.

The tables hold the standard's values in micrometres: the grades IT01 to IT18 of its Table 1, and the fundamental deviations of
its Tables 2 to 5, for sizes up to 3150 mm. A row begins at the smallest sizes; "-" is no value, and neither is the end of a
shorter row. The class of a hole has capital letters, and its fundamental deviation is the one of the shaft of the same
letter, mirrored and, for fine grades of K to ZC, increased by a correction.
"""

import math
import re
from bisect import bisect_left
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, NamedTuple

from tolcontact.declaration.geometry import UNITS
from tolcontact.declaration.values import is_length
from tolcontact.tables import MAX_NUMBER

RANGES = "3 6 10 18 30 50 80 120 180 250 315 400 500 630 800 1000 1250 1600 2000 2500 3150"
SUBRANGES = (
    "3 6 10 14 18 24 30 40 50 65 80 100 120 140 160 180 200 225 250 280 315 355 400 450 500 "
    "560 630 710 800 900 1000 1120 1250 1400 1600 1800 2000 2240 2500 2800 3150"
)
WIDTHS = {
    "01": "0.3 0.4 0.4 0.5 0.6 0.6 0.8 1 1.2 2 2.5 3 4",
    "0": "0.5 0.6 0.6 0.8 1 1 1.2 1.5 2 3 4 5 6",
    "1": "0.8 1 1 1.2 1.5 1.5 2 2.5 3.5 4.5 6 7 8 9 10 11 13 15 18 22 26",
    "2": "1.2 1.5 1.5 2 2.5 2.5 3 4 5 7 8 9 10 11 13 15 18 21 25 30 36",
    "3": "2 2.5 2.5 3 4 4 5 6 8 10 12 13 15 16 18 21 24 29 35 41 50",
    "4": "3 4 4 5 6 7 8 10 12 14 16 18 20 22 25 28 33 39 46 55 68",
    "5": "4 5 6 8 9 11 13 15 18 20 23 25 27 32 36 40 47 55 65 78 96",
    "6": "6 8 9 11 13 16 19 22 25 29 32 36 40 44 50 56 66 78 92 110 135",
    "7": "10 12 15 18 21 25 30 35 40 46 52 57 63 70 80 90 105 125 150 175 210",
    "8": "14 18 22 27 33 39 46 54 63 72 81 89 97 110 125 140 165 195 230 280 330",
    "9": "25 30 36 43 52 62 74 87 100 115 130 140 155 175 200 230 260 310 370 440 540",
    "10": "40 48 58 70 84 100 120 140 160 185 210 230 250 280 320 360 420 500 600 700 860",
    "11": "60 75 90 110 130 160 190 220 250 290 320 360 400 440 500 560 660 780 920 1100 1350",
    "12": "100 120 150 180 210 250 300 350 400 460 520 570 630 700 800 900 1050 1250 1500 1750 2100",
    "13": "140 180 220 270 330 390 460 540 630 720 810 890 970 1100 1250 1400 1650 1950 2300 2800 3300",
    "14": "250 300 360 430 520 620 740 870 1000 1150 1300 1400 1550 1750 2000 2300 2600 3100 3700 4400 5400",
    "15": "400 480 580 700 840 1000 1200 1400 1600 1850 2100 2300 2500 2800 3200 3600 4200 5000 6000 7000 8600",
    "16": "600 750 900 1100 1300 1600 1900 2200 2500 2900 3200 3600 4000 4400 5000 5600 6600 7800 9200 11000 13500",
    "17": "1000 1200 1500 1800 2100 2500 3000 3500 4000 4600 5200 5700 6300 7000 8000 9000 10500 12500 15000 17500 21000",
    "18": "1400 1800 2200 2700 3300 3900 4600 5400 6300 7200 8100 8900 9700 11000 12500 14000 16500 19500 23000 28000 33000",
}
# Distances of the zones from the nominal size: of a to h below it, of k to zc above it.
_DISTANCES = {
    "cd": "34 46 56 70 85 100",
    "d": "20 30 40 50 65 80 100 120 145 170 190 210 230 260 290 320 350 390 430 480 520",
    "e": "14 20 25 32 40 50 60 72 85 100 110 125 135 145 160 170 195 220 240 260 290",
    "ef": "10 14 18 23 28 35",
    "f": "6 10 13 16 20 25 30 36 43 50 56 62 68 76 80 86 98 110 120 130 145",
    "fg": "4 6 8 10 12 15",
    "g": "2 4 5 6 7 9 10 12 14 15 17 18 20 22 24 26 28 30 32 34 38",
    "h": "0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0",
    "k": "0 1 1 1 2 2 2 3 3 4 4 4 5 0 0 0 0 0 0 0 0",
    "m": "2 4 6 7 8 9 11 13 15 17 20 21 23 26 30 34 40 48 58 68 76",
    "n": "4 8 10 12 15 17 20 23 27 31 34 37 40 44 50 56 66 78 92 110 135",
    "p": "6 12 15 18 22 26 32 37 43 50 56 62 68 78 88 100 120 140 170 195 240",
}
_DISTANCES_OF_SUBRANGES = {
    "a": "270 270 280 290 290 300 300 310 320 340 360 380 410 460 520 580 660 740 820 920 1050 1200 1350 1500 1650",
    "b": "140 140 150 150 150 160 160 170 180 190 200 220 240 260 280 310 340 380 420 480 540 600 680 760 840",
    "c": "60 70 80 95 95 110 110 120 130 140 150 170 180 200 210 230 240 260 280 300 330 360 400 440 480",
    "r": "10 15 19 23 23 28 28 34 34 41 43 51 54 63 65 68 77 80 84 94 98 108 114 126 132 150 155 175 185 210 220 250 260 300 "
    "330 370 400 440 460 550 580",
    "s": "14 19 23 28 28 35 35 43 43 53 59 71 79 92 100 108 122 130 140 158 170 190 208 232 252 280 310 340 380 430 470 520 "
    "580 640 720 820 920 1000 1100 1250 1400",
    "t": "- - - - - - 41 48 54 66 75 91 104 122 134 146 166 180 196 218 240 268 294 330 360 400 450 500 560 620 680 780 840 "
    "960 1050 1200 1350 1500 1650 1900 2100",
    "u": "18 23 28 33 33 41 48 60 70 87 102 124 144 170 190 210 236 258 284 315 350 390 435 490 540 600 660 740 840 940 1050 "
    "1150 1300 1450 1600 1850 2000 2300 2500 2900 3200",
    "v": "- - - - 39 47 55 68 81 102 120 146 172 202 228 252 284 310 340 385 425 475 530 595 660",
    "x": "20 28 34 40 45 54 64 80 97 122 146 178 210 248 280 310 350 385 425 475 525 590 660 740 820",
    "y": "- - - - - 63 75 94 114 144 174 214 254 300 340 380 425 470 520 580 650 730 820 920 1000",
    "z": "26 35 42 50 60 73 88 112 136 172 210 258 310 365 415 465 520 575 640 710 790 900 1000 1100 1250",
    "za": "32 42 52 64 77 98 118 148 180 226 274 335 400 470 535 600 670 740 820 920 1000 1150 1300 1450 1600",
    "zb": "40 50 67 90 108 136 160 200 242 300 360 445 525 620 700 780 880 960 1050 1200 1300 1500 1650 1850 2100",
    "zc": "60 80 97 130 150 188 218 274 325 405 480 585 690 800 900 1000 1150 1250 1350 1550 1700 1900 2100 2400 2600",
}  # fmt: skip
# For j and J, on both sides of the nominal size: the lower limit of shafts below it, the upper limit of holes above it.
_LOWER_LIMITS_OF_J = {
    "5": "2 2 2 3 4 5 7 9 11 13 16 18 20",
    "6": "2 2 2 3 4 5 7 9 11 13 16 18 20",
    "7": "4 4 5 6 8 10 12 15 18 21 26 28 32",
    "8": "6",
}
_UPPER_LIMITS_OF_J = {
    "6": "2 5 5 6 8 10 13 16 18 22 25 29 33",
    "7": "4 6 8 10 12 14 18 22 26 30 36 39 43",
    "8": "6 10 12 15 20 24 28 34 41 47 55 60 66",
}
GRADES = tuple(WIDTHS)
LETTERS = tuple(re.findall(r"\w+", "a b c cd d e ef f fg g h js j k m n p r s t u v x y z za zb zc"))
_BELOW = LETTERS[: LETTERS.index("h") + 1]  # the zone of a shaft lies below the nominal size
_CLASS = re.compile(r"([A-Za-z]{1,2}) ?(01|0|[1-9]\d?)")
_LARGEST = 3150.0  # [mm]
_SMALLEST, _CORRECTED = 3.0, 500.0  # [mm] corrections are for sizes above the first one, up to the second one
_TINY = 1.0  # [mm] sizes up to it have no a, no b, no coarse grades
_MICROMETRES = 1000.0  # in a millimetre
_DIGITS = 7  # of limit deviations [mm] after the point
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


@dataclass(frozen=True)
class ToleranceClass:
    """The letters of a fundamental deviation, capital ones for holes, and a grade "01", "0", "1" to "18"."""

    letters: str
    grade: str

    @property
    def is_hole(self) -> bool:
        """Whether it is for holes and other internal sizes."""
        return self.letters.isupper()

    def deviations(self, nominal: float) -> tuple[float, float]:
        """Return the lower and the upper limit deviation [mm] of a nominal size [mm]. Raises TextFault."""
        width = self._width(nominal)
        letter = self.letters.lower()
        if letter == "js":
            lower = -width / 2
        elif letter == "j":
            limits = _UPPER_LIMITS_OF_J if self.is_hole else _LOWER_LIMITS_OF_J
            limit = self._value(limits.get(self.grade, ""), RANGES, nominal)
            lower = limit - width if self.is_hole else -limit
        elif letter in _BELOW:
            distance = self._distance(letter, nominal)
            lower = distance if self.is_hole else -distance - width
        else:
            lower = self._upper_deviation_of_hole(letter, nominal) - width if self.is_hole else self._above(letter, nominal)
        return round(lower / _MICROMETRES, _DIGITS), round((lower + width) / _MICROMETRES, _DIGITS)

    def _width(self, nominal: float) -> float:
        if not 0 < nominal <= _LARGEST:
            raise self._undefined(nominal, f"it is for sizes above 0, up to {_LARGEST:g} mm")
        if nominal <= _TINY and self._number >= 14:
            raise self._undefined(nominal, f"its grades 14 to 18 are for sizes above {_TINY:g} mm")
        return self._value(WIDTHS[self.grade], RANGES, nominal)

    def _distance(self, letter: str, nominal: float) -> float:
        if letter in ("a", "b") and nominal <= _TINY:
            raise self._undefined(nominal, f"it has {self.letters} for sizes above {_TINY:g} mm")
        if letter in _DISTANCES:
            return self._value(_DISTANCES[letter], RANGES, nominal)
        return self._value(_DISTANCES_OF_SUBRANGES[letter], SUBRANGES, nominal)

    def _above(self, letter: str, nominal: float) -> float:
        """Return the lower deviation of a shaft above the nominal size; k is above it in grades 4 to 7 alone."""
        return 0.0 if letter == "k" and not 4 <= self._number <= 7 else self._distance(letter, nominal)

    def _upper_deviation_of_hole(self, letter: str, nominal: float) -> float:
        """Return the upper deviation of a hole of K to ZC, which has a correction in fine grades of sizes up to 500 mm."""
        distance, is_corrected = self._distance(letter, nominal), _SMALLEST < nominal <= _CORRECTED
        if letter == "k" and self._number > 8 and nominal > _SMALLEST:
            raise self._undefined(nominal, f"it has K above grade 8 for sizes up to {_SMALLEST:g} mm alone")
        if letter == "n" and self._number > 8 and nominal <= _TINY:
            raise self._undefined(nominal, f"it has N above grade 8 for sizes above {_TINY:g} mm")
        if letter == "n" and self._number > 8 and is_corrected:
            return 0.0
        if not is_corrected or self._number > (8 if letter in ("k", "m", "n") else 7):
            return -distance
        if self._number < 3:
            raise self._undefined(nominal, f"it has {self.letters} of such sizes from grade 3")
        if self.letters + self.grade == "M6" and 250 < nominal <= 315:
            return -9.0  # the exception of Table 2
        finer = GRADES[GRADES.index(self.grade) - 1]
        return self._width(nominal) - ToleranceClass(self.letters, finer)._width(nominal) - distance

    @property
    def _number(self) -> int:
        return GRADES.index(self.grade) - 1

    def _value(self, row: str, ranges: str, nominal: float) -> float:
        """Return the value of a row [um] at a nominal size."""
        ends, values = list(map(float, ranges.split())), row.split()
        place = bisect_left(ends, nominal)
        if not values:
            raise self._undefined(nominal, "j has the grades 5 to 8, J the grades 6 to 8")
        if place >= len(values) or values[place] == "-":
            above = f"above {ends[values.count('-') - 1]:g} mm, " if "-" in values else ""
            raise self._undefined(nominal, f"it is for sizes {above}up to {ends[len(values) - 1]:g} mm")
        return float(values[place])

    def _undefined(self, nominal: float, reason: str) -> TextFault:
        return TextFault(f"ISO 286-1 does not define {self} for {nominal:g} mm: {reason}")

    def __str__(self) -> str:
        return self.letters + self.grade


def tolerance_class(text: str) -> ToleranceClass | None:
    """Return the tolerance class that a text names; None for a text of another form.

    Raises TextFault for letters or a grade that the standard does not have.
    """
    match = _CLASS.fullmatch(text)
    if match is None:
        return None
    letters, grade = match.groups()
    if letters.upper() == "IT":
        raise TextFault(f'it is a grade alone; add letters, as in "H{grade}" for a hole and "h{grade}" for a shaft')
    if letters.lower() not in LETTERS:
        known = ", ".join(LETTERS)
        raise TextFault(f'ISO 286-1 has no letters "{letters}"; its letters are {known}, and their capitals for holes')
    if not (letters.isupper() or letters.islower()):
        hole, shaft = letters.upper() + grade, letters.lower() + grade
        raise TextFault(f'"{text}" mixes cases; write "{hole}" for a hole, "{shaft}" for a shaft')
    if grade not in GRADES:
        raise TextFault(f"ISO 286-1 has no grade {grade}; its grades are 01, 0, and 1 to {GRADES[-1]}")
    return ToleranceClass(letters, grade)


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
    stated_class = tolerance_class(text)
    if stated_class and nominal is not None:
        return Deviations(*stated_class.deviations(nominal))
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
