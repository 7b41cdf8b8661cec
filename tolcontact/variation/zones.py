"""From the zone of a feature to the spread of its components: the share of features that lies inside.

Components c are independent and normal. A feature lies inside if none of the rows of its zone, each a vector linear in c, is
longer than half the width. In the direction u, a random unit vector scaled by the standard deviations, the zone ends at a
distance. The share of features nearer than that is the chi distribution's, so the share inside is its mean over directions. A
quasi-random sequence of directions gives it to some 1e-5, without draws of features, in the same way for all zones.
"""

import functools
import pickle
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
import scipy
from scipy.special import gammainc, ndtri

SHARE = 0.9973002039367398  # of a normal distribution within three standard deviations
LOG2_DIRECTIONS = 14
MEMBER_DIRECTIONS = 1 << 17  # for all members of a pattern that differ; the mean share then has an error of some 3e-5
MIN_DIRECTIONS = 1 << 11  # for each of these members
FORM_DIRECTIONS = 1 << 13  # displacements have larger spreads than modes, so that fewer directions are enough
CHUNK = 1024  # components that are evaluated at once
MIN_SPREAD = 1e-9  # of the width: a smaller spread counts as 0


@dataclass(frozen=True, eq=False)
class MemberZone:
    """The zone of a feature, or of a member of a pattern, whose coordinates are linear in components.

    rows         (point, entry, coordinate)
    coordinates  (coordinate, component) for unit components
    heights      (place, mode) [mm] of its form for coefficients of one standard deviation; None for a zone without form
    offsets      (place, coordinate): heights of the surface for unit coordinates, of a zone with form
    floats       whether a zone with form may lie anywhere along the normal of the surface
    """

    rows: np.ndarray
    coordinates: np.ndarray
    heights: np.ndarray | None = None
    offsets: np.ndarray | None = None
    floats: bool = False

    @cached_property
    def component_rows(self) -> np.ndarray:
        """The rows (point, entry, component) of the components."""
        return np.asarray(self.rows @ self.coordinates)

    @property
    def identity(self) -> bytes:
        """The bytes that determine shares, together with spreads."""
        rows = self.component_rows
        return rows[..., (rows != 0).any(axis=(0, 1))].tobytes() + (b"" if self.heights is None else self.heights.tobytes())

    def take(self, count: int) -> "MemberZone":
        """Return the same zone of the first components alone."""
        return replace(self, coordinates=self.coordinates[:, :count])

    def share_inside(self, spreads: np.ndarray, width: float, count: int = 1 << LOG2_DIRECTIONS) -> float:
        """Return the share of members, with standard deviations (component,), inside a zone of a width."""
        if self.heights is not None and self.offsets is not None:
            return self._share_with_form(self.heights, self.offsets, spreads, width, min(count, FORM_DIRECTIONS))
        rows = self.component_rows
        if not rows.size:
            return 1.0
        varying = np.flatnonzero((spreads > 0) & (rows != 0).any(axis=(0, 1)))
        rows, varied = rows[..., varying], spreads[varying]
        if len(varying) > self.rows.shape[2]:
            # The member has fewer coordinates than components, and the same share with the root of their covariance.
            scaled = self.coordinates[:, varying] * varied
            variances, axes = np.linalg.eigh(scaled @ scaled.T)
            root = np.asarray((axes * np.sqrt(np.maximum(variances, 0.0))) @ axes.T)
            rows, varied = self.rows @ root, np.ones(self.rows.shape[2])
        if not len(varied):
            return 1.0
        if (varied == varied[0]).all():  # the root of a spread tries many
            longest = varied[0] * _unit_longest(rows.tobytes(), rows.shape, count)
        else:
            longest = _longest(rows, directions(len(varied))[:count] * varied)
        return float(chi_share(width / 2 / np.maximum(longest, 1e-300), len(varied)).mean())

    def _share_with_form(self, form: np.ndarray, offsets: np.ndarray, spreads: np.ndarray, width: float, count: int) -> float:
        varying, modes = np.flatnonzero((spreads > 0) & self.coordinates.any(axis=0)), form.shape[1]
        unit = directions(modes + len(varying))[:count]
        displacements = offsets @ (self.coordinates[:, varying] * spreads[varying])
        heights = unit[:, :modes] @ form.T + unit[:, modes:] @ displacements.T
        needed = np.ptp(heights, axis=1) if self.floats else 2 * np.abs(heights).max(axis=1)
        return float(chi_share(width / np.maximum(needed, 1e-300), unit.shape[1]).mean())


