"""The scale of deviations: whether they are as large as their zone, nominal size and part let expect, and why they are not."""

from bisect import bisect_left
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tolcontact.declaration.geometry import UNITS
from tolcontact.declaration.written_tolerance import RANGES, WIDTHS

MIN_ZONES, MAX_ZONES = 0.1, 5.0  # widths of a zone: six standard deviations, and the distance of a mean, of plausible parts
MAX_SIZE_SHARE = 0.5  # of a nominal size: what can be no deviation from it
CONSTANT_SHARE = 1e-9  # of a part's size: a distribution this narrow is a constant
OUTLIER_SIGMAS, MIN_ROWS = 20.0, 8  # robust standard deviations of a column with this many rows
NORMAL_MAD = 1.4826  # standard deviations of a normal distribution in its median absolute deviation
FINEST, COARSEST = "01", "18"  # standard tolerance grades
UNIT_NAMES = {"um": "micrometres", "in": "inches", "m": "metres", "cm": "centimetres"}


def grade_width(grade: str, size: float) -> float:
    """Return the width [mm] of a tolerance grade of ISO 286-1 for a size; beyond its table the one of its last sizes."""
    widths = WIDTHS[grade].split()
    return float(widths[min(bisect_left(list(map(float, RANGES.split())), size), len(widths) - 1)]) / 1000


class Cause(NamedTuple):
    """Why deviations are out of scale: their unit, and whether they are absolute. They were converted twice if it is ""."""

    unit: str
    is_absolute: bool

    @property
    def factor(self) -> float:
        """The factor that converts them to mm."""
        return UNITS[self.unit] if self.unit else 1 / UNITS["in"]

    def __str__(self) -> str:
        kind = "absolute values" if self.is_absolute else "deviations"
        return kind + (f" in {UNIT_NAMES[self.unit]}" if self.unit in UNIT_NAMES else "" if self.unit else " times 25.4")

    @property
    def arguments(self) -> str:
        """The arguments of `population` that read them correctly."""
        units = f'units="{self.unit}"' if self.unit in UNIT_NAMES else "" if self.unit else 'units="mm"'
        return ", ".join(["absolute=True"] * self.is_absolute + [units] * bool(units))


CAUSES = [Cause(unit, is_absolute) for is_absolute in (True, False) for unit in ("mm", "um", "in", "m", "cm", "")]


@dataclass(frozen=True)
class Scale:
    """What the deviations of a contributor are compared with [mm]; 0 for what it does not have.

    part      longest extent of its part
    size      nominal size of its feature
    nominal   value that absolute values of it are around: the size, or the coordinate of a locator
    width     width of the zone of its tolerance
    middle    midpoint of this zone
    """

    part: float
    size: float = 0.0
    nominal: float = 0.0
    width: float = 0.0
    middle: float = 0.0

    @property
    def limit(self) -> float:
        """The smallest value that can be no deviation [mm]."""
        return MAX_SIZE_SHARE * self.size or self.part

    @property
    def extent(self) -> float:
        """The size, or the extent of the part, that standard tolerances are of."""
        return self.size or self.part

    @property
    def plausible(self) -> tuple[float, float]:
        """The smallest and the largest plausible width of deviations: by the zone, or by the standard tolerance grades."""
        if self.width > CONSTANT_SHARE * self.part:
            return MIN_ZONES * self.width, MAX_ZONES * self.width
        return grade_width(FINEST, self.extent), grade_width(COARSEST, self.extent)

    def fits(self, centre: float, width: float) -> bool:
        """Return whether deviations with this centre and width (six standard deviations) are plausible."""
        smallest, largest = self.plausible
        is_constant = width <= CONSTANT_SHARE * self.part
        return abs(centre - self.middle) <= largest and width <= largest and (is_constant or width >= smallest)

    def cause(self, centre: float, width: float) -> Cause | None:
        """Return the likely cause of deviations that do not fit; None without one."""
        expected = float(np.sqrt(np.prod(self.plausible)))
        fitting = [
            cause
            for cause in CAUSES
            if self.fits(cause.factor * centre - (self.nominal if cause.is_absolute else 0.0), cause.factor * width)
            and (self.nominal or not cause.is_absolute)
            and (cause.unit or width > self.plausible[1])
        ]
        distances = [(not cause.is_absolute, abs(np.log(cause.factor * width / expected))) for cause in fitting if width]
        return fitting[min(range(len(distances)), key=distances.__getitem__)] if distances else next(iter(fitting), None)


def robust_spread(values: np.ndarray) -> float:
    """Return the standard deviation of values (row,) from their median absolute deviation, which outliers do not change."""
    return NORMAL_MAD * float(np.median(np.abs(values - np.median(values)))) or float(values.std())


def _width(scale: Scale, values: np.ndarray) -> float:
    """Return six standard deviations of values (row,), and twice the largest deviation if they are few."""
    return 6 * robust_spread(values) if len(values) >= MIN_ROWS else 2 * float(np.abs(values - scale.middle).max(initial=0.0))


def outliers(values: np.ndarray, width: float) -> np.ndarray:
    """Return the rows of values (row,) that lie implausibly far from the others, and beyond the width of the zone [mm]."""
    distances = np.abs(values - np.median(values))
    is_far = distances > max(OUTLIER_SIGMAS * robust_spread(values), width)
    return np.flatnonzero(is_far & (len(values) >= MIN_ROWS))


def doubt_of_rows(scale: Scale, label: str, values: np.ndarray) -> str:
    """Return what is odd about measured deviations (row,) of a contributor, and what to do; empty if they are plausible."""
    centre, width = float(np.median(values)), _width(scale, values)
    beyond, is_zone_known = outliers(values, scale.width), scale.width > CONSTANT_SHARE * scale.part
    if scale.fits(centre, width):
        if not len(beyond):
            return ""
        row = beyond[0]
        others = f", as are {len(beyond) - 1} more rows" if len(beyond) > 1 else ""
        return (
            f"row {row + 1} of {label} is {values[row]:.6g}, far from the others (around {centre:.4g}){others}; "
            "leave out rows that state a missing value, or mend them"
        )
    zone = f"the zone of {scale.width:.4g} mm" if is_zone_known else f"a length of {scale.extent:.4g} mm"
    cause, advice = scale.cause(centre, width), "check their units"
    if cause is not None and cause.is_absolute and not scale.size:
        advice = f"they are probably {cause}: subtract the nominal value {scale.nominal:.6g} from these in mm"
    elif cause is not None:
        advice = f"they are probably {cause}: population(..., {cause.arguments}) reads these"
    return f"{label} is around {centre:.6g} and {width:.2g} wide, which does not fit {zone}; {advice}"


def doubt_of_distribution(scale: Scale, centre: float, width: float) -> str:
    """Return what is odd about a distribution [mm] by its median and six standard deviations; empty if it is plausible."""
    if scale.fits(centre, width):
        return ""
    cause, advice = scale.cause(centre, width), "check its units, which are mm"
    if cause is not None:
        advice = f"its numbers are probably {cause}; it is one of deviations in mm"
        advice += f": subtract the nominal value {scale.nominal:.6g}" if cause.is_absolute else ""
    zone = f"the zone of {scale.width:.4g} mm" if scale.width else f"a length of {scale.extent:.4g} mm"
    return f"its distribution is around {centre:.6g} and {width:.2g} mm wide (6 sigma), which does not fit {zone}; {advice}"
