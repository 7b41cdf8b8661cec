"""Freedoms: everything that varies, and its distribution. Column k of the deviations of a model belongs to its freedom k.

Locators come first, then features and variables. A feature receives its freedoms as it is made (see nominal_features),
and these their spreads as zones are filled (see variation/spreads).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from tolcontact.declaration import GeometricTolerance, Tolerance

LOCATOR, FEATURE, FORM, DATUM, VARIABLE = "locator", "feature", "form", "datum", "variable"  # sources
MAX_SCORE, SCORES = 8.0, 4001  # normal scores that a variance is summed over
TAIL = float(ndtr(-3))
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

    @property
    def range(self) -> float:
        """The full width of its zone; NaN if a distribution alone states how it varies."""
        if self.geometric is not None:
            return float(self.geometric.width)
        return np.nan if self.tolerance is None or self.tolerance.range is None else float(self.tolerance.range)

    @property
    def mean_shift(self) -> float:
        """The mean of its distribution; NaN if the distribution has none."""
        if self.tolerance is None:
            return self.mean
        distribution = self.tolerance.distribution
        return self.tolerance.mean_shift + (0.0 if isinstance(distribution, str) else float(distribution.mean()))

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
        return self.mean + self.spread * ndtri(u) if self.tolerance is None else quantile(self.tolerance, u)


def quantile(tolerance: Tolerance, u: np.ndarray) -> np.ndarray:
    """Return the deviation [mm] below which a share `u` (0 < u < 1) of parts lies."""
    if not isinstance(tolerance.distribution, str):
        deviations = np.asarray(tolerance.distribution.ppf(u), dtype=float)
    elif (width := float(tolerance.range or 0.0)) == 0:
        deviations = np.zeros_like(u)
    else:
        deviations = width / (tolerance.cp or 1.0) * QUANTILES[tolerance.distribution](u)
    return deviations + tolerance.mean_shift if tolerance.mean_shift else deviations
