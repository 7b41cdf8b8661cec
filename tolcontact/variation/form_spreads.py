"""From the zone of a form to the spread of its modes: the share of faces that lie inside, as for displacements (see zones).

Tolerances around that of a form limit form and displacements together: what the form leaves of their zones is left to these.

The width of the least zone is a seminorm of the coefficients. In each direction of these the zone ends at a distance; the share
of faces nearer than that is the chi distribution's.
"""

import functools
from dataclasses import dataclass

import numpy as np
import scipy

from tolcontact.features import FormField
from tolcontact.features.least_zone import ZoneMember, least_widths
from tolcontact.variation.zones import SHARE, MemberZone, chi_share, directions

DIRECTIONS = 1 << 12
NESTED_DIRECTIONS = 1 << 13  # displacements have larger spreads than modes, so that fewer directions tell more
FACES = 500  # that are drawn for the mean width of measured ones
MIN_SPREAD, MAX_SPREAD = 1e-6, 1e3  # of the width


@functools.lru_cache(64)
def _unit_widths(zone: tuple[tuple[bytes, bytes], ...], heights: bytes, modes: int) -> np.ndarray:
    """Return the widths (direction,) [mm] of least zones of a number of modes with heights (place, mode).

    The zone is given by the numbers and the rows of its members.
    """
    members = [
        ZoneMember(numbers, np.frombuffer(rows).reshape(len(numbers), -1))
        for numbers, rows in ((np.frombuffer(numbers, dtype=int), rows) for numbers, rows in zone)
    ]
    return least_widths(members, directions(modes)[:DIRECTIONS] @ np.frombuffer(heights).reshape(-1, modes).T)


@dataclass(frozen=True, eq=False)
class FormSpread:
    """The widths of the least zones of a form field, whose modes have independent normal coefficients of equal spread."""

    field: FormField

    @functools.cached_property
    def widths(self) -> np.ndarray:
        """The widths (direction,) of the zones for unit vectors of coefficients in all directions evenly."""
        zone = tuple((member.numbers.tobytes(), member.rows.tobytes()) for member in self.field.zone)
        return _unit_widths(zone, self.field.place_heights.T.tobytes(), self.field.modes)

    def share_inside(self, spread: float, width: float) -> float:
        """Return the share of faces, with coefficients of a standard deviation [mm], inside a zone of a width [mm]."""
        return float(chi_share(width / spread / np.maximum(self.widths, 1e-300), self.field.modes).mean())

    def spread(self, width: float) -> float:
        """Return the standard deviation [mm] of the coefficients with which 99.73 % of the faces lie inside a zone."""

        def excess(spread: float) -> float:
            return self.share_inside(spread, width) - SHARE

        return float(scipy.optimize.brentq(excess, MIN_SPREAD * width, MAX_SPREAD * width, xtol=1e-12 * width))

    def spreads(self, width: float, cp: float) -> np.ndarray:
        """Return the standard deviations (mode,) [mm] of the coefficients, for a process capability: equal, or as measured."""
        if self.field.spreads is not None:
            return self.field.spreads
        return np.full(self.field.modes, self.spread(width) / cp)

    def mean_width(self, spreads: np.ndarray) -> float:
        """Return the mean width [mm] of the least zones of faces, with coefficients of standard deviations (mode,) [mm]."""
        if self.field.means is None:
            mean_length = np.sqrt(2) * scipy.special.poch(self.field.modes / 2, 0.5)  # of the chi distribution
            return float(spreads[0] * mean_length * self.widths.mean())
        faces = self.field.means + spreads * np.random.default_rng(0).normal(size=(FACES, len(spreads)))
        return float(least_widths(self.field.zone, faces @ self.field.place_heights).mean())


@dataclass(frozen=True, eq=False)
class FormedZone(MemberZone):
    """The zone of a plane that has form and displacements.

    heights  (place, mode) [mm] of the form for coefficients of one standard deviation
    offsets  (place, coordinate): heights of the plane for coordinates of 1
    floats   whether the zone may lie anywhere along the normal of the plane
    """

    heights: np.ndarray
    offsets: np.ndarray
    floats: bool

    @property
    def identity(self) -> bytes:
        return super().identity + self.heights.tobytes()

    def take(self, count: int) -> "FormedZone":
        return FormedZone(self.rows, self.coordinates[:, :count], self.heights, self.offsets, self.floats)

    def share_inside(self, spreads: np.ndarray, width: float, count: int = NESTED_DIRECTIONS) -> float:
        varying = np.flatnonzero((spreads > 0) & self.coordinates.any(axis=0))
        modes = self.heights.shape[1]
        unit = directions(modes + len(varying))[: min(count, NESTED_DIRECTIONS)]
        displacements = self.offsets @ (self.coordinates[:, varying] * spreads[varying])
        heights = unit[:, :modes] @ self.heights.T + unit[:, modes:] @ displacements.T
        needed = np.ptp(heights, axis=1) if self.floats else 2 * np.abs(heights).max(axis=1)
        return float(chi_share(width / np.maximum(needed, 1e-300), unit.shape[1]).mean())
