"""The region of worst cases: all combinations of deviations that the drawings allow, however unlikely.

The deviation of each contributor lies in its zone: a range around its centre, the limits of a size, or the support of a
scipy.stats distribution (its central 99.73 % if it is unbounded). The components of a feature lie jointly in the zones of its
tolerances, with the bonus that its size permits. Measured parts are one of their rows. Correlations are ignored.
"""

from collections.abc import Iterator

import numpy as np
import scipy

from tolcontact.declaration import Tolerance
from tolcontact.features.freedoms import TAIL, Freedom
from tolcontact.statistics.variance_shares import joined_columns
from tolcontact.variation.draws import Draws
from tolcontact.variation.spreads import ComponentZone

TOLERANCE = 1e-9  # of a zone's width: points further outside count as outside
RANDOM_DIRECTIONS = 32  # for the extreme points of a zone, in addition to the directions of its components
MAX_CUTS = 40  # successive tangents of a round zone
LP_TOLERANCES = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
COARSE_TOLERANCE, FINE_TOLERANCE = 1e-2, 1e-7  # of a zone's width: distance between tangents and a round zone


class RoundZone:
    """The points (contributor,) at which no row of a ComponentZone is longer than half of its width, with the bonus there.

    Sizes widen the zone by what they are with the effects of shared causes, `drive` (contributor, contributor).

    components, middle   columns of the components (component,), and the centre of the zone
    columns              of the components, and of all that widens the zone
    """

    def __init__(self, zone: ComponentZone, drive: np.ndarray) -> None:
        self._zone, self._drive = zone, drive
        self.components, self.middle, self.columns = zone.columns, zone.middle, np.unique(zone.columns)
        if zone.sizes.size:
            self.columns = np.union1d(self.columns, np.flatnonzero(drive[:, zone.sizes].any(axis=1)))

    def extent(self, driven_bounds: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Return the largest distance (component,) from the centre, for bounds (contributor,) of deviations."""
        zone, widest = self._zone, self._zone.width
        if zone.sizes.size:
            ends = np.array(driven_bounds)[:, zone.sizes]
            widest += float((zone.growth * (ends - zone.limit)).max())
        # From |rows c| <= half follows |c| <= |inverse| half, entry by entry.
        return np.asarray(np.abs(np.linalg.pinv(zone.rows.reshape(-1, zone.rows.shape[2]))).sum(axis=1) * widest / 2)

    def reach(self, points: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Return the shares (n,), at most 1, of steps (n, contributor) from points (n, contributor) that stay in the zone."""
        offsets = points[:, self.components] - self.middle
        start, along = (np.einsum("pec,nc->npe", self._zone.rows, x) for x in (offsets, step[:, self.components]))
        half = self._half(points)
        grows = self._half(points + step) - half
        # The least t at which any |start + t along| is half + t grows.
        a = (along**2).sum(axis=2) - grows**2
        b = (start * along).sum(axis=2) - half * grows
        c = (start**2).sum(axis=2) - half**2
        with np.errstate(divide="ignore", invalid="ignore"):
            root = np.sqrt(np.maximum(b**2 - a * c, 0.0))
            # The root at which the segment leaves the zone, in the form without cancellation.
            t = np.where(b < 0, np.where(a > 0, (root - b) / a, np.inf), np.where(b + root > 0, -c / (b + root), np.inf))
        return np.asarray(np.clip(t.min(axis=1, initial=1.0), 0.0, 1.0))

    def tangents(self, point: np.ndarray | None, slack: float) -> Iterator[tuple[np.ndarray, float]]:
        """Yield half-spaces a (contributor,), b that contain the zone: a @ point <= b.

        They are tangents where a point (contributor,) leaves the zone by more than `slack` of its width. Without a point they
        enclose the zone.
        """
        zone = self._zone
        for number, row in enumerate(zone.rows):
            for normal in _normals(row, None if point is None else row @ (point[self.components] - self.middle)):
                plane = np.zeros(len(self._drive))
                plane[self.components] = normal @ row
                end = zone.width / 2 + plane[self.components] @ self.middle
                if zone.sizes.size:
                    # |row| <= (width + growth (size - limit)) / 2, with the effects of shared causes in the size
                    plane -= zone.growth / 2 * self._drive[:, zone.sizes[number]]
                    end -= zone.growth / 2 * zone.limit
                if point is None or plane @ point > end + slack * zone.width:
                    yield plane, end

    def _half(self, points: np.ndarray) -> np.ndarray:
        """Return half the width (n, point) of the zone, with its bonus."""
        zone = self._zone
        if not zone.sizes.size:
            return np.full((len(points), len(zone.rows)), zone.width / 2)
        return np.asarray((zone.width + zone.growth * (points @ self._drive[:, zone.sizes] - zone.limit)) / 2)


def _normals(row: np.ndarray, position: np.ndarray | None) -> np.ndarray:
    """Return unit normals (n, entry) of a zone: all around, or only towards a position (entry,)."""
    entries = len(row)
    if entries == 1:
        return np.array([[1.0], [-1.0]])
    if position is not None:
        length = np.linalg.norm(position)
        return position[None] / length if length else np.zeros((0, entries))
    if entries == 2:
        angles = np.arange(16) * np.pi / 8
        return np.column_stack([np.cos(angles), np.sin(angles)])
    return np.vstack([np.eye(entries), -np.eye(entries)])


class AllowedRegion:
    """The region of a model. A point (contributor,) is a combination of deviations before the effects of shared causes.

    lower, upper   (contributor,) bounds of points
    varies         columns that are not constant
    moves, fixed   columns that vary continuously, and others, of measured parts
    """

    def __init__(self, draws: Draws, *, seed: int) -> None:
        contributors = draws.contributors
        bounds = np.array([_bounds(contributor) for contributor in contributors]).reshape(-1, 2)
        self.lower, self.upper = bounds.T.copy()
        self._drive = np.eye(len(contributors)) + draws.drive_matrix
        self._populations = draws.populations
        self._add_shifts = draws.add_shifts
        measured = [column for columns, _ in self._populations for column in columns]
        for columns, values in self._populations:
            self.lower[columns], self.upper[columns] = values.min(axis=0), values.max(axis=0)
        self.zones = [RoundZone(zone, self._drive) for zone in draws.zones if not np.isin(zone.columns, measured).any()]
        for zone in self.zones:  # a narrower tolerance may already bound a component
            columns, extent = zone.components, zone.extent(self._driven_bounds())
            is_bounded = self.upper[columns] > self.lower[columns]
            self.lower[columns] = np.where(is_bounded, self.lower[columns], zone.middle - extent)
            self.upper[columns] = np.where(is_bounded, self.upper[columns], zone.middle + extent)
        for shift in draws.shifts:
            self.lower[shift.columns.start], self.upper[shift.columns.start] = shift.bounds(*self._driven_bounds())
        self._joined = [(np.array(columns), values) for columns, values in self._populations]
        rng = np.random.default_rng(seed)
        for columns in self._joint_columns():
            self._joined.append((columns, self._extremes(columns, rng)))
        self.varies = np.flatnonzero(self.upper > self.lower)
        self.moves = np.setdiff1d(self.varies, measured)  # there are no values between the rows of measured parts
        self.fixed = np.setdiff1d(self.varies, self.moves)

    def deviations(self, points: np.ndarray) -> np.ndarray:
        """Return deviations (n, contributor), in the form that a Program takes, of points (n, contributor)."""
        deviations = np.asarray(points @ self._drive)
        self._add_shifts(deviations)
        return deviations

    def slopes(self, slopes: np.ndarray) -> np.ndarray:
        """Return derivatives with respect to points (..., contributor), from derivatives with respect to deviations."""
        return np.asarray(slopes @ self._drive.T)

    @property
    def middle(self) -> np.ndarray:
        """The centre (contributor,) of all ranges and zones."""
        middle = (self.lower + self.upper) / 2
        for columns, values in self._populations:
            middle[columns] = values[0]
        return np.asarray(middle)

    @property
    def independent_columns(self) -> list[np.ndarray]:
        """Sets of columns that vary independently of each other: zones with common columns, measured parts, or single ones."""
        joined = [columns for columns, _ in self._joined]
        single = np.setdiff1d(self.varies, np.concatenate([np.zeros(0, dtype=int), *joined]))
        return [*joined, *single[:, None]]

    def farthest(self, direction: np.ndarray) -> np.ndarray:
        """Return the farthest points (n, contributor) in directions (n, contributor); in zones, from sampled extreme points."""
        ends: np.ndarray = np.where(direction > 0, self.upper, np.where(direction < 0, self.lower, self.middle))
        for columns, points in self._joined:
            ends[:, columns] = points[(direction[:, columns] @ points.T).argmax(axis=1)]
        return ends

    def exactly_farthest(self, direction: np.ndarray) -> np.ndarray:
        """Return the farthest point (contributor,) in a direction (contributor,), in round zones to within rounding."""
        end = np.array(self.farthest(direction[None])[0])
        for columns in self._joint_columns():
            if direction[columns].any():
                end[columns] = self._farthest_of(columns, direction[columns], FINE_TOLERANCE)
        return end

    def scattered(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Return random points (count, contributor): half of them extreme points, half of them between two extreme points."""
        ends = self.farthest(rng.standard_normal((2 * count, len(self.lower))))
        share = rng.random((count, 1)) * (np.arange(count) % 2)[:, None]
        points = ends[:count] + share * (ends[count:] - ends[:count])
        for columns, _ in self._populations:
            points[:, columns] = ends[:count, columns]
        return np.asarray(points)

    def measured_rows(self, count: int) -> Iterator[np.ndarray]:
        """Yield points (n, contributor) for each population: its first `count` rows, with all else at its centre."""
        for columns, values in self._populations:
            points = np.tile(self.middle, (min(count, len(values)), 1))
            points[:, columns] = values[: len(points)]
            yield points

    def reach(self, points: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Return the shares (n,), at most 1, of steps (n, contributor) from points (n, contributor) that stay in the region."""
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(step > 0, (self.upper - points) / step, np.where(step < 0, (self.lower - points) / step, np.inf))
        shares = np.minimum(1.0, room.min(axis=1, initial=np.inf))
        for zone in self.zones:
            shares = np.minimum(shares, zone.reach(points, step))
        return np.asarray(np.maximum(shares, 0.0))

    def stepped(self, points: np.ndarray, steps: np.ndarray) -> np.ndarray:
        """Return the ends (n, step, contributor) of steps from points (n, contributor), or where the steps leave the region.

        steps   (n, step, contributor)
        """
        starts, flat = np.repeat(points, steps.shape[1], axis=0), steps.reshape(-1, steps.shape[2])
        return np.asarray((starts + self.reach(starts, flat)[:, None] * flat).reshape(steps.shape))

    def planes(self, point: np.ndarray | None = None, slack: float = TOLERANCE) -> tuple[np.ndarray, np.ndarray]:
        """Return half-spaces (row, contributor), (row,) that contain the region: a @ point <= b.

        They are tangents where a point (contributor,) leaves a zone by more than `slack` of its width. Without a point they
        enclose all zones.
        """
        tangents = [tangent for zone in self.zones for tangent in zone.tangents(point, slack)]
        rows, ends = [row for row, _ in tangents], [end for _, end in tangents]
        return np.array(rows).reshape(-1, len(self.lower)), np.array(ends)

    def _driven_bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Return bounds (contributor,), (contributor,) of deviations, including the largest effects of shared causes."""
        ends = np.stack([self.lower, self.upper])[:, :, None] * self._drive
        return ends.min(axis=0).sum(axis=0), ends.max(axis=0).sum(axis=0)

    def _joint_columns(self) -> list[np.ndarray]:
        """Return sets of columns: zones with common columns are one set, with the sizes that widen them and their causes."""
        sets = [zone.columns for zone in self.zones]
        columns, names = np.unique(np.concatenate([np.zeros(0, dtype=int), *sets])), list(map(str, range(len(self.lower))))
        return list(joined_columns(names, sets, columns).values())

    def _extremes(self, columns: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return extreme points (point, column) of zones."""
        count = len(columns)
        directions = np.vstack([np.eye(count), -np.eye(count), rng.standard_normal((RANDOM_DIRECTIONS, count))])
        return np.unique([self._farthest_of(columns, direction, COARSE_TOLERANCE) for direction in directions], axis=0)

    def _farthest_of(self, columns: np.ndarray, direction: np.ndarray, slack: float) -> np.ndarray:
        """Return the farthest point (column,) of zones in a direction (column,), by cutting planes (Kelley, 1960)."""
        point = self.middle
        planes, ends = self.planes()
        fixed = np.setdiff1d(np.arange(len(point)), columns)
        scale = float((self.upper - self.lower)[columns].max())  # the solver's tolerances are absolute
        bounds = np.column_stack([self.lower, self.upper])[columns] / scale
        for _ in range(MAX_CUTS):
            rows = np.flatnonzero(np.abs(planes[:, columns]).any(axis=1))
            limits = ends[rows] - planes[np.ix_(rows, fixed)] @ point[fixed]
            goal = -direction / np.abs(direction).max()
            solution = scipy.optimize.linprog(
                goal, planes[np.ix_(rows, columns)], limits / scale, bounds=bounds, options=LP_TOLERANCES
            )
            point[columns] = scale * solution.x
            tangents, tangent_ends = self.planes(point, slack)
            if not len(tangents):
                break
            planes, ends = np.vstack([planes, tangents]), np.concatenate([ends, tangent_ends])
        middle = self.middle
        return np.asarray(middle[columns] + self.reach(middle[None], (point - middle)[None])[0] * (point - middle)[columns])


def _bounds(contributor: Freedom) -> tuple[float, float]:
    """Return the bounds of a contributor without its zones."""
    if contributor.tolerance is None:
        return 0.0, 0.0  # its zone bounds it
    tolerance: Tolerance = contributor.tolerance
    if tolerance.range is not None:
        return tolerance.shift - tolerance.range / 2, tolerance.shift + tolerance.range / 2
    ends = tolerance.frozen.support()
    quantiles = tolerance.frozen.ppf([TAIL, 1 - TAIL])
    lower, upper = (float(end if np.isfinite(end) else q) for end, q in zip(ends, quantiles, strict=True))
    return tolerance.shift + lower, tolerance.shift + upper
