"""Freedoms: everything that varies, and its distribution. Column k of the deviations of a model belongs to its freedom k.

Locators come first, then features and variables. A feature receives its freedoms as it is made (see nominal_features),
and these their spreads as zones are filled (see variation/spreads).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from tolcontact.declaration import GeometricTolerance, Tolerance
from tolcontact.declaration.tolerance import EITHER, side_in_words

LOCATOR, FEATURE, FORM, DATUM, VARIABLE = "locator", "feature", "form", "datum", "variable"  # sources
MAX_SCORE, SCORES = 8.0, 4001  # normal scores that a variance is summed over
TAIL = float(ndtr(-3))
BISECTED = 1e-15  # of the first interval of a bisection
# Quantiles of the named distributions for a zone of width 1.
QUANTILES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "normal": lambda u: ndtri(u) / 6,
    "uniform": lambda u: u - 0.5,
    "triangular": lambda u: np.where(u < 0.5, np.sqrt(u / 2) - 0.5, 0.5 - np.sqrt((1 - u) / 2)),
    "truncated normal": lambda u: ndtri(TAIL + u * (1 - 2 * TAIL)) / 6,
}


@dataclass(frozen=True, eq=False)
class Freedom:
    """A degree of freedom of a locator, a feature or a variable.

    label      "part.locator", "part.feature.freedom", "part.pattern.freedom" of several members, or the name of a variable
    source     "locator", "feature", "form", "variable", or "datum": a shift that follows from other deviations
    tolerance  of a locator, a size or a variable
    geometric  of a displacement or a form of a feature: the tolerance that controls it
    units      of its deviations
    rule       of a datum: what its shift follows from
    spread     [mm] standard deviation of a displacement of a feature, or of a coefficient of its form
    mean       [mm] of a displacement of a feature, or of a coefficient of its form
    middle     [mm] of the zone of a displacement; nonzero for an unequally disposed zone (UZ)
    lot        of a displacement: distance of the means of lots on either side, in standard deviations (see lot_score)
    """

    label: str
    source: str
    tolerance: Tolerance | None = None
    geometric: GeometricTolerance | None = None
    units: str = "mm"
    rule: str = ""
    spread: float = 0.0
    mean: float = 0.0
    middle: float = 0.0
    lot: float = 0.0

    @property
    def range(self) -> float:
        """The full width of its zone; NaN if a distribution alone states how it varies."""
        if self.geometric is not None:
            return float(self.geometric.width)
        return np.nan if self.tolerance is None or self.tolerance.range is None else float(self.tolerance.range)

    @property
    def parts(self) -> int:
        """The number of parts that its distribution was estimated from; 0 if it is known."""
        return 0 if self.tolerance is None else self.tolerance.parts or 0

    @property
    def mean_shift(self) -> float:
        """The mean of its distribution; NaN if the distribution has none."""
        if self.tolerance is None:
            return self.mean
        distribution = self.tolerance.distribution
        return self.tolerance.mean_shift + (0.0 if isinstance(distribution, str) else float(distribution.mean()))

    @property
    def lot_distance(self) -> float:
        """The distance of the means of lots from the centre, if they may be on either side; else 0."""
        if self.tolerance is None:
            return self.lot * self.spread
        return self.tolerance.off_centre if self.tolerance.side == EITHER else 0.0

    @property
    def side_in_words(self) -> str:
        """The side on which its mean is off centre by cpk; empty if it is not."""
        tolerance = self.tolerance or self.geometric
        is_off = self.tolerance.off_centre if self.tolerance else self.lot or self.mean != self.middle
        return side_in_words(tolerance.side) if tolerance and is_off else ""

    @property
    def description(self) -> str:
        """The name of its distribution; of a freedom of a feature the tolerance, and the rule from its zone to the spread."""
        if self.geometric is not None:
            return f"{self.geometric.archived_text}; {self.geometric.rule}"
        if self.tolerance is None:
            return self.rule
        name = self.tolerance.distribution
        return name if isinstance(name, str) else str(name.dist.name)

    @property
    def variance(self) -> float:
        """The variance of its distribution alone, by the trapezoidal rule in normal scores."""
        z = np.linspace(-MAX_SCORE, MAX_SCORE, SCORES)
        weights = np.exp(-(z**2) / 2)
        weights /= weights.sum()
        x = self.deviations(ndtr(z))
        return float(weights @ (x - weights @ x) ** 2)

    def deviations(self, u: np.ndarray) -> np.ndarray:
        """Return its deviations for numbers between 0 and 1."""
        if self.tolerance is not None:
            return quantile(self.tolerance, u)
        return self.mean + self.spread * (mixed_score(u, self.lot) if self.lot else ndtri(u))


def quantile(tolerance: Tolerance, u: np.ndarray) -> np.ndarray:
    """Return the deviation [mm] below which a share `u` (0 < u < 1) of parts lies."""
    if not isinstance(tolerance.distribution, str):
        deviations = np.asarray(tolerance.distribution.ppf(u), dtype=float)
    elif (width := float(tolerance.range or 0.0)) == 0:
        deviations = np.zeros_like(u)
    else:
        lot = lot_score(tolerance)
        scores = mixed_score(u, lot) / 6 if lot else QUANTILES[tolerance.distribution](u)
        deviations = width / (tolerance.cp or 1.0) * scores
    return deviations + tolerance.mean_shift if tolerance.mean_shift else deviations


def lot_score(tolerance: Tolerance | GeometricTolerance) -> float:
    """Return how many standard deviations the means of lots are off the centre on either side; 0 if the side is known."""
    return (
        3 * (tolerance.cp - tolerance.cpk) if tolerance.side == EITHER and tolerance.cp and tolerance.cpk is not None else 0.0
    )


def mixed_score(u: np.ndarray, lot: float) -> np.ndarray:
    """Return the quantiles z of the standard normal distribution moved by `lot` to either side, with equal odds.

    The equation is (Phi(z - lot) + Phi(z + lot)) / 2 = u. Bisection solves it in the lower half, where z is between the
    quantiles of both sides.
    """
    lower_half = np.minimum(u, 1 - u)
    middle, step = ndtri(lower_half), lot
    while step > BISECTED * lot:
        step /= 2
        middle = np.where((ndtr(middle - lot) + ndtr(middle + lot)) / 2 < lower_half, middle + step, middle - step)
    return np.asarray(np.where(u < 0.5, middle, -middle))
