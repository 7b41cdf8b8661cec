"""The contact points of a group's pairs: all points, the points that may be active, and their positions at other poses."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation import ContactGroup, Program
from tolcontact.contact.bounded_search import FREE_SHARE, BoundedSearch
from tolcontact.contact.fixed_search import MIN_BULGE, Carriers, FixedSearch, Search
from tolcontact.contact.guard import Guard
from tolcontact.contact.scan import Scan
from tolcontact.contact.slots import Slots
from tolcontact.contact.standing_search import StandingSearch
from tolcontact.contact.starts import Start
from tolcontact.contact.state import State, Task
from tolcontact.geometry.kernel import TINY
from tolcontact.geometry.parting import Parting
from tolcontact.interference.watch import ALLOWED_SHARE

ACTIVE_GAP = 1e-9  # mm: points below it are active; gaps of faces that touch nominally are zero up to rounding
APART = 2.0  # times the error of planes beyond their edges: bodies under load are no further apart
CEILING_SHARE = 1e-4  # of the size: gaps of bodies at rest above which places need not be known
ONCE = Search()


class Candidates:
    """The contact points of a group, with X_RM of its pairs as (realization, pair, 12).

    pairs        the searches of its pairs
    bounded      the searches of pairs whose places are found at every pose, by their index in the group
    guards       guards of these pairs, one for each two bodies: the guard of their first pair
    curved       indices in the group of the pairs with fixed points against curved faces
    free_depth   [mm]: the largest penetration of free bodies
    ceiling      [mm]: gaps of bodies at rest above which places need not be known
    """

    def __init__(self, program: Program, group: ContactGroup) -> None:
        self._method = program.method
        self._standing, self._spans = group.qp.standing, group.qp.spans
        self._varying = [k for k, points in enumerate(self._standing) if isinstance(points, int)]
        sides = group.group.sides
        self._totals = [np.array([side.moments for side in sides if side.pair == k]) for k in range(len(group.group.pairs))]
        self.pairs = [
            pair_search(program, index, [side.table for side in sides if side.pair == position])
            for position, index in enumerate(group.group.pairs)
        ]
        self._with_minima = [k for k, pair in enumerate(self.pairs) if pair.has_minima]
        self.curved = [k for k, pair in enumerate(self.pairs) if pair.is_curved]
        self.bounded = {k: pair for k, pair in enumerate(self.pairs) if isinstance(pair, BoundedSearch)}
        smallest = program.nominal.assembly.smallest_zone()
        self.free_depth = FREE_SHARE * smallest
        self._allowed_bulge = max(ALLOWED_SHARE * smallest, 2 * MIN_BULGE)
        self.ceiling = CEILING_SHARE * max((pair.meeting.size for pair in self.bounded.values()), default=0.0)
        self.guards: dict[int, Guard] = {}
        for k, pair in self.bounded.items():
            if pair.guard is not None and all(pair.guard.neighbours is not guard.neighbours for guard in self.guards.values()):
                self.guards[k], pair.adds_guard = pair.guard, True

    def scans(
        self,
        relative: Float[Array, "realization pair 12"],
        deviations: Float[Array, "realization contributor"],
        search: Search = ONCE,
        *,
        slots: Sequence[Slots] = (),
        earlier: Sequence[Scan] = (),
    ) -> list[Scan]:
        """Return scans of the points that may be active.

        slots     of the pairs with changing points: the points that were active
        earlier   scans with the sums of heights
        """
        slots_of_pairs = dict(zip(self._varying, slots, strict=bool(slots)))
        return [
            pair.scan(relative[:, k], deviations, search, earlier[k] if earlier else None, slots_of_pairs.get(k))
            for k, pair in enumerate(self.pairs)
        ]

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

    def interfere(
        self, relative: Float[Array, "realization pair 12"], deviations: Float[Array, "realization contributor"]
    ) -> Bool[Array, " realization"]:
        """Return whether bodies of a pair interfere (realization,), by a test that is independent of the list of places."""
        found = np.zeros(len(relative), dtype=bool)
        for k, guard in self.guards.items():
            found |= guard.interferes(relative[:, k], deviations)
        return found

    def slants(self, state: State) -> Float[Array, " n"]:
        """Return the mean slant of contact under load, in realizations (n,), see Meeting.slants, weighted by reactions."""
        total, loaded = np.zeros(len(state)), state.loaded
        for k, pair in self.bounded.items():
            row, slot = np.nonzero(loaded[:, self._spans[k]])
            labels = state.slots[self._varying.index(k)].labels[row, slot]
            slants = pair.meeting.slants(state.relative[row, k], labels)
            total += np.bincount(row, slants * state.multipliers[:, self._spans[k]][row, slot], minlength=len(state))
        return total / np.maximum(np.abs(state.multipliers).sum(axis=1), TINY)

    @property
    def are_guarded(self) -> bool:
        """Whether there are bounded pairs and every one of them has a guard against interference of its bodies."""
        return len(self.bounded) > 0 and all(pair.guard is not None for pair in self.bounded.values())

    @cached_property
    def partings(self) -> dict[int, Parting]:
        """The partings of bounded pairs of convex bodies without deviations, by the index of the pair in the group."""
        return {k: pair.parting for k, pair in self.bounded.items() if pair.parting is not None}

    def are_apart(self, state: State) -> Bool[Array, " n"]:
        """Return whether the bodies of a bounded pair under load touch nowhere (n,)."""
        found = np.zeros(len(state), dtype=bool)
        for k, search in self.bounded.items():
            if not search.pair.has_form:  # whose minima are not among the gaps
                found |= state.loaded[:, self._spans[k]].any(axis=1) & (state.gap_min[:, k] > APART * search.edge_error)
        return found

    def hold(self, task: Task, state: State, start: Start) -> Bool[Array, " n"]:
        """Return whether the active places are as close to their faces as an answer requires (n,)."""
        search = Search(start, width=1.0)
        scans = self.scans(state.relative, task.deviations, search, slots=state.slots, earlier=task.scans)
        held = np.ones(len(state), dtype=bool)
        for k in self.bounded:
            slots = state.slots[self._varying.index(k)]
            held &= (scans[k].holds(slots.points) | ~slots.filled).all(axis=1)
        return held

    def survey(
        self, relative: Float[Array, "realization pair 12"], deviations: Float[Array, "realization contributor"]
    ) -> tuple[Int[Array, "realization pair"], Float[Array, "realization side moment"]]:
        """Return the number of active points of raw states, and the moments of the points that count in the objective."""
        surveys = [pair.survey(relative[:, k], deviations, ACTIVE_GAP) for k, pair in enumerate(self.pairs)]
        moments = [self._counted(k, of_active) for k, (_, of_active) in enumerate(surveys)]
        return np.stack([active for active, _ in surveys], axis=1), np.concatenate(moments, axis=1)

    def _counted(self, k: int, active: np.ndarray) -> np.ndarray:
        """Return moments (realization, side, moment) of points that count in the objective, given those that are `active`."""
        if self.pairs[k].pair.is_supports:  # they are not among the paper's contact points
            return np.zeros_like(active)
        if not self._method.minimizes.counts_all:
            return active
        return np.broadcast_to(self._totals[k].reshape(active.shape[1:]), active.shape)

    def may_carry(
        self, relative: Float[Array, "realization pair 12"], deviations: Float[Array, "realization contributor"]
    ) -> list[Bool[Array, "realization _"] | None]:
        """Return which points (realization, point) may be active; in the paper's set, the points active in the raw state."""
        return [pair.raw_active(relative[:, k], deviations, ACTIVE_GAP) for k, pair in enumerate(self.pairs)]

    def carriers(self, k: int, state: State) -> Carriers:
        """Return the points of pair k under load."""
        standing = self._standing[k]
        points = state.slots[self._varying.index(k)] if isinstance(standing, int) else standing
        return self.pairs[k].carriers(state.loaded[:, self._spans[k]], points)


def pair_search(program: Program, index: int, tables: Sequence[np.ndarray] = ()) -> FixedSearch:
    """Return the search of a pair, with the moment tables of its sides (see FixedSearch)."""
    if index in program.meetings:
        return BoundedSearch(program, index, tables)
    return (FixedSearch if program.nominal.pairs[index].samples_faces else StandingSearch)(program, index, tables)
