"""The contact points of a group's pairs: all points, the points that may be active, and their positions at other poses."""

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation import ContactGroup, Program
from tolcontact.contact.bounded_scan import BoundedScan, bounded_scan
from tolcontact.contact.guard import GUARD, Guard
from tolcontact.contact.projected_scan import half_spacing, project
from tolcontact.contact.raised_scan import RaisedScan, raised_scan
from tolcontact.contact.scan import FixedScan, RoundScan, Scan, min_gaps, pair_scan
from tolcontact.contact.slots import Slots
from tolcontact.contact.starts import FIRST, Start
from tolcontact.contact.state import State, Task
from tolcontact.discretization import FIRST_POINT
from tolcontact.geometry.meeting import NEARNESS, Meeting
from tolcontact.geometry.minima_kernel import FIRST_PLACE
from tolcontact.geometry.parting import Parting, parting
from tolcontact.interference.watch import ALLOWED_SHARE
from tolcontact.mechanics import curved_pairs

ACTIVE_GAP = 1e-9  # mm: points below it are active; gaps of faces that touch nominally are zero up to rounding
MAX_CLUSTERS = 6
FORM_CLUSTERS = 8  # of faces with form, which touch at more places
APART = 2.0  # times the error of planes beyond their edges: bodies under load are no further apart
EDGE_SHARE = 1 / 4000  # of the smallest tolerance range: error of planes beyond their edges, in steps
CEILING_SHARE = 1e-4  # of the size: gaps of bodies at rest above which places need not be known
BULGE_SHARE = 1 / 2500  # of the same: accepted penetration of planes with form between contact points
MIN_BULGE = 1e-7  # mm
OVERHANG_SHARE = 0.01  # of their radius: overhang beyond a wall at which balls and shafts that travelled far may be active

# The largest penetration of free bodies, of the smallest tolerance range. Where places are deeper and the complete test sees
# bodies apart, these lie on the far side of a body. It is some multiple of what that test overlooks at edges and tips.
FREE_SHARE = 1e-2


def _lies_between(labels: Int[Array, "n k"]) -> Bool[Array, "n k"]:
    """Return which labels belong to contact points, or to minima of the gap, between the ends of faces."""
    return ((labels >= FIRST_POINT) & (labels < GUARD)) | (labels >= FIRST_PLACE)


class RawSurvey(NamedTuple):
    """Gaps and active points of realizations in their raw state.

    scans       for each pair the points that may be active
    min_gap     (realization, pair) [mm]: the smallest gaps
    active      (realization, pair): number of active points
    moments     (realization, side, moment) of the points that count in the objective
    is_inside   (realization,): whether faces with form penetrate each other between the points
    """

    scans: list[Scan]
    min_gap: Float[Array, "realization pair"]
    is_inside: Bool[Array, " realization"]
    active: Int[Array, "realization pair"]
    moments: Float[Array, "realization side moment"]


class Carriers(NamedTuple):
    """Points of a pair that are under load.

    realization   the realization of each point
    places        (point, 3), nominal, on the part opposite the surface that they touch
    on_moving     whether that is the moving part
    spacing       the usual spacing of the points [mm]; for round faces, the permitted overhang beyond a wall
    """

    realization: Int[Array, " point"]
    places: Float[Array, "point 3"]
    on_moving: Bool[Array, " point"]
    spacing: float