def share_inside(members: Sequence[MemberZone], spreads: np.ndarray, width: float) -> float:
    """Return the mean share of members, with standard deviations (component,), inside their zones of a width."""
    counts, zones = Counter[tuple[bytes, bytes]](), dict[tuple[bytes, bytes], MemberZone]()
    for member in members:
        key = member.identity, spreads[(member.component_rows != 0).any(axis=(0, 1))].tobytes()
        counts[key] += 1
        zones[key] = member
    count = max(MIN_DIRECTIONS, MEMBER_DIRECTIONS >> len(counts).bit_length())
    shares = [zones[key].share_inside(spreads, width, count) for key in counts]
    return shares[0] if len(shares) == 1 else float(np.average(shares, weights=list(counts.values())))


def chi_share(lengths: np.ndarray, components: int) -> np.ndarray:
    """Return the share of vectors of independent standard normal components that are shorter than some lengths."""
    return np.asarray(gammainc(components / 2, lengths**2 / 2))


def equal_spread(members: Sequence[MemberZone], inner_spreads: np.ndarray, count: int, width: float) -> float:
    """Return the standard deviation of `count` more components with which 99.73 % of the members lie inside their zones.

    The components of `members` are those with `inner_spreads` (component,), which are standard deviations, and then these.
    Features with the same zones, as holes of one size have, have the same spread: it is computed once.
    """
    contents = [[getattr(member, field.name) for field in fields(member)] for member in members]
    return _equal_spread(pickle.dumps((contents, inner_spreads, count, width)))


@functools.lru_cache(maxsize=256)
def _equal_spread(zones: bytes) -> float:
    contents, inner_spreads, count, width = pickle.loads(zones)
    members = [MemberZone(*values) for values in contents]

    def excess(spread: float) -> float:
        return share_inside(members, np.concatenate([inner_spreads, np.full(count, spread)]), width) - SHARE

    if not any(member.rows.size for member in members) or excess(MIN_SPREAD * width) <= 0:
        return 0.0
    upper = width
    while excess(upper) > 0:  # rows may be short
        upper *= 2
    return float(scipy.optimize.brentq(excess, MIN_SPREAD * width, upper, xtol=1e-9 * width))


def extreme_spread(members: Sequence[MemberZone], inner_spreads: np.ndarray, count: int, width: float) -> float:
    """Return the standard deviation of `count` more components with which 6 sigma of the worst extreme equal the width."""
    inner_count, rows = len(inner_spreads), np.concatenate([member.component_rows for member in members])
    inner_variance = ((rows[..., :inner_count] * inner_spreads) ** 2).sum(axis=-1)
    factors = (rows[..., inner_count : inner_count + count] ** 2).sum(axis=-1)
    moved, variance = factors > 0, (width / 6) ** 2 - inner_variance
    return float(np.sqrt(max((variance[moved] / factors[moved]).min(initial=np.inf), 0.0))) if moved.any() else 0.0


def _longest(rows: np.ndarray, components: np.ndarray) -> np.ndarray:
    """Return the longest (n,) of the rows (point, entry, component) at components (n, component)."""
    longest = np.zeros(len(components))
    for start in range(0, len(components), CHUNK):
        chunk = slice(start, start + CHUNK)
        squares = (np.einsum("pec,nc->npe", rows, components[chunk]) ** 2).sum(axis=2)
        longest[chunk] = np.sqrt(squares.max(axis=1, initial=0.0))
    return longest


@functools.lru_cache(64)
def _unit_longest(rows: bytes, shape: tuple[int, ...], count: int) -> np.ndarray:
    """Return `_longest` (count,) of rows of a shape (point, entry, component) in all directions evenly."""
    return _longest(np.frombuffer(rows).reshape(shape), directions(shape[2])[:count])


@functools.lru_cache
def directions(components: int) -> np.ndarray:
    """Return unit vectors (direction, component) in all directions evenly."""
    if components == 1:
        return np.ones((1, 1))
    normal = ndtri(scipy.stats.qmc.Sobol(components, seed=0).random_base2(LOG2_DIRECTIONS))
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)
