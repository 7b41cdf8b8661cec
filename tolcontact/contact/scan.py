"""Scans: gaps of the contact points of a pair, the active points, and the candidates for rows of the QP.

Sums run over points in a fixed order, one realization independent of the others, so that results do not depend on
how realizations are grouped into blocks. (A BLAS product would be faster and would not keep that.)
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.contact import kernel
from tolcontact.discretization import ContactPoints
from tolcontact.mechanics import MOMENTS, GapMap

PENETRATION = 1e-10  # mm: less than this is no penetration
BOUND_TOLERANCE = 1e-12  # of the largest coordinate: bounds of leaves are that much wider, for rounding
OUTSIDE = 1e300  # a coordinate that no point has
NOTHING = np.empty((0, 0))
NOT_RAISED = kernel.Raised(NOTHING, NOTHING, NOTHING, np.empty(0, dtype=np.int64))


class Deepest(NamedTuple):
    """The deepest point of each cluster, and its depth [mm], both (realization, cluster)."""

    points: Int[Array, "realization cluster"]
    depth: Float[Array, "realization cluster"]


class Scan:
    """The contact points of a pair, of which some take turns in the slots of the QP.

    fills   whether points outside take the remaining slots: worthwhile if most points may be active
    """

    fills: ClassVar[bool] = False

    def take(self, rows: np.ndarray) -> "Scan":
        """Return the scan of some realizations: the same one if all have the same contact points."""
        return self

    def min_gap(
        self, relative: Float[Array, "realization 12"], deviations: Float[Array, "realization contributor"]
    ) -> Float[Array, " realization"]:
        """Return the smallest gap of all points (realization,) [mm]."""
        raise NotImplementedError

    def depth_between(self, relative: Float[Array, "realization 12"]) -> Float[Array, " realization"]:
        """Return the largest known depth [mm] of faces with form between the points; 0 if there is none."""
        return np.zeros(len(relative))

    def rows(
        self, points: Int[Array, "realization slot"], deviations: Float[Array, "realization contributor"]
    ) -> tuple[Float[Array, "realization slot 3"], Float[Array, "realization slot 3"], Float[Array, "realization slot 3"]]:
        """Return P^m, P^r, n^r (realization, slot, 3) of some `points` (realization, slot), which their rows of the QP need."""
        raise NotImplementedError

    def deepest(self, relative: np.ndarray, deviations: np.ndarray, may_carry: np.ndarray | None = None) -> Deepest:
        """Return the deepest point of each cluster; its depth is at most 0 if no point is inside.

        may_carry   (realization, point): the points to look at; all if it is None
        """
        raise NotImplementedError

    def holds(self, points: Int[Array, "realization slot"]) -> Bool[Array, "realization slot"]:
        """Return whether the scan still has some `points` (realization, slot)."""
        return np.ones(points.shape, dtype=bool)

    def moves(self, points: Int[Array, "realization slot"]) -> Bool[Array, "realization slot"]:
        """Return which of `points` (realization, slot) are fixed to the moving body, so that their gaps are linear in X_RM."""
        return np.ones(points.shape, dtype=bool)


@dataclass(frozen=True, eq=False)
class FixedScan(Scan):
    """Fixed contact points of a pair, sorted by cluster; and within a cluster into branches and leaves of neighbours.

    pair       with its points in this order
    points     as compiled passes take them
    clusters   (cluster + 1,): the first branch of each cluster, and the end
    tables     moment tables (moment, point) of the sides that enter the objective
    raised     the heights of the points, if they are known; otherwise they follow from the deviations
    """

    pair: ContactPoints
    points: kernel.Points
    clusters: Int[Array, " _"]
    tables: tuple[Float[Array, "moment point"], ...]
    raised: kernel.Raised = NOT_RAISED

    def gaps(
        self,
        relative: Float[Array, "realization 12"],
        deviations: Float[Array, "realization contributor"],
        limits: Float[Array, " realization"] | None = None,
    ) -> Float[Array, "realization point"]:
        """Return gaps (realization, point) [mm]; infinite ones of leaves where all are above `limits` (realization,) [mm]."""
        gaps = np.empty((len(relative), len(self.pair.P_m)))
        limits = np.full(len(relative), np.inf) if limits is None else limits
        kernel.write_gaps(*self._inputs(relative, deviations), limits, gaps)
        return gaps

    def survey(
        self, relative: Float[Array, "realization 12"], deviations: Float[Array, "realization contributor"], activity: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return number (realization,) and moments (realization, side, moment) of points whose gap is below `activity` [mm]."""
        count = len(relative)
        active, moments = np.empty(count, dtype=np.int64), np.zeros((count, len(self.tables), MOMENTS))
        poses, heights = np.ascontiguousarray(relative), np.ascontiguousarray(deviations)
        flat = moments.reshape(count, self._table.shape[1])
        kernel.survey(self.points, self._table, *self._sums, poses, heights, activity, active, flat)
        return active, moments

    def min_gap(self, relative: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        return self.deepest_of(self.clusters[[0, -1]], relative, deviations)[1][:, 0]

    def rows(self, points: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        P_m, P_r, n_r = self.pair.P_m[points], self.pair.P_r[points], self.pair.n_r[points]
        if self.points.columns.size:
            P_r = P_r + self.pair.offsets.heights(deviations, points)[..., None] * n_r
        return P_m, P_r, n_r

    def deepest(self, relative: np.ndarray, deviations: np.ndarray, may_carry: np.ndarray | None = None) -> Deepest:
        points, gaps = self.deepest_of(self.clusters, relative, deviations, may_carry, np.inf if self.fills else 0.0)
        return Deepest(points, -gaps)

    def deepest_of(
        self,
        clusters: Int[Array, " _"],
        relative: Float[Array, "realization 12"],
        deviations: Float[Array, "realization contributor"],
        may_carry: Bool[Array, "realization point"] | None = None,
        limit: float = np.inf,
    ) -> tuple[Int[Array, "realization cluster"], Float[Array, "realization cluster"]]:
        """Return index and gap [mm] of the deepest point of each cluster, if its gap is less than `limit` [mm].

        Otherwise these are the first point of the cluster, and `limit`.

        clusters   (cluster + 1,): the first branch of each cluster, and the end
        """
        points = np.empty((len(relative), len(clusters) - 1), dtype=np.int64)
        gaps = np.empty(points.shape)
        mask = np.empty((len(relative), 0), dtype=bool) if may_carry is None else np.ascontiguousarray(may_carry)
        kernel.deepest(*self._inputs(relative, deviations), clusters, mask, limit, points, gaps)
        return points, gaps

    def _inputs(
        self, relative: np.ndarray, deviations: np.ndarray
    ) -> tuple[kernel.Points, kernel.Raised, np.ndarray, np.ndarray]:
        """Return the first arguments of compiled passes."""
        return self.points, self.raised, np.ascontiguousarray(relative), np.ascontiguousarray(deviations)

    @cached_property
    def nominal_points(self) -> kernel.Points:
        """The points without the heights that deviations add."""
        points, size = self.points, self.points.basis.shape[1]
        leaf_boxes, branch_boxes = (
            np.ascontiguousarray(boxes[:, : size - 1]) for boxes in (points.leaf_boxes, points.branch_boxes)
        )
        return points._replace(
            columns=points.columns[:0], coordinates=points.coordinates[:size], leaf_boxes=leaf_boxes, branch_boxes=branch_boxes
        )

    @cached_property
    def _table(self) -> np.ndarray:
        """What each point adds to the moments (point, side * moment)."""
        return np.ascontiguousarray(np.array(self.tables).reshape(len(self.tables) * MOMENTS, len(self.pair.P_m)).T)

    @cached_property
    def _sums(self) -> tuple[np.ndarray, np.ndarray]:
        """Summed moments of the leaves and of the branches, (leaf, side * moment) and (branch, side * moment)."""
        of_leaves = np.add.reduceat(self._table, self.points.leaves[:-1], axis=0)
        return of_leaves, np.add.reduceat(of_leaves, self.points.branches[:-1], axis=0)


@dataclass(frozen=True, eq=False)
class ProjectedScan(Scan):
    """The points of a fixed scan, with separate projections for every realization.

    feet, normals    (realization, point, 3): P^r and n^r, nominal
    over             (realization, point): points that do not overhang the rim of the reference face; the others cannot touch
    """

    fixed: FixedScan
    feet: Float[Array, "realization point 3"]
    normals: Float[Array, "realization point 3"]
    over: Bool[Array, "realization point"]

    def take(self, rows: np.ndarray) -> "ProjectedScan":
        return ProjectedScan(self.fixed, self.feet[rows], self.normals[rows], self.over[rows])

    def gaps(
        self, relative: Float[Array, "realization 12"], deviations: Float[Array, "realization contributor"]
    ) -> Float[Array, "realization point"]:
        """Return gaps (realization, point) [mm], infinite for points beyond the rim."""
        fixed, n = self.fixed, self.normals
        offset = pose.apply(relative, fixed.pair.P_m) - self.feet
        gaps = n[..., 0] * offset[..., 0] + n[..., 1] * offset[..., 1] + n[..., 2] * offset[..., 2]
        if fixed.points.columns.size:
            gaps -= fixed.pair.offsets.heights(deviations, np.broadcast_to(np.arange(len(fixed.pair.P_m)), gaps.shape))
        return np.where(self.over, gaps, np.inf)

    def min_gap(self, relative: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        return self.gaps(relative, deviations).min(axis=1)

    def deepest(self, relative: np.ndarray, deviations: np.ndarray, may_carry: np.ndarray | None = None) -> Deepest:
        gaps = np.minimum(self.gaps(relative, deviations), 0)
        if may_carry is not None:
            gaps = np.where(may_carry, gaps, 0)
        firsts = self.fixed.points.leaves[self.fixed.points.branches[self.fixed.clusters]]
        points = np.stack([gaps[:, a:b].argmin(axis=1) + a for a, b in itertools.pairwise(firsts)], axis=1)
        return Deepest(points, -np.take_along_axis(gaps, points, axis=1))

    def rows(self, points: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        feet, normals = (np.take_along_axis(values, points[..., None], axis=1) for values in (self.feet, self.normals))
        if self.fixed.points.columns.size:
            feet = feet + self.fixed.pair.offsets.heights(deviations, points)[..., None] * normals
        return self.fixed.pair.P_m[points], feet, normals


def pair_scan(
    pair: ContactPoints, gaps: GapMap, tables: Sequence[np.ndarray], clusters: int, points: np.ndarray | None = None
) -> FixedScan:
    """Sort the points of a pair into at most `clusters` clusters of neighbours, and each cluster into branches and leaves.

    Each support has its own cluster.

    points   indices (point,) of the points of the scan; all if it is None
    """
    points = np.arange(len(pair.P_m)) if points is None else points
    label = cluster_labels(pair.P_m[points], len(points) if pair.is_supports else clusters)
    along = np.roll(gaps.coordinates, -1, axis=0)  # largest extents first, the constant last
    leaves_of_clusters = [_leaves(points[label == number], along) for number in range(label.max() + 1)]
    leaves = [leaf for cluster in leaves_of_clusters for leaf in cluster]
    order = np.concatenate(leaves)
    ends = np.cumsum([0, *map(len, leaves_of_clusters)])
    firsts = [np.arange(begin, end, kernel.BRANCH) for begin, end in itertools.pairwise(ends)]
    coordinates = np.ascontiguousarray(gaps.coordinates[:, order])
    rounding = BOUND_TOLERANCE * np.abs(coordinates[1:]).max(initial=0)
    starts, branches = np.cumsum([0, *map(len, leaves)]), np.concatenate([*firsts, [len(leaves)]])
    boxes = []
    for first in (starts[:-1], starts[branches[:-1]]):
        low, high = (extreme.reduceat(coordinates[1:], first, axis=1) for extreme in (np.minimum, np.maximum))
        boxes.append(np.stack([(low + high) / 2, (high - low) / 2 + rounding]))
    return FixedScan(
        pair.take(order),
        kernel.Points(gaps.basis, gaps.columns, coordinates, starts, branches, *boxes),
        clusters=np.cumsum([0, *map(len, firsts)]),
        tables=tuple(np.ascontiguousarray(table[:, order]) for table in tables),
    )


def _leaves(points: np.ndarray, coordinates: np.ndarray) -> list[np.ndarray]:
    """Halve `points` across their longest extent until no part has more than LEAF of them; neighbours stay together.

    All leaves but one are full: points are filled up to a power of two by points OUTSIDE, which are removed in the end.
    """
    count, size = len(points), kernel.LEAF
    while size < count:
        size *= 2
    padded = np.concatenate([coordinates[:, points], np.full((len(coordinates), size - count), OUTSIDE)], axis=1)
    parts = np.arange(size).reshape(1, size)
    while parts.shape[1] > kernel.LEAF:
        values = padded.take(parts, axis=1)
        widest = (values.max(axis=2) - values.min(axis=2)).argmax(axis=0)
        order = np.argpartition(values[widest, np.arange(len(parts))], parts.shape[1] // 2, axis=1)
        parts = np.take_along_axis(parts, order, axis=1).reshape(2 * len(parts), -1)
    return [points[leaf[leaf < count]] for leaf in parts[(parts < count).any(axis=1)]]


def cluster_labels(points: np.ndarray, clusters: int) -> np.ndarray:
    """Return the cluster of each point: the nearest of `clusters` points that lie as far apart as possible."""
    if len(points) <= clusters:
        return np.arange(len(points))
    label = np.zeros(len(points), dtype=int)
    nearest = ((points - points.mean(axis=0)) ** 2).sum(axis=1)
    for number in range(clusters):
        distance = ((points - points[nearest.argmax()]) ** 2).sum(axis=1)
        nearer = distance < nearest if number else np.ones(len(points), dtype=bool)
        label[nearer], nearest[nearer] = number, distance[nearer]
    return np.unique(label, return_inverse=True)[1]


def undone(
    scans: Sequence[Scan],
    min_gap: Float[Array, "realization pair"],
    relative: Float[Array, "realization pair 12"],
    deviations: Float[Array, "realization contributor"],
    may_carry: Sequence[Bool[Array, "realization _"] | None],
    slack: Float[Array, "realization pair"],
) -> Float[Array, "realization pair"]:
    """Return the penetration beyond the slack of points that may be active (realization, pair) [mm].

    min_gap     (realization, pair) [mm]: the smallest gaps of all points
    may_carry   for each pair (realization, point), or None if all points may
    """
    depths = [
        -min_gap[:, k] if may is None else scan.deepest(relative[:, k], deviations, may).depth.max(axis=1)
        for k, (scan, may) in enumerate(zip(scans, may_carry, strict=True))
    ]
    return np.stack(depths, axis=1) - slack


def min_gaps(
    scans: Sequence[Scan], relative: Float[Array, "realization pair 12"], deviations: Float[Array, "realization contributor"]
) -> Float[Array, "realization pair"]:
    """Return the smallest gap (realization, pair) [mm] of each pair at X_RM (realization, pair, 12)."""
    return np.stack([scan.min_gap(relative[:, k], deviations) for k, scan in enumerate(scans)], axis=1)