class Candidates:
    """The contact points of a group, with X_RM of its pairs as (realization, pair, 12).

    bounded      the meetings of pairs whose places are found at every pose, by their index in the group
    guards       guards of these pairs, one for each two bodies: the guard of their first pair
    free_depth   [mm]: the largest penetration of free bodies
    ceiling      [mm]: gaps of bodies at rest above which places need not be known
    """

    def __init__(self, program: Program, group: ContactGroup) -> None:
        self._method = program.method
        self._pairs = [program.nominal.pairs[pair] for pair in group.group.pairs]
        self._bodies = [part.body for part in program.nominal.parts]
        self._standing, self._spans = group.qp.standing, group.qp.spans
        self._varying = [k for k, points in enumerate(self._standing) if isinstance(points, int)]
        self._all_scans: list[RoundScan | FixedScan] = []
        sides = group.group.sides
        self._totals = [np.array([side.moments for side in sides if side.pair == k]) for k in range(len(group.group.pairs))]
        self._carrying_scans: list[RoundScan | FixedScan] = []
        for position, index in enumerate(group.group.pairs):
            pair, gaps = program.nominal.pairs[index], program.gaps[index]
            tables = [side.table for side in group.group.sides if side.pair == position]
            if gaps is None:
                round_scan = RoundScan(tuple(tables), program.round_gaps[index])
                self._all_scans.append(round_scan)
                self._carrying_scans.append(round_scan)
                continue
            # Places of bounded pairs are found at every pose, so that clusters offer no separate points.
            clusters = 1 if index in program.meetings else FORM_CLUSTERS if pair.has_form else MAX_CLUSTERS
            self._all_scans.append(pair_scan(pair, gaps, tables, clusters))
            # If the paper's set of points may be active, points between the corners count, too.
            corners = self._method.is_closed and index not in program.meetings
            self._carrying_scans.append(pair_scan(pair, gaps, (), clusters, gaps.corners) if corners else self._all_scans[-1])
        self._fixed = {k: scan for k, scan in enumerate(self._carrying_scans) if isinstance(scan, FixedScan)}
        smallest = program.nominal.assembly.smallest_zone()
        self.free_depth = FREE_SHARE * smallest
        self._edge_error, self._bulge = EDGE_SHARE * smallest, max(BULGE_SHARE * smallest, MIN_BULGE)
        self._allowed_bulge = max(ALLOWED_SHARE * smallest, 2 * MIN_BULGE)
        searches = self._method.is_exact and self._method.is_closed
        self._with_minima = {
            k for k in self._varying if searches and np.isfinite(smallest) and self._pairs[k].minima is not None
        }
        self.bounded = {k: program.meetings[index] for k, index in enumerate(group.group.pairs) if index in program.meetings}
        self.ceiling = CEILING_SHARE * max((meeting.size for meeting in self.bounded.values()), default=0.0)
        guards = {k: Guard.of(program, group.group.pairs[k]) for k in self.bounded}
        self._guards = {k: guard for k, guard in guards.items() if guard is not None}
        of_bodies = {id(guard.neighbours): k for k, guard in reversed(self._guards.items())}
        self.guards = {k: self._guards[k] for k in sorted(of_bodies.values())}
        curved = curved_pairs(program.nominal, group.group) if self._method.is_exact else []
        self.curved = [k for k in curved if k not in self.bounded]
        self._margins = {k: half_spacing(self._pairs[k].P_m) for k in self.curved}

    def scans(
        self,
        relative: Float[Array, "realization pair 12"],
        deviations: Float[Array, "realization contributor"],
        *,
        slots: Sequence[Slots] = (),
        width: float = 0.0,
        at_rest: Bool[Array, " realization"] | None = None,
        earlier: Sequence[Scan] = (),
        start: Start = FIRST,
        deepest: Float[Array, " realization"] | None = None,
        ceilings: Float[Array, " realization"] | None = None,
    ) -> list[Scan]:
        """Return scans of the points that may be active.

        Places of bounded pairs are searched again. In steps, active places, which are in the `slots` of the pairs with changing
        points, persist slightly beyond their edges, up to `width` times the limit for an answer, unless the realization is
        `at_rest`. If the `start` is guarded, bodies that interfere where no place shows it get one more place (see Guard),
        which persists if it is in the slots. If it is parted, places separate convex bodies only in the best direction (see
        Parting). If it is free, places deeper than `deepest` (realization,) [mm], `free_depth` by default, are on the far side
        of a body and do not count; its steps include places slightly beyond their edges, so that a corner in a valley meets
        both sides of the valley.
        If it is projected, points against curved faces are projected again. `earlier` are scans with the sums of heights.
        """
        scans: list[Scan] = []
        for k, scan in enumerate(self._carrying_scans):
            X_RM, former = relative[:, k], earlier[k] if earlier else None
            if k in self.bounded:
                former_labels = slots[self._varying.index(k)].labels if slots and (width > 0 or start.guarded) else None
                kept = None if former_labels is None or width == 0 else self._kept(former_labels, former, at_rest)
                limits = np.full(len(X_RM), self.free_depth) if start.free and deepest is None else deepest
                scans.append(self._bounded(k, X_RM, deviations, start, kept, width, former_labels, limits, ceilings))
            elif start.projected and k in self._margins:
                scans.append(self.projected(k, X_RM))
            elif self._pairs[k].has_form:
                scans.append(self._raised(k, former, X_RM, deviations, in_steps=width > 0))
            else:
                scans.append(scan)
        return scans

    def _kept(self, labels: np.ndarray, former: Scan | None, at_rest: np.ndarray | None) -> np.ndarray:
        """Return the labels (n, k) of places that persist in steps, from those in the slots; -1 for none."""
        kept = labels.copy()
        if at_rest is not None:
            # Places between the ends of faces with form appear and vanish without an edge.
            kept[at_rest[:, None] & ~_lies_between(kept)] = -1
        return np.concatenate([kept, former.minima], axis=1) if isinstance(former, BoundedScan) else kept

    def _bounded(
        self,
        k: int,
        X_RM: np.ndarray,
        deviations: np.ndarray,
        start: Start,
        kept: np.ndarray | None,
        width: float,
        former_labels: np.ndarray | None,
        limits: np.ndarray | None,
        ceilings: np.ndarray | None,
    ) -> BoundedScan:
        """Return the scan of a bounded pair at X_RM (n, 12), see `scans` and bounded_scan."""
        meeting = self.bounded[k]
        if start.free:
            meeting = self._free[k] if kept is None else self._widened[k]
        elif start.sloped:
            meeting = meeting.sloped
        return bounded_scan(
            self._pairs[k], meeting, X_RM, deviations, kept,
            error=width * self._edge_error,
            nearness=NEARNESS if width <= 1 else np.inf,
            depth=self._bulge if k in self._with_minima else np.inf,
            guard=self.guards.get(k) if start.guarded else None,
            parting=self.partings.get(k) if start.parted else None,
            former_labels=former_labels,
            deepest=limits,
            ceilings=ceilings,
        )  # fmt: skip

    def _raised(self, k: int, former: Scan | None, X_RM: np.ndarray, deviations: np.ndarray, *, in_steps: bool) -> Scan:
        """Return the scan of a pair with form at X_RM (n, 12), with minima of the gap between its points."""
        is_raw, always = not isinstance(former, RaisedScan), k in self._with_minima
        raised = former if isinstance(former, RaisedScan) else raised_scan(self._fixed[k], deviations, always=always)
        if always and isinstance(raised, RaisedScan):
            return raised.with_minima(self._pairs[k], X_RM, deviations, self._bulge, is_raw=is_raw, in_steps=in_steps)
        return raised

    @property
    def change(self) -> bool:
        """Whether contact places are searched at every pose."""
        return bool(self.bounded or self._with_minima)

    def bulge(self, scans: Sequence[Scan], relative: Float[Array, "realization pair 12"]) -> Bool[Array, " realization"]:
        """Return whether planes with form penetrate between contact points, deeper than bodies may (realization,)."""
        found = np.zeros(len(relative), dtype=bool)
        for k in self._with_minima:
            found |= scans[k].depth_between(relative[:, k]) > self._allowed_bulge
        return found

    def interfere(self, relative: Float[Array, "realization pair 12"]) -> Bool[Array, " realization"]:
        """Return whether bodies of a pair interfere (realization,), by a test that is independent of the list of places."""
        found = np.zeros(len(relative), dtype=bool)
        for k, guard in self.guards.items():
            found |= guard.interferes(relative[:, k])
        return found

    @cached_property
    def _free(self) -> dict[int, Meeting]:
        """The meetings of bounded pairs, of free bodies."""
        return {k: places.of_free_bodies() for k, places in self.bounded.items()}

    @cached_property
    def _widened(self) -> dict[int, Meeting]:
        """The meetings of bounded pairs, of free bodies, with places that count slightly beyond their edges."""
        return {k: places.of_free_bodies(self._edge_error) for k, places in self.bounded.items()}

    def slants(self, state: State) -> Float[Array, " n"]:
        """Return the largest slant of rims under load that cross, in realizations (n,), see Meeting.slants."""
        largest = np.zeros(len(state))
        for k, meeting in self.bounded.items():
            row, slot = np.nonzero(state.loaded[:, self._spans[k]])
            labels = state.slots[self._varying.index(k)].labels[row, slot]
            np.maximum.at(largest, row, meeting.slants(state.relative[row, k], labels))
        return largest

    @property
    def are_guarded(self) -> bool:
        """Whether there are bounded pairs and every one of them has a guard against interference of its bodies."""
        return len(self.bounded) > 0 and len(self._guards) == len(self.bounded)

    @cached_property
    def partings(self) -> dict[int, Parting]:
        """The partings of bounded pairs of convex bodies without deviations, by the index of the pair in the group."""
        partings = {}
        for k, guard in self._guards.items():
            pair = self._pairs[k]
            assert pair.reference is not None
            if not any(pair.deviating) and not guard.neighbours.varies:
                partings[k] = parting(*(self._bodies[part] for part in (pair.moving, pair.reference)))
        return {k: found for k, found in partings.items() if found is not None}

    def are_apart(self, state: State) -> Bool[Array, " n"]:
        """Return whether the bodies of a bounded pair under load touch nowhere (n,)."""
        found = np.zeros(len(state), dtype=bool)
        for k in self.bounded:
            if not self._pairs[k].has_form:  # whose minima are not among the gaps
                found |= state.loaded[:, self._spans[k]].any(axis=1) & (state.gap_min[:, k] > APART * self._edge_error)
        return found

    def hold(self, task: Task, state: State, start: Start) -> Bool[Array, " n"]:
        """Return whether the active places are as close to their faces as an answer requires (n,)."""
        scans = self.scans(state.relative, task.deviations, slots=state.slots, width=1.0, earlier=task.scans, start=start)
        held = np.ones(len(state), dtype=bool)
        for k in self.bounded:
            slots = state.slots[self._varying.index(k)]
            held &= (scans[k].holds(slots.points) | ~slots.filled).all(axis=1)
        return held

    def projected(self, k: int, relative: Float[Array, "realization 12"]) -> Scan:
        """Return a scan of the points of pair k, projected again at X_RM (realization, 12)."""
        return project(self._fixed[k], self._pairs[k], relative, self._margins[k])

    def survey(
        self, relative: Float[Array, "realization pair 12"], deviations: Float[Array, "realization contributor"]
    ) -> RawSurvey:
        """Return the survey of raw states, for deviations (realization, contributor)."""
        scans = self.scans(relative, deviations)
        surveys = [scan.survey(relative[:, k], deviations, ACTIVE_GAP) for k, scan in enumerate(self._all_scans)]
        return RawSurvey(
            scans=scans,
            min_gap=min_gaps(scans, relative, deviations),
            is_inside=np.stack([scan.depth_between(relative[:, k]) for k, scan in enumerate(scans)]).max(axis=0) > 0,
            active=np.stack([survey.active for survey in surveys], axis=1),
            moments=np.concatenate([self._counted(k, survey.moments) for k, survey in enumerate(surveys)], axis=1),
        )

    def _counted(self, k: int, active: np.ndarray) -> np.ndarray:
        """Return moments (realization, side, moment) of points that count in the objective, given those that are `active`."""
        if self._pairs[k].is_supports:  # they are not among the paper's contact points
            return np.zeros_like(active)
        if not self._method.minimizes.counts_all:
            return active
        return np.broadcast_to(self._totals[k].reshape(active.shape[1:]), active.shape)

    def may_carry(
        self, relative: Float[Array, "realization pair 12"], deviations: Float[Array, "realization contributor"]
    ) -> list[Bool[Array, "realization _"] | None]:
        """Return which points (realization, point) may be active; in the paper's set, the points active in the raw state."""
        if self._method.is_closed:
            return [None for _ in self._pairs]
        return [
            None if pair.is_supports or pair.round or k in self.bounded else scan.gaps(relative[:, k], deviations) < ACTIVE_GAP
            for k, (pair, scan) in enumerate(zip(self._pairs, self._carrying_scans, strict=True))
        ]

    def carriers(self, k: int, state: State) -> Carriers:
        """Return the points of pair k under load; none for a bounded pair, whose places lie on both bodies."""
        if k in self.bounded:
            return Carriers(np.zeros(0, dtype=int), np.zeros((0, 3)), np.zeros(0, dtype=bool), 0.0)
        loaded, standing, pair = state.loaded[:, self._spans[k]], self._standing[k], self._pairs[k]
        if pair.round:
            points = pair.round.points
            realization, column = np.nonzero(loaded & ~points["cut"].any(axis=1))  # a shaft may continue beyond a wall
            spacing = OVERHANG_SHARE * float(points["radius"].max())
            return Carriers(realization, points["centre"][column], points["on_moving"][column], spacing)
        if isinstance(standing, int):
            slots = state.slots[self._varying.index(k)]
            realization, column = np.nonzero(loaded & slots.filled)
            places = self._places(k, slots.points[realization, column])
        else:
            realization, column = np.nonzero(loaded)
            places = pair.P_m[standing[column]]
        return Carriers(realization, places, np.ones(len(places), dtype=bool), 2 * half_spacing(pair.P_m))

    def _places(self, k: int, labels: Int[Array, " point"]) -> Float[Array, "point 3"]:
        """Return the nominal places of contact points of pair k, and of minima of the gap between them, by their labels."""
        is_point, minima = labels < FIRST_PLACE, self._pairs[k].minima
        places = self._fixed[k].P_m[np.where(is_point, labels, 0)]
        return places if minima is None else np.where(is_point[:, None], places, minima.points(labels))
