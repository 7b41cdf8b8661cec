"""From the zone of a form to the spread of its modes: the share of faces that lie inside, as for displacements (see zones).

Tolerances around a form limit form and displacements together: displacements fill what the form leaves of their zones.

The width of the minimum zone is a seminorm of the coefficients. In each direction of these the zone ends at a distance; the
share of faces nearer than that follows from the chi distribution.
"""

import functools

import numpy as np
import scipy

from tolcontact.declaration import GeometricTolerance
from tolcontact.features import FormField
from tolcontact.features.minimum_zone import ZoneMember, minimum_widths
from tolcontact.variation.zones import SHARE, chi_share, directions

DIRECTIONS = 1 << 12
FACES = 500  # that are drawn for the mean width of measured ones
MIN_SPREAD, MAX_SPREAD = 1e-6, 1e3  # of the width


def form_spreads(field: FormField, tolerance: GeometricTolerance) -> np.ndarray:
    """Return the standard deviations (mode,) [mm] of the coefficients of a form: equal for all modes, or as measured."""
    if field.spreads is not None:
        return field.spreads
    return np.full(field.modes, equal_form_spread(field, tolerance.width) / tolerance.cp)


def equal_form_spread(field: FormField, width: float) -> float:
    """Return the standard deviation [mm] of the coefficients with which 99.73 % of the faces lie inside a zone [mm]."""
    widths = np.maximum(_widths(field), 1e-300)

    def excess(spread: float) -> float:
        return float(chi_share(width / spread / widths, field.modes).mean()) - SHARE

    return float(scipy.optimize.brentq(excess, MIN_SPREAD * width, MAX_SPREAD * width, xtol=1e-12 * width))


def mean_width(field: FormField, spreads: np.ndarray) -> float:
    """Return the mean width [mm] of the minimum zones of faces, with coefficients of standard deviations (mode,) [mm]."""
    if field.means is None:
        mean_length = np.sqrt(2) * scipy.special.poch(field.modes / 2, 0.5)  # of the chi distribution
        return float(spreads[0] * mean_length * _widths(field).mean())
    faces = field.means + spreads * np.random.default_rng(0).normal(size=(FACES, len(spreads)))
    return float(minimum_widths(field.zone, faces @ field.place_heights).mean())


def _widths(field: FormField) -> np.ndarray:
    """Return the widths (direction,) of the minimum zones for unit vectors of coefficients in all directions evenly."""
    zone = tuple((member.indices.tobytes(), member.rows.tobytes()) for member in field.zone)
    return _unit_widths(zone, field.place_heights.T.tobytes(), field.modes)


@functools.lru_cache(64)
def _unit_widths(zone: tuple[tuple[bytes, bytes], ...], heights: bytes, modes: int) -> np.ndarray:
    """Return the widths (direction,) [mm] of minimum zones of a number of modes with heights (place, mode).

    The zone is given by the indices and the rows of its members: equal faces have equal widths.
    """
    members = [
        ZoneMember(indices, np.frombuffer(rows).reshape(len(indices), -1))
        for indices, rows in ((np.frombuffer(indices, dtype=int), rows) for indices, rows in zone)
    ]
    return minimum_widths(members, directions(modes)[:DIRECTIONS] @ np.frombuffer(heights).reshape(-1, modes).T)
