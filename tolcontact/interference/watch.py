"""The watch over all bodies of an assembly: which of them interfere, in every realization."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Float, Int
from tolcontact.discretization import Nominal
from tolcontact.interference import kernel
from tolcontact.interference.free_region import CORNERS
from tolcontact.interference.neighbours import Interference, Neighbours
from tolcontact.interference.solid import Solid, curved_triangles, part_solid

# Share of the smallest tolerance range: bodies interfere from this depth on, the diameter of a ball that lies in both of them.
ALLOWED_SHARE = 9 / 10_000
RANGE = 1.0  # mm: replaces the tolerance range if nothing is toleranced
MIN_DEPTH = 1e-7  # mm, and MIN_SHARE of the sizes of both bodies: smaller depths are rounding of poses and vertices
MIN_SHARE = 1e-8
MOTION_FACTOR = 2.0  # times the motion of raw poses: the usual motion of bodies
SHARES = (0.4, 0.6)  # of that depth: inward offsets of the surfaces of both bodies


class Clash(NamedTuple):
    """Realizations with interference between two bodies.

    pair    the indices of the bodies among the parts of the nominal assembly, the smaller one first
    rows    (k,) realizations
    """

    pair: tuple[int, int]
    rows: Int[Array, " k"]


def ordered(first: int, second: int) -> tuple[int, int]:
    """Return the indices of two bodies, the smaller one first."""
    return (first, second) if first < second else (second, first)


def _relative(X_WA: Float[Array, "n 12"], X_WB: Float[Array, "n 12"]) -> Float[Array, "n 12"]:
    """Return X_BA (n, 12) of bodies that rotate and do not stretch, so that no matrix need be inverted."""
    X_BA = np.empty((len(X_WA), pose.ENTRIES))
    kernel.relative(np.ascontiguousarray(X_WA), np.ascontiguousarray(X_WB), X_BA)
    return X_BA


@dataclass(frozen=True, eq=False)
class Watch:
    """The bodies of an assembly that may come near each other.

    nominal   the assembly
    allowed   [mm] by pair of bodies: a depth that does not count as interference yet, if it is larger than usual; infinite if
              any depth is allowed
    poses, deviations   (n, part, 12), (n, contributor): some raw poses; tests are fastest if bodies move about as far
    """

    nominal: Nominal
    allowed: Mapping[tuple[int, int], float]
    poses: Float[Array, "n part 12"]
    deviations: Float[Array, "n contributor"]
    _neighbours: dict[tuple[int, int], Neighbours | None] = field(default_factory=dict, init=False)
    _solids: dict[int, Solid | None] = field(default_factory=dict, init=False)

    def allowing(self, allowed: Mapping[tuple[int, int], float]) -> "Watch":
        """Return the same bodies with other allowed depths."""
        watch = Watch(self.nominal, allowed, self.poses, self.deviations)
        watch._solids.update(self._solids)
        return watch

    def overlap(self, first: int, second: int) -> bool:
        """Return whether two bodies interfere in the nominal assembly, or may, since one of them is not closed."""
        return self.neighbours(ordered(first, second)) is None or self._overlaps(ordered(first, second))

    @cached_property
    def _bounds(self) -> Float[Array, "part 2 3"]:
        """The lower and upper corners of the boxes around the bodies."""
        return np.array([part.body.bounds for part in self.nominal.parts]).reshape(-1, 2, 3)

    @cached_property
    def _distances(self) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of bodies (pair, 2) that may move against each other, and the distances (pair,) [mm] of their boxes."""
        parts = self.nominal.parts
        i, j = np.triu_indices(len(parts), 1)
        stations = np.array([part.station for part in parts])
        moves = np.array(
            [
                bool(part.movers) or len(part.locators) > 0 or part.carried is not None or part.parent is not None
                for part in parts
            ],
            dtype=bool,
        )
        together = (stations[i] == stations[j]) & (moves[i] | moves[j])
        i, j = i[together], j[together]
        lower, upper = self._bounds[:, 0], self._bounds[:, 1]
        apart = np.maximum(np.maximum(lower[i] - upper[j], lower[j] - upper[i]), 0.0)
        return np.stack([i, j], axis=1), np.linalg.norm(apart, axis=1)

    def _motions(self, poses: np.ndarray) -> np.ndarray:
        """Return how far (n, part) [mm] poses (n, part, 12) move any point of each body at most."""
        corners = np.where(CORNERS[None] == 0, self._bounds[:, None, 0], self._bounds[:, None, 1])
        difference = poses - pose.AT_REST
        R, t = difference[..., :9].reshape(*poses.shape[:2], 3, 3), difference[..., 9:]
        moved = np.einsum("npij,pcj->npci", R, corners) + t[:, :, None]
        return np.sqrt((moved**2).sum(axis=3).max(axis=2))

    def _growth(self, deviations: np.ndarray) -> np.ndarray:
        """Return how far (part,) [mm] vertices lie outside of the boxes of the bodies at most."""
        solids = [self.solid(number) for number in range(len(self.nominal.parts))]
        return np.array([0.0 if body is None else body.growth(deviations) for body in solids])

    def neighbours(self, pair: tuple[int, int]) -> Neighbours | None:
        """Return two bodies that are tested; None if one of them is not closed, or they may interfere."""
        if pair not in self._neighbours:
            A, B, depth, neighbours = self.solid(pair[0]), self.solid(pair[1]), self.depth(pair), None
            if A is not None and B is not None and np.isfinite(depth):
                insets = SHARES[0] * depth, SHARES[1] * depth
                neighbours = Neighbours(A, B, insets, self._reach(pair), self._round_faces(pair))
            self._neighbours[pair] = neighbours
        return self._neighbours[pair]

    def _round_faces(self, pair: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Return the numbers (t,) of the pairs of round faces that the triangles of both bodies represent, -1 for none."""
        numbers = [np.full(len(body.faces), -1) for body in map(self.solid, pair) if body is not None]
        for k, points in enumerate(self.nominal.pairs):
            if points.samples_faces or points.reference is None or ordered(points.moving, points.reference) != pair:
                continue
            for part, face in ((points.moving, points.moving_face), (points.reference, points.reference_face)):
                body = self.solid(part)
                assert face is not None and body is not None
                numbers[pair.index(part)][curved_triangles(body, face)] = k
        return numbers[0], numbers[1]

    def solid(self, number: int) -> Solid | None:
        """Return the solid of a part; None if it is not closed."""
        if number not in self._solids:
            self._solids[number] = part_solid(self.nominal, number)
        return self._solids[number]

    @cached_property
    def _usual_motions(self) -> Float[Array, " part"]:
        """How far (part,) [mm] raw poses and deviations move any point of each body at most."""
        is_finite = np.isfinite(self.poses).all(axis=(1, 2))
        return self._motions(self.poses[is_finite]).max(axis=0, initial=0) + self._growth(self.deviations[is_finite])

    def _reach(self, pair: tuple[int, int]) -> float:
        return MOTION_FACTOR * float(self._usual_motions[list(pair)].sum())

    def depth(self, pair: tuple[int, int]) -> float:
        """Return the interference threshold of two bodies, a depth [mm]; infinite if any is allowed, or if one is elastic."""
        if any(self.nominal.parts[number].part.elasticity is not None for number in pair):  # only its contact points bend
            return np.inf
        size = float(np.ptp(self._bounds[list(pair)], axis=1).max())
        return max(self._usual_depth, self.allowed.get(pair, 0.0), MIN_DEPTH, MIN_SHARE * size)

    @cached_property
    def _usual_depth(self) -> float:
        return ALLOWED_SHARE * min(self.nominal.assembly.smallest_zone(), RANGE)

    @property
    def largest_depth(self) -> float:
        """The largest interference threshold [mm] of tested pairs."""
        depths = [self.depth(pair) for pair in self.declared]
        return max([self._usual_depth, MIN_DEPTH, *(depth for depth in depths if np.isfinite(depth))])

    @property
    def open_parts(self) -> tuple[str, ...]:
        """The names of parts that are not closed and so have no inside."""
        numbers = {part.name: number for number, part in enumerate(self.nominal.parts)}
        return tuple(name for name, number in numbers.items() if self.solid(number) is None)

    @property
    def untested_pairs(self) -> tuple[str, ...]:
        """The names of contact pairs whose bodies may interfere, since they are compliant or have form deviations."""
        pairs = [pair for pair in self.nominal.pairs if pair.reference is not None and pair.may_interfere]
        return tuple(dict.fromkeys(pair.name for pair in pairs))

    @property
    def round_pairs(self) -> tuple[str, ...]:
        """The names of contact pairs of round faces: their gaps are exact, and their triangles are not compared."""
        pairs = [pair for pair in self.nominal.pairs if pair.reference is not None and not pair.samples_faces]
        return tuple(dict.fromkeys(pair.name for pair in pairs if not pair.may_interfere))

    @cached_property
    def overlapping(self) -> frozenset[tuple[int, int]]:
        """Pairs of bodies that interfere in the nominal assembly."""
        return frozenset(pair for pair in self._near(np.zeros(len(self.nominal.parts))) if self._overlaps(pair))

    @property
    def overlapping_parts(self) -> tuple[str, ...]:
        """The names of parts that interfere in the nominal assembly, as "(part, part)"."""
        parts = self.nominal.parts
        return tuple(dict.fromkeys(f"({parts[i].name}, {parts[j].name})" for i, j in sorted(self.overlapping)))

    def _overlaps(self, pair: tuple[int, int]) -> bool:
        neighbours = self.neighbours(pair)
        nominal = np.zeros((1, len(self.nominal.contributors)))
        return neighbours is not None and bool(neighbours.interfere(pose.AT_REST[None], nominal)[0])

    @cached_property
    def declared(self) -> frozenset[tuple[int, int]]:
        """Pairs of bodies whose contact is declared."""
        pairs = self.nominal.pairs
        return frozenset(ordered(pair.moving, pair.reference) for pair in pairs if pair.reference is not None)

    def _near(self, motions: Float[Array, " part"]) -> Iterator[tuple[int, int]]:
        """Yield pairs of bodies that may touch if they move by no more than `motions` (part,) [mm]."""
        pairs, distances = self._distances
        for i, j in pairs[distances <= motions[pairs].sum(axis=1)]:
            yield int(i), int(j)

    def clashes(
        self,
        poses: Float[Array, "n part 12"],
        deviations: Float[Array, "n contributor"],
        left_out: Collection[tuple[int, int]] = (),
        among: Collection[tuple[int, int]] | None = None,
    ) -> Iterator[Clash]:
        """Yield the pairs of bodies that interfere at poses (n, part, 12), for deviations (n, contributor).

        Pairs of indices in `left_out` are not tested, nor are pairs that are not in `among`, if it is given.
        """
        is_finite = np.isfinite(poses).all(axis=(1, 2))
        reach = self._motions(poses[is_finite]).max(axis=0, initial=0) + self._growth(deviations[is_finite])
        for pair in self._near(reach):
            is_left_out = pair in left_out or (among is not None and pair not in among)
            neighbours = None if is_left_out else self.neighbours(pair)
            if neighbours is not None:
                X_BA = _relative(poses[:, pair[0]], poses[:, pair[1]])
                rows = np.flatnonzero(neighbours.interfere(X_BA, deviations) & is_finite)
                if rows.size:
                    yield Clash(pair, rows)

    def measured(
        self, clash: Clash, poses: Float[Array, "n part 12"], deviations: Float[Array, "n contributor"]
    ) -> Interference:
        """Return the penetration of two bodies in the realizations of a clash."""
        neighbours = self.neighbours(clash.pair)
        assert neighbours is not None
        i, j = clash.pair
        return neighbours.measured(_relative(poses[clash.rows, i], poses[clash.rows, j]), deviations[clash.rows])
