"""The search of bounded faces: the places where two bodies can touch are found at every pose."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import KDTree

from tolcontact import poses as pose
from tolcontact.arrays import Array, Int
from tolcontact.compilation import MANY_SLOTS, Program
from tolcontact.contact.fixed_search import Carriers, FixedSearch, Search
from tolcontact.contact.guard import GUARD, PARTING, Guard, is_guard
from tolcontact.contact.scan import PENETRATION, Deepest, Scan
from tolcontact.contact.slots import Slots
from tolcontact.discretization import FIRST_POINT, raised_places
from tolcontact.geometry.kernel import CORNER_ON_FACET, INSIDE
from tolcontact.geometry.meeting import Meeting
from tolcontact.geometry.minima_kernel import FIRST_PLACE
from tolcontact.geometry.parting import Parting, parting
from tolcontact.geometry.places import Look, Places

MAX_DEEPEST = MANY_SLOTS  # places of a pair that get a row in one round
EDGE_SHARE = 1 / 4000  # of the smallest tolerance range: error of planes beyond their edges, in steps

# The largest penetration of free bodies, of the smallest tolerance range. Where places are deeper and the complete test sees
# bodies apart, these lie on the far side of a body. It is some multiple of what that test overlooks at edges and tips.
FREE_SHARE = 1e-2
ALIGNED = 0.87  # cosine of the largest angle between the axis of separation and the normal of a penetrating place that counts
SHOWN_SHARE = 0.05  # of the gap along this axis: no place is added if another place shows the gap to within this share


@dataclass(frozen=True, eq=False)
class BoundedScan(Scan):
    """Places where a pair can touch at given poses: for each realization, the places with the smallest gaps.

    places   whose labels are their indices in the meeting of the pair
    """

    fills = True

    meeting: Meeting
    places: Places

    def take(self, rows: np.ndarray) -> "BoundedScan":
        return BoundedScan(self.meeting, self.places.take(rows))

    @property
    def minima(self) -> Int[Array, "realization minimum"]:
        """The labels of minima of the gap between contact points, -1 for none."""
        labels = self.places.labels
        is_minimum = labels >= FIRST_PLACE
        return np.where(is_minimum, labels, -1)[:, is_minimum.any(axis=0)]

    def min_gap(self, relative: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        gaps = np.where(self.places.labels < FIRST_PLACE, self.places.gaps_at(relative), np.inf)
        return gaps.min(axis=1, initial=np.inf)

    def depth_between(self, relative: np.ndarray) -> np.ndarray:
        gaps = np.where(self.places.labels < FIRST_PLACE, np.inf, self.places.gaps_at(relative))
        return -gaps.min(axis=1, initial=0.0)

    def deepest(self, relative: np.ndarray, deviations: np.ndarray, may_carry: np.ndarray | None = None) -> Deepest:
        count = min(MAX_DEEPEST, self.places.labels.shape[1])
        return Deepest(*self.places.deepest(relative, count, self.meeting.reach.spread))

    def rows(self, points: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.places.rows(points)

    def holds(self, points: np.ndarray) -> np.ndarray:
        return self.places.holds(points)

    def moves(self, points: np.ndarray) -> np.ndarray:
        if not len(self.meeting.kinds):
            return np.zeros(points.shape, dtype=bool)
        at_ends = np.where(points < FIRST_POINT, points, 0)
        return (self.meeting.kinds[at_ends] == CORNER_ON_FACET) & (points < FIRST_POINT)


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
        places = raised_places(self.pair, self.meeting, X_RM, deviations)
        row, place = np.nonzero(places.actual_gaps < limit)
        _, nearest = KDTree(self.pair.P_m).query(places.P_m[row, place])
        realization_and_point = np.unique(np.column_stack([row, nearest]), axis=0)
        return np.bincount(realization_and_point[:, 1], minlength=len(self.pair.P_m))

    def touching(self, X_RM: np.ndarray, deviations: np.ndarray, nearness: float) -> tuple[np.ndarray, np.ndarray]:
        places = raised_places(self.pair, self.meeting, X_RM, deviations)
        is_near = places.actual_gaps[0] < nearness
        return pose.apply(X_RM[0], places.P_m[0, is_near]), places.n_r[0, is_near]

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
        places = raised_places(self.pair, meeting, X_RM, deviations, look, self._bulge if self.has_minima else np.inf)
        if deepest is not None:
            places = places.only(places.actual_gaps >= -deepest[:, None])
        if start.guarded and self.adds_guard and self.guard is not None:
            places = _with_guard(places, self.guard, X_RM, deviations, labels)
        if start.parted and self.parting is not None:
            places = _with_parting(places, self.parting, X_RM, labels)
        return BoundedScan(meeting, places)

    @cached_property
    def guard(self) -> Guard | None:
        """What detects bodies that interfere where no place shows it; None if they may interfere, or have no inside."""
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


def _with_guard(
    places: Places, guard: Guard, X_RM: np.ndarray, deviations: np.ndarray, former_labels: np.ndarray | None
) -> Places:
    """Return places with one more where bodies interfere and no place shows it.

    If such a place was active before (`former_labels` (n, k)), it is found again: else bodies would interfere again at once.
    """
    labels = np.full(len(X_RM), -1)
    if former_labels is not None:
        labels = np.where(is_guard(former_labels), former_labels, -1).max(axis=1, initial=-1)
    rows = np.flatnonzero((labels >= 0) | (places.actual_gaps.min(axis=1, initial=np.inf) >= -PENETRATION))
    return places.followed_by(guard.places(X_RM[rows], labels[rows], deviations[rows]).among(len(X_RM), rows))


def _with_parting(places: Places, parting: Parting, X_RM: np.ndarray, former_labels: np.ndarray | None) -> Places:
    """Return places that separate convex bodies in the best direction, and the best place.

    Bodies are free once they are separate in one direction; penetrating places with other normals would push them as well. The
    separating place is added where no other place shows as much. Nearly parallel edges that were active before (`former_labels`
    (n, k)) are added, too.
    """
    axis = parting.at(X_RM)
    is_aligned = (places.n_r * axis.n_r).sum(axis=2) > ALIGNED
    places = places.only((places.actual_gaps >= -INSIDE) | ((axis.gaps < -INSIDE) & is_aligned))
    shown = np.where(is_aligned, places.actual_gaps, np.inf).min(axis=1, initial=np.inf)[:, None]
    is_new = axis.gaps < shown - SHOWN_SHARE * np.maximum(np.abs(axis.gaps), INSIDE)
    labels = np.where(is_new, PARTING + axis.labels, -1)
    added = [axis._replace(labels=labels, gaps=np.where(is_new, axis.gaps, np.inf))]
    if former_labels is not None:
        edges = np.where((former_labels >= PARTING) & (former_labels != labels), former_labels - PARTING, -1)
        crossings = parting.crossings(X_RM, edges, axis.n_r[:, 0])
        added.append(crossings._replace(labels=np.where(np.isfinite(crossings.gaps), former_labels, -1)))
    return places.followed_by(*added)
