"""The contact points of a group's pairs: all of them, those that may carry, and where they are at other poses."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation import ContactGroup, Program
from tolcontact.contact.projection import project, reach
from tolcontact.contact.round_scan import RoundScan
from tolcontact.contact.scan import PairScan, Scan, fixed, least_gaps, pair_scan
from tolcontact.contact.state import State
from tolcontact.mechanics import curved_pairs

CLUSTERS = 6
BESIDE = 0.01  # of their radius: what balls and shafts may carry beside a wall, if they came from afar


class Seen(NamedTuple):
    """What is seen of the raw state of realizations.

    scans     for each pair the points that may carry
    least     (realization, pair) [mm]: least gaps
    active    (realization, pair): number of active points
    moments   (realization, side, moment) of the points that count in the objective
    """

    scans: list[Scan]
    least: Float[Array, "realization pair"]
    active: Int[Array, "realization pair"]
    moments: Float[Array, "realization side moment"]


class Carriers(NamedTuple):
    """Points of a pair that carry.

    realization   the realization of each
    places        (point, 3), nominal, of the part that has not the surface which they touch
    on_moving     whether that is the moving part
    spacing       their usual distance [mm]; of round faces how far they may stand beside a wall
    """

    realization: Int[Array, " point"]
    places: Float[Array, "point 3"]
    on_moving: Bool[Array, " point"]
    spacing: float


class Candidates:
    """The contact points of a group, with X_RM of its pairs as (realization, pair, 12)."""

    def __init__(self, program: Program, group: ContactGroup) -> None:
        self._method = program.method
        self._pairs = [program.nominal.pairs[pair] for pair in group.group.pairs]
        self._standing, self._spans = group.program.standing, group.program.spans
        self._varying = [k for k, points in enumerate(self._standing) if points is None]
        self._every: list[Scan] = []
        self._some: list[Scan] = []
        for position, index in enumerate(group.group.pairs):
            pair, gaps = program.nominal.pairs[index], program.gaps[index]
            tables = [side.table for side in group.group.sides if side.pair == position]
            if gaps is None:
                of_round = RoundScan(tuple(tables), pair.P_m, pair.offsets, program.round_gaps[index])
                self._every.append(of_round)
                self._some.append(of_round)
                continue
            self._every.append(pair_scan(pair, gaps, tables, CLUSTERS))
            # If the paper's set of points may carry, those between the corners count, too.
            corners = self._method.corners_suffice
            self._some.append(pair_scan(pair, gaps, (), CLUSTERS, gaps.corners) if corners else self._every[-1])
        is_iterated = self._method.is_iterated
        self.curved = curved_pairs(program.nominal, group.group) if self._method.is_exact and not is_iterated else []
        again = [k for k, pair in enumerate(self._pairs) if pair.round is None] if is_iterated else self.curved
        self._reaches = {k: reach(fixed(self._every[k])) for k in again}

    def scans(self, relative: Float[Array, "realization pair 12"], *, anew: bool = False) -> list[Scan]:
        """Scans of the points that may carry; projected again if the method requires it.

        `anew`: those against curved faces are projected again in any case.
        """
        scans = list(self._some)
        if anew or self._method.is_iterated:
            for k in self._reaches:
                scans[k] = self.projected(k, relative[:, k])
        return scans

    def projected(self, k: int, relative: Float[Array, "realization 12"]) -> PairScan:
        """A scan of the points of pair k, projected again at X_RM (realization, 12)."""
        return project(fixed(self._some[k]), self._pairs[k].reference_face, relative, self._reaches[k])

    def survey(
        self, relative: Float[Array, "realization pair 12"], deviations: Float[Array, "realization contributor"]
    ) -> Seen:
        """What is seen of raw states, for deviations (realization, contributor)."""
        scans = self.scans(relative)
        surveyed = scans if self._method.is_iterated else self._every
        found = [scan.survey(relative[:, k], deviations, self._method.activity) for k, scan in enumerate(surveyed)]
        return Seen(
            scans=scans,
            least=least_gaps(scans, relative, deviations),
            active=np.stack([each.active for each in found], axis=1),
            moments=np.concatenate([self._counted(k, each.moments) for k, each in enumerate(found)], axis=1),
        )

    def _counted(self, k: int, active: np.ndarray) -> np.ndarray:
        """Moments (realization, side, moment) of the points that count in the objective, given those of active points."""
        if self._pairs[k].is_supports:  # they are not among the paper's contact points
            return np.zeros_like(active)
        if not self._method.minimizes.counts_all:
            return active
        every = np.array([table.sum(axis=1) for table in self._every[k].tables]).reshape(active.shape[1:])
        return np.broadcast_to(every, active.shape)

    def may_carry(
        self,
        scans: Sequence[Scan],
        relative: Float[Array, "realization pair 12"],
        deviations: Float[Array, "realization contributor"],
    ) -> list[Bool[Array, "realization _"] | None]:
        """Which points (realization, point) may carry: in the paper's set those that are active in the raw state."""
        if self._method.is_closed:
            return [None for _ in scans]
        return [
            None if pair.is_supports or pair.round else scan.gaps(relative[:, k], deviations) < self._method.activity
            for k, (pair, scan) in enumerate(zip(self._pairs, scans, strict=True))
        ]

    def carriers(self, k: int, state: State) -> Carriers:
        """The points of pair k that carry."""
        loaded, standing, pair = state.loaded[:, self._spans[k]], self._standing[k], self._pairs[k]
        if pair.round:
            of = pair.round.points
            realization, column = np.nonzero(loaded & ~of["cut"].any(axis=1))  # where a wall ends a shaft may go on
            return Carriers(realization, of["centre"][column], of["on_moving"][column], BESIDE * float(of["radius"].max()))
        if standing is None:
            slots = state.slots[self._varying.index(k)]
            realization, column = np.nonzero(loaded & slots.filled)
            places = self._some[k].P_m[slots.points[realization, column]]
        else:
            realization, column = np.nonzero(loaded)
            places = pair.P_m[standing[column]]
        return Carriers(realization, places, np.ones(len(places), dtype=bool), 2 * reach(fixed(self._every[k])))
