"""The search of bounded faces: the places where two bodies can touch are found at every pose.

Guards detect bodies that interfere where the list of places shows nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import KDTree

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation import Program
from tolcontact.contact.fixed_search import Carriers, FixedSearch, Search
from tolcontact.contact.scan import PENETRATION, Scan
from tolcontact.contact.searched_scan import BoundedScan, SearchedPlaces
from tolcontact.contact.slots import Slots
from tolcontact.discretization import FIRST_POINT, raised_places
from tolcontact.geometry.kernel import INSIDE
from tolcontact.geometry.meeting import Meeting
from tolcontact.geometry.minima_kernel import FIRST_PLACE
from tolcontact.geometry.parting import Parting, parting
from tolcontact.geometry.places import Look, Places, RaisedPlaces, unraised
from tolcontact.interference import Neighbours, WayOut, ordered

EDGE_SHARE = 1 / 4000  # of the smallest tolerance range: error of planes beyond their edges, in steps

# The largest penetration of free bodies, of the smallest tolerance range. Where places are deeper and the complete test sees
# bodies apart, these lie on the far side of a body. It is some multiple of what that test overlooks at edges and tips.
FREE_SHARE = 1e-2
ALIGNED = 0.87  # cosine of the largest angle between the axis of separation and the normal of a penetrating place that counts
SHOWN_SHARE = 0.05  # of the gap along this axis: no place is added if another place shows the gap to within this share
GUARD = 1 << 41  # first label of places that a guard adds: a label encodes the direction that separates the bodies
PARTING = 2 * GUARD  # first label of places along which convex bodies part best (see Parting)
LEVELS = 1 << 12  # of a component of that direction
APART = 2.0 * 8.0 ** np.arange(3)  # insets of both bodies: the distances at which a place that holds them apart is searched


class BoundedSearch(FixedSearch):
    """The places of a pair with bounded faces.

    meeting      where its bodies can touch
    adds_guard   whether bodies that interfere get one more place, if the start is guarded: once for each two bodies
    edge_error   [mm]: error of planes beyond their edges, in steps
    free_depth   [mm]: the largest penetration of free bodies
    """

    def __init__(self, program: Program, index: int, tables: Sequence[np.ndarray] = ()) -> None:
        super().__init__(program, index, tables)
        self.clusters = 1  # places are found at every pose, so that clusters offer no separate points
        self.is_closed, self.is_curved = True, False
        self.meeting, self.adds_guard = program.meetings[index], False
        self.edge_error, self.free_depth = EDGE_SHARE * self._smallest, FREE_SHARE * self._smallest

    def touching_counts(self, X_RM: np.ndarray, deviations: np.ndarray, limit: float) -> np.ndarray:
        """Return the numbers of poses (point,) with a touching place to which a contact point is nearest."""
        raised = raised_places(self.pair, self.meeting, X_RM, deviations)
        row, place = np.nonzero(raised.gaps < limit)
        _, nearest = KDTree(self.pair.P_m).query(raised.places.P_m[row, place])
        realization_and_point = np.unique(np.column_stack([row, nearest]), axis=0)
        return np.bincount(realization_and_point[:, 1], minlength=len(self.pair.P_m))

    def touching(self, X_RM: np.ndarray, deviations: np.ndarray, nearness: float) -> tuple[np.ndarray, np.ndarray]:
        raised = raised_places(self.pair, self.meeting, X_RM, deviations)
        is_near = raised.gaps[0] < nearness
        return pose.apply(X_RM[0], raised.places.P_m[0, is_near]), raised.places.n_r[0, is_near]

    def scan(
        self, X_RM: np.ndarray, deviations: np.ndarray, search: Search, former: Scan | None, slots: Slots | None
    ) -> BoundedScan:
        """Return the places at X_RM.

        If the start is guarded, bodies that interfere where no place shows it get one more place (see Guard), which persists if
        it is in the slots. If it is parted, places separate convex bodies only in the best direction (see Parting). If it is
        free, places deeper than `search.deepest`, `free_depth` by default, do not count; its steps include places slightly
        beyond their edges, so that a corner in a valley meets both sides of the valley.
        """
        start, in_steps = search.start, search.width > 0
        labels = slots.labels if slots is not None and (in_steps or start.guarded) else None
        kept = None if labels is None or not in_steps else _kept(labels, former, search.at_rest)
        meeting, deepest = self.meeting.sloped if start.sloped else self.meeting, search.deepest
        if start.free:
            meeting = self._free if kept is None else self._widened
            deepest = np.full(len(X_RM), self.free_depth) if deepest is None else deepest
        look = Look(kept, search.width * self.edge_error, ceilings=search.ceilings)
        look = look if search.width <= 1 else look._replace(nearness=np.inf)
        raised = raised_places(self.pair, meeting, X_RM, deviations, look, self._bulge if self.has_minima else np.inf)
        if deepest is not None:
            raised = raised.only(raised.gaps >= -deepest[:, None])
        if start.guarded and self.adds_guard and self.guard is not None:
            raised = _with_guard(raised, self.guard, X_RM, labels)
        if start.parted and self.parting is not None:
            raised = _with_parting(raised, self.parting, X_RM, labels)
        return BoundedScan(meeting, SearchedPlaces.of(raised))

    @cached_property
    def guard(self) -> "Guard | None":
        """What detects bodies that interfere where no place shows it; None if they may interfere."""
        return Guard.of(self.program, self.index)

    @cached_property
    def _free(self) -> Meeting:
        """The meeting of free bodies."""
        return self.meeting.of_free_bodies()

    @cached_property
    def _widened(self) -> Meeting:
        """The meeting of free bodies, with places that count slightly beyond their edges."""
        return self.meeting.of_free_bodies(self.edge_error)

    @cached_property
    def parting(self) -> Parting | None:
        """The parting of convex bodies without deviations; None for others."""
        pair, parts = self.pair, self.program.nominal.parts
        assert pair.reference is not None
        if self.guard is None or any(pair.deviating) or self.guard.neighbours.varies:
            return None
        return parting(parts[pair.moving].body, parts[pair.reference].body)

    def carriers(self, loaded: np.ndarray, points: np.ndarray | Slots) -> Carriers:
        """Return none, since places lie on both bodies."""
        return Carriers(np.zeros(0, dtype=int), np.zeros((0, 3)), np.zeros(0, dtype=bool), 0.0)


def _kept(labels: np.ndarray, former: Scan | None, at_rest: np.ndarray | None) -> np.ndarray:
    """Return the labels (n, k) of places that persist in steps, from those in the slots; -1 for none."""
    kept = labels.copy()
    if at_rest is not None:
        # Places between the ends of faces with form appear and vanish without an edge.
        lies_between = ((kept >= FIRST_POINT) & (kept < GUARD)) | (kept >= FIRST_PLACE)
        kept[at_rest[:, None] & ~lies_between] = -1
    return np.concatenate([kept, former.minima], axis=1) if isinstance(former, BoundedScan) else kept


def _with_guard(raised: RaisedPlaces, guard: "Guard", X_RM: np.ndarray, former_labels: np.ndarray | None) -> RaisedPlaces:
    """Return places with one more where bodies interfere and no place shows it.

    If such a place was active before (`former_labels` (n, k)), it is found again: else bodies would interfere again at once.
    """
    labels = np.full(len(X_RM), -1)
    if former_labels is not None:
        is_guard = (former_labels >= GUARD) & (former_labels < PARTING)
        labels = np.where(is_guard, former_labels, -1).max(axis=1, initial=-1)
    rows = np.flatnonzero((labels >= 0) | (raised.gaps.min(axis=1, initial=np.inf) >= -PENETRATION))
    extra = _no_places(len(X_RM))
    for values, of_rows in zip(extra, guard.places(X_RM[rows], labels[rows]), strict=True):
        values[rows] = of_rows
    return raised.followed_by(unraised(extra))


def _with_parting(raised: RaisedPlaces, parting: Parting, X_RM: np.ndarray, former_labels: np.ndarray | None) -> RaisedPlaces:
    """Return places that separate convex bodies in the best direction, and the best place.

    Bodies are free once they are separate in one direction; penetrating places with other normals would push them as well. The
    separating place is added where no other place shows as much. Nearly parallel edges that were active before (`former_labels`
    (n, k)) are added, too.
    """
    axis = parting.at(X_RM)
    is_aligned = (raised.places.n_r * axis.n_r).sum(axis=2) > ALIGNED
    raised = raised.only((raised.gaps >= -INSIDE) | ((axis.gaps < -INSIDE) & is_aligned))
    shown = np.where(is_aligned, raised.gaps, np.inf).min(axis=1, initial=np.inf)[:, None]
    is_new = axis.gaps < shown - SHOWN_SHARE * np.maximum(np.abs(axis.gaps), INSIDE)
    labels = np.where(is_new, PARTING + axis.labels, -1)
    added = [axis._replace(labels=labels, gaps=np.where(is_new, axis.gaps, np.inf))]
    if former_labels is not None:
        edges = np.where((former_labels >= PARTING) & (former_labels != labels), former_labels - PARTING, -1)
        crossings = parting.crossings(X_RM, edges, axis.n_r[:, 0])
        added.append(crossings._replace(labels=np.where(np.isfinite(crossings.gaps), former_labels, -1)))
    return raised.followed_by(*map(unraised, added))


def _label(normals: Float[Array, "n 3"]) -> Int[Array, " n"]:
    digits = np.round((normals + 1) / 2 * (LEVELS - 1)).astype(np.int64)
    return GUARD + (digits[:, 0] * LEVELS + digits[:, 1]) * LEVELS + digits[:, 2]


def _direction(labels: Int[Array, " n"]) -> Float[Array, "n 3"]:
    code = labels - GUARD
    digits = np.stack([code // LEVELS**2, code // LEVELS % LEVELS, code % LEVELS], axis=1)
    normals = digits / (LEVELS - 1) * 2 - 1
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def _no_places(count: int) -> Places:
    """Return empty places (n, 1)."""
    return Places(np.full((count, 1), -1), np.full((count, 1), np.inf), *np.zeros((3, count, 1, 3)))


@dataclass(frozen=True, eq=False)
class Guard:
    """The bodies of a pair as the search moves them: as a whole, with the face that touches.

    is_swapped   whether the moving body is the second one of the neighbours
    """

    neighbours: Neighbours
    is_swapped: bool

    @classmethod
    def of(cls, program: Program, index: int) -> "Guard | None":
        """Return the guard of a pair; None if its bodies may interfere, have no inside, or grow where they touch."""
        pair = program.nominal.pairs[index]
        assert pair.reference is not None
        if any(face is not None and face.grows for face in pair.deviating):
            return None
        bodies = ordered(pair.moving, pair.reference)
        neighbours = program.watch.neighbours(bodies)
        return None if neighbours is None else cls(neighbours, pair.moving != bodies[0])

    def interferes(self, X_RM: Float[Array, "n 12"]) -> Bool[Array, " n"]:
        """Return whether the bodies interfere at X_RM (n,)."""
        return self.neighbours.interfere(pose.inverse(X_RM) if self.is_swapped else X_RM)

    def places(self, X_RM: Float[Array, "n 12"], labels: Int[Array, " n"]) -> Places:
        """Return a place (n, 1) that separates the bodies at X_RM where they interfere, or touch; an infinite gap for none.

        labels   (n,) of the places that held the bodies apart before, -1 for none: these bodies touch, or are a little apart
        """
        found = _no_places(len(X_RM))
        self._part(found, np.arange(len(X_RM)), X_RM, np.zeros((len(X_RM), 3)))
        for apart in APART * sum(self.neighbours.insets):
            rows = np.flatnonzero((found.labels[:, 0] < 0) & (labels >= 0))
            if rows.size:
                self._part(found, rows, X_RM, -apart * _direction(labels[rows]))
        return found

    def _part(self, found: Places, rows: Int[Array, " k"], X_RM: Float[Array, "n 12"], shift: Float[Array, "k 3"]) -> None:
        """Write the place that separates bodies in some rows, which overlap once the moving one is shifted."""
        shifted = X_RM[rows]
        shifted[:, 9:] += shift
        way = self.ways_out(shifted, -shift)
        is_known = way.widths > 0
        rows, way = rows[is_known], WayOut(*(values[is_known] for values in way))
        arms = np.einsum("nij,nj->ni", pose.rotation(X_RM[rows]), way.places) + pose.translation(X_RM[rows]) - way.feet
        gaps = (arms * way.normals).sum(axis=1)
        for values, of_rows in zip(found, (_label(way.normals), gaps, way.places, way.feet, way.normals), strict=True):
            values[rows, 0] = of_rows

    def ways_out(self, X_RM: Float[Array, "n 12"], directions: Float[Array, "n 3"] | None = None) -> WayOut:
        """Return how the bodies separate: P_m, P_r and n_r of the paper, and how deep the place P_m lies (n,) [mm].

        directions   (n, 3) of separation, if known (see Neighbours)
        """
        if not self.is_swapped:
            return self.neighbours.ways_out(X_RM, directions)
        R = pose.rotation(X_RM)
        given = None if directions is None else -np.einsum("nji,nj->ni", R, directions)
        way = self.neighbours.ways_out(pose.inverse(X_RM), given)
        return WayOut(way.feet, way.places, -np.einsum("nij,nj->ni", R, way.normals), way.widths)
