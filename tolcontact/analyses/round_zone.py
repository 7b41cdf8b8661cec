"""The zone of a tolerance in the region of worst cases: a convex set that is round in the components of a feature."""

from collections.abc import Iterator

import numpy as np

from tolcontact.variation.spreads import ComponentZone

TOLERANCE = 1e-9  # of a zone's width: points further outside count as outside


class RoundZone:
    """The points (contributor,) at which no row of a ComponentZone is longer than half of its width, with the bonus there.

    Sizes widen the zone by what they are with the effects of shared causes, `drive` (contributor, contributor).

    components, middle   columns of the components (component,), and the centre of the zone
    columns              of the components, and of all that widens the zone
    """

    def __init__(self, zone: ComponentZone, drive: np.ndarray) -> None:
        self._zone, self._drive = zone, drive
        self.components, self.middle, self.columns = zone.columns, zone.middle, np.unique(zone.columns)
        if zone.sizes is not None:
            self.columns = np.union1d(self.columns, np.flatnonzero(drive[:, zone.sizes].any(axis=1)))

    def extent(self, driven_bounds: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Return the largest distance (component,) from the centre, for bounds (contributor,) of deviations."""
        zone, widest = self._zone, self._zone.width
        if zone.sizes is not None:
            ends = np.array(driven_bounds)[:, zone.sizes]
            widest += float((zone.growth * (ends - zone.limit)).max())
        # From |rows c| <= half follows |c| <= |inverse| half, entry by entry.
        return np.asarray(np.abs(np.linalg.pinv(zone.rows.reshape(-1, zone.rows.shape[2]))).sum(axis=1) * widest / 2)

    def contains(self, points: np.ndarray) -> np.ndarray:
        """Return whether points (n, contributor) lie in the zone."""
        lengths = np.linalg.norm(self._rows_at(points), axis=2)
        return np.asarray((lengths <= self._half(points) + TOLERANCE * self._zone.width).all(axis=1))

    def reach(self, points: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Return the shares (n,), at most 1, of steps (n, contributor) from points (n, contributor) that stay in the zone."""
        start, along = self._rows_at(points), np.einsum("pec,nc->npe", self._zone.rows, step[:, self.components])
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
                if zone.sizes is not None:
                    # |row| <= (width + growth (size - limit)) / 2, with the effects of shared causes in the size
                    plane -= zone.growth / 2 * self._drive[:, zone.sizes[number]]
                    end -= zone.growth / 2 * zone.limit
                if point is None or plane @ point > end + slack * zone.width:
                    yield plane, end

    def _half(self, points: np.ndarray) -> np.ndarray:
        """Return half the width (n, point) of the zone, with its bonus."""
        zone = self._zone
        if zone.sizes is None:
            return np.full((len(points), len(zone.rows)), zone.width / 2)
        return np.asarray((zone.width + zone.growth * (points @ self._drive[:, zone.sizes] - zone.limit)) / 2)

    def _rows_at(self, points: np.ndarray) -> np.ndarray:
        """Return the rows of the zone (n, point, entry) at points (n, contributor)."""
        return np.asarray(np.einsum("pec,nc->npe", self._zone.rows, points[:, self.components] - self.middle))


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
