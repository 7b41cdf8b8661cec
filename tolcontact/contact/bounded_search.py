"""The search of bounded faces: the places where two bodies can touch are found at every pose."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy.spatial import KDTree

from tolcontact import poses as pose
from tolcontact.compilation import Program
from tolcontact.contact.bounded_scan import BoundedScan, bounded_scan
from tolcontact.contact.fixed_search import Carriers, FixedSearch, Search
from tolcontact.contact.guard import GUARD, Guard
from tolcontact.contact.scan import Scan
from tolcontact.contact.slots import Slots
from tolcontact.discretization import FIRST_POINT, raised_places
from tolcontact.geometry.meeting import Meeting
from tolcontact.geometry.minima_kernel import FIRST_PLACE
from tolcontact.geometry.parting import Parting, parting
from tolcontact.geometry.places import Look

EDGE_SHARE = 1 / 4000  # of the smallest tolerance range: error of planes beyond their edges, in steps

# The largest penetration of free bodies, of the smallest tolerance range. Where places are deeper and the complete test sees
# bodies apart, these lie on the far side of a body. It is some multiple of what that test overlooks at edges and tips.
FREE_SHARE = 1e-2


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
        return bounded_scan(
            self.pair, meeting, X_RM, deviations, look if search.width <= 1 else look._replace(nearness=np.inf),
            depth=self._bulge if self.has_minima else np.inf,
            deepest=deepest,
            guard=self.guard if start.guarded and self.adds_guard else None,
            parting=self.parting if start.parted else None,
            former_labels=labels,
        )  # fmt: skip

    @cached_property
    def guard(self) -> Guard | None:
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

    def carriers(self, loaded: np.ndarray, standing: np.ndarray | None = None, slots: Slots | None = None) -> Carriers:
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
