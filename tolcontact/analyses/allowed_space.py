"""The region that a worst case may come from: what drawings allow, whatever the shares.

Each contributor's own deviation lies in its zone: a range about its middle, the limits of a size, the support of a scipy.stats
distribution (its middle 99.73 % where it has no end). Components of features lie in the zones of their tolerances together,
with the bonus that their size leaves; those of measured parts are one of the rows. Correlations are not regarded.
"""

import numpy as np
from scipy.optimize import linprog

from tolcontact.declaration import Tolerance
from tolcontact.variation.contributors import TAIL, ComponentZone, Contributor
from tolcontact.variation.draws import Draws

AROUND = 32  # random directions in which the extreme points of a zone are looked up, beside those along its components
CUTS = 40  # tangents of a round zone, one after the other
CLOSE = 1e-9  # of a zone's width: what lies farther outside is outside
FINELY = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
ROUGHLY, EXACTLY = 1e-2, 1e-7  # of a zone's width: how far tangents of a round zone may leave it


class Region:
    """What the contributors of a model may be. Own deviations (n, contributor) are those before shared causes drive them.

    lower, upper   (contributor,) of own deviations, each by itself
    varies         columns that are not one number
    """

    def __init__(self, draws: Draws, *, seed: int) -> None:
        every = draws.contributors
        bounds = np.array([_bounds(each) for each in every]).reshape(-1, 2)
        self.lower, self.upper = bounds.T.copy()
        self._drive = np.eye(len(every)) + draws.drive_matrix
        self._populations = draws.populations
        measured = [column for columns, _ in self._populations for column in columns]
        for columns, values in self._populations:
            self.lower[columns], self.upper[columns] = values.min(axis=0), values.max(axis=0)
        self.zones = [zone for zone in draws.contributors.zones if not np.isin(zone.columns, measured).any()]
        for zone in self.zones:
            self._enclose(zone)
        self._joined = [(np.array(columns), values) for columns, values in self._populations]
        rng = np.random.default_rng(seed)
        for columns in self._together():
            self._joined.append((columns, self._extremes(columns, rng)))
        self.varies = np.flatnonzero(self.upper > self.lower)
        self.moves = np.setdiff1d(self.varies, measured)  # what measured parts are is not between their rows

    def deviations(self, own: np.ndarray) -> np.ndarray:
        """Deviations (n, contributor), as a Program takes them."""
        return np.asarray(own @ self._drive)

    def slopes(self, slopes: np.ndarray) -> np.ndarray:
        """Derivatives by own deviations (..., contributor), of those by deviations."""
        return np.asarray(slopes @ self._drive.T)

    @property
    def middle(self) -> np.ndarray:
        """Own deviations (contributor,) in the middle of all ranges and zones."""
        found = (self.lower + self.upper) / 2
        for columns, values in self._populations:
            found[columns] = values[0]
        return np.asarray(found)

    def farthest(self, direction: np.ndarray) -> np.ndarray:
        """Own deviations (n, contributor) that go farthest in directions (n, contributor); of zones among some of their
        extreme points."""
        found: np.ndarray = np.where(direction > 0, self.upper, np.where(direction < 0, self.lower, self.middle))
        for columns, points in self._joined:
            found[:, columns] = points[(direction[:, columns] @ points.T).argmax(axis=1)]
        return found

    def exactly_farthest(self, direction: np.ndarray) -> np.ndarray:
        """Own deviations (contributor,) that go farthest in a direction (contributor,), in round zones to within rounding."""
        found = np.array(self.farthest(direction[None])[0])
        for columns in self._together():
            if direction[columns].any():
                found[columns] = self._farthest_of(columns, direction[columns], EXACTLY)
        return found

    def scattered(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """Own deviations (count, contributor): half of them at random extremes, half of them at random between two such."""
        ends = self.farthest(rng.standard_normal((2 * count, len(self.lower))))
        share = rng.random((count, 1)) * (np.arange(count) % 2)[:, None]
        found = ends[:count] + share * (ends[count:] - ends[:count])
        for columns, _ in self._populations:
            found[:, columns] = ends[:count, columns]
        return np.asarray(found)

    def reach(self, own: np.ndarray, step: np.ndarray) -> np.ndarray:
        """How many (n,) of the steps (n, contributor) can be taken from (n, contributor) before the region ends, at most 1."""
        with np.errstate(divide="ignore", invalid="ignore"):
            room = np.where(step > 0, (self.upper - own) / step, np.where(step < 0, (self.lower - own) / step, np.inf))
        found = np.minimum(1.0, room.min(axis=1, initial=np.inf))
        for zone in self.zones:
            start, along = self._lengths(zone, own), np.einsum("pec,nc->npe", zone.rows, step[:, zone.columns])
            found = np.minimum(found, _first_crossing(start, along, self._half(zone, own), self._half(zone, own + step)))
        return np.asarray(np.maximum(found, 0.0))

    def is_inside(self, own: np.ndarray) -> np.ndarray:
        """Whether own deviations (n, contributor) lie in the region."""
        slack = CLOSE * (self.upper - self.lower)
        found = ((own >= self.lower - slack) & (own <= self.upper + slack)).all(axis=1)
        for zone in self.zones:
            longest = np.linalg.norm(self._lengths(zone, own), axis=2).max(axis=1, initial=0.0)
            found &= longest <= self._half(zone, own) + CLOSE * zone.width
        return np.asarray(found)

    def planes(self, own: np.ndarray | None = None, slack: float = CLOSE) -> tuple[np.ndarray, np.ndarray]:
        """Half-spaces (row, contributor), (row,) that contain the region: a @ own <= b. Tangents where own deviations
        (contributor,) leave a zone by more than `slack` of its width; without these, around all zones."""
        rows, ends = [], []
        for zone in self.zones:
            for row in zone.rows:
                for normal in _normals(row, None if own is None else row @ (own[zone.columns] - zone.middle)):
                    plane = np.zeros(len(self.lower))
                    plane[zone.columns] = normal @ row
                    end = zone.width / 2 + plane[zone.columns] @ zone.middle
                    if zone.size is not None:
                        # |row| <= (width + growth (size - limit)) / 2, of the size as it is driven
                        plane -= zone.growth / 2 * self._drive[:, zone.size]
                        end -= zone.growth / 2 * zone.limit
                    if own is None or plane @ own > end + slack * zone.width:
                        rows.append(plane)
                        ends.append(end)
        return np.array(rows).reshape(-1, len(self.lower)), np.array(ends)

    def _half(self, zone: ComponentZone, own: np.ndarray) -> np.ndarray:
        """Half of what width a zone has (n,), with its bonus."""
        if zone.size is None:
            return np.full(len(own), zone.width / 2)
        return np.asarray((zone.width + zone.growth * (own @ self._drive[:, zone.size] - zone.limit)) / 2)

    def _lengths(self, zone: ComponentZone, own: np.ndarray) -> np.ndarray:
        """Rows of a zone (n, point, entry) at own deviations."""
        return np.asarray(np.einsum("pec,nc->npe", zone.rows, own[:, zone.columns] - zone.middle))

    def _enclose(self, zone: ComponentZone) -> None:
        """Bounds of components, each by itself: as far as any direction of the zone lets them be."""
        widest = zone.width
        if zone.size is not None:
            ends = np.array([self.lower, self.upper])[:, zone.size]
            widest += float((zone.growth * (ends - zone.limit)).max())
        # From |rows c| <= half follows |c| <= |inverse| half, entry by entry.
        far = np.abs(np.linalg.pinv(zone.rows.reshape(-1, zone.rows.shape[2]))).sum(axis=1) * widest / 2
        known = self.upper[zone.columns] > self.lower[zone.columns]  # a narrower tolerance says it already
        columns = zone.columns[~known]
        self.lower[columns], self.upper[columns] = (zone.middle - far)[~known], (zone.middle + far)[~known]

    def _together(self) -> list[np.ndarray]:
        """Columns of zones that share some, set by set, with the sizes that they grow with."""
        sets: list[set[int]] = []
        for zone in self.zones:
            joined = {int(column) for column in zone.columns} | (set() if zone.size is None else {zone.size})
            for other in [other for other in sets if other & joined]:
                sets.remove(other)
                joined |= other
            sets.append(joined)
        return [np.array(sorted(joined)) for joined in sets]

    def _extremes(self, columns: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Points (point, column) at the ends of zones."""
        count = len(columns)
        directions = np.vstack([np.eye(count), -np.eye(count), rng.standard_normal((AROUND, count))])
        return np.unique([self._farthest_of(columns, direction, ROUGHLY) for direction in directions], axis=0)

    def _farthest_of(self, columns: np.ndarray, direction: np.ndarray, slack: float) -> np.ndarray:
        """The point (column,) of zones that goes farthest in a direction (column,), by cutting planes (Kelley, 1960)."""
        own = self.middle
        planes, ends = self.planes()
        others = np.setdiff1d(np.arange(len(own)), columns)
        scale = float((self.upper - self.lower)[columns].max())  # the solver's tolerances are absolute
        bounds = np.column_stack([self.lower, self.upper])[columns] / scale
        for _ in range(CUTS):
            here = np.flatnonzero(np.abs(planes[:, columns]).any(axis=1))
            left = ends[here] - planes[np.ix_(here, others)] @ own[others]
            found = linprog(
                -direction / np.abs(direction).max(), planes[np.ix_(here, columns)], left / scale, bounds=bounds, options=FINELY
            )
            own[columns] = scale * found.x
            more, their_ends = self.planes(own, slack)
            if not len(more):
                break
            planes, ends = np.vstack([planes, more]), np.concatenate([ends, their_ends])
        middle = self.middle
        return np.asarray(middle[columns] + self.reach(middle[None], (own - middle)[None])[0] * (own - middle)[columns])


def _bounds(each: Contributor) -> tuple[float, float]:
    """What a contributor may be by itself."""
    if each.tolerance is None:
        return 0.0, 0.0  # its zone says it
    own: Tolerance = each.tolerance
    if own.range is not None:
        return own.shift - own.range / 2, own.shift + own.range / 2
    ends = own.distribution.support()
    quantiles = own.distribution.ppf([TAIL, 1 - TAIL])
    lower, upper = (float(end if np.isfinite(end) else q) for end, q in zip(ends, quantiles, strict=True))
    return own.shift + lower, own.shift + upper


def _normals(row: np.ndarray, at: np.ndarray | None) -> np.ndarray:
    """Unit vectors (n, entry) across a zone: all around, or outwards where `at` (entry,) is."""
    entries = len(row)
    if entries == 1:
        return np.array([[1.0], [-1.0]])
    if at is not None:
        length = np.linalg.norm(at)
        return at[None] / length if length else np.zeros((0, entries))
    if entries == 2:
        angles = np.arange(16) * np.pi / 8
        return np.column_stack([np.cos(angles), np.sin(angles)])
    return np.vstack([np.eye(entries), -np.eye(entries)])


def _first_crossing(start: np.ndarray, along: np.ndarray, half: np.ndarray, then: np.ndarray) -> np.ndarray:
    """The least t (n,) at which a |start + t along| (n, point, entry) is half + t (then - half) (n,); 1 if that is less."""
    grows = (then - half)[:, None]
    a = (along**2).sum(axis=2) - grows**2
    b = (start * along).sum(axis=2) - half[:, None] * grows
    c = (start**2).sum(axis=2) - half[:, None] ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(np.maximum(b**2 - a * c, 0.0))
        # The root at which it leaves, in the form that cancels nothing.
        t = np.where(b < 0, np.where(a > 0, (root - b) / a, np.inf), np.where(b + root > 0, -c / (b + root), np.inf))
    return np.asarray(np.clip(t.min(axis=1, initial=1.0), 0.0, 1.0))
