"""From the zone of a form to the spread of its modes: the share of faces that lie inside, as for displacements (see zones).

The width of the least zone is a seminorm of the coefficients. In each direction of these the zone ends at a distance; the share
of faces nearer than that is the chi distribution's.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from scipy.special import ndtri

from tolcontact.features import FormField
from tolcontact.features.least_zone import least_widths
from tolcontact.variation.zones import SHARE

LOG2_DIRECTIONS = 12
MIN_SPREAD, MAX_SPREAD = 1e-6, 1e3  # of the width


@dataclass(frozen=True, eq=False)
class FormSpread:
    """The widths of the least zones of a form field, whose modes have independent normal coefficients of equal spread."""

    field: FormField

    @cached_property
    def widths(self) -> np.ndarray:
        """The widths (direction,) of the zones for unit vectors of coefficients in all directions evenly."""
        heights = self.field.heights(self.field.places)
        normal = ndtri(scipy.stats.qmc.Sobol(self.field.modes, scramble=True, seed=0).random_base2(LOG2_DIRECTIONS))
        directions = normal / np.linalg.norm(normal, axis=1, keepdims=True)
        return least_widths(self.field.places, directions @ heights.T)

    def share_inside(self, spread: float, width: float) -> float:
        """Return the share of faces, with coefficients of a standard deviation [mm], inside a zone of a width [mm]."""
        return float(scipy.stats.chi.cdf(width / spread / np.maximum(self.widths, 1e-300), self.field.modes).mean())

    def spread(self, width: float) -> float:
        """Return the standard deviation [mm] of the coefficients with which 99.73 % of the faces lie inside a zone."""

        def excess(spread: float) -> float:
            return self.share_inside(spread, width) - SHARE

        return float(scipy.optimize.brentq(excess, MIN_SPREAD * width, MAX_SPREAD * width, xtol=1e-12 * width))

    def mean_width(self, spread: float) -> float:
        """Return the mean width [mm] of the least zones of faces, with coefficients of a standard deviation [mm]."""
        return float(spread * scipy.stats.chi.mean(self.field.modes) * self.widths.mean())
