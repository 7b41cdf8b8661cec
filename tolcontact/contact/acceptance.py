"""Acceptance limits: far from the raw pose, an answer may satisfy half-space constraints where there is no face.

Contact constraints keep points on one side of planes, which represent the reference face while the parts stay near. Further
away, a plane may support a point beyond the rim of the face, or a part may have flipped into another pose that locators allow.
"""

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float
from tolcontact.compilation import Program
from tolcontact.contact.candidates import Candidates
from tolcontact.contact.state import State, Task
from tolcontact.discretization import ContactPoints
from tolcontact.interference.watch import ALLOWED_SHARE
from tolcontact.mechanics import Group

# Locators, clearances and tolerances rotate a part by far less than a radian: an answer that far from its raw pose is another
# pose, which planes without end or locators allow. A travel by half a part may lead to faces where no contact points are.
MAX_TURN = 1.0  # rad: an answer that rotates a part by more, from its raw pose, is doubtful
MAX_TRAVEL_SIZES = 0.5  # sizes of the largest part: if contact points moved further, the faces themselves are compared
ADRIFT_SIZES = 10  # a part that travelled further, in sizes, has nothing to rest on
TURN_FACTOR = 2  # times the rotation that lifts the end of a face by the distance that contact may push
LOST_SIZES = 1e5  # no step brings a part back from further away
# Accepted penetration of faces, in addition to the facet error of their triangles: the smaller of these two.
DEPTH_SIZES = 1e-4  # sizes of the parts
DEPTH_SHARE = 0.01  # of the smallest tolerance range


class AcceptanceLimits:
    """The limits for one group of parts: a part may rotate by `max_turn` [rad] from its raw pose before it is doubtful."""

    def __init__(self, program: Program, group: Group, candidates: Candidates, max_turn: float = MAX_TURN) -> None:
        nominal, method = program.nominal, program.method
        self._nominal, self._pairs, self._candidates = nominal, group.pairs, candidates
        self._group_pairs = [search.pair for search in candidates.pairs]
        self._presses = method.minimizes.presses
        self._size = max(float(nominal.parts[part].mesh.scale) for part in group.parts)  # of the largest part
        self._max_turn = 8 * np.sin(max_turn / 2) ** 2  # |R - S|^2 of rotations that far apart
        self._movers = [k for k, mobility in enumerate(group.mobilities) if mobility.movers]
        self._max_depth = min(DEPTH_SIZES * self._size, DEPTH_SHARE * nominal.assembly.smallest_zone())
        self._allowed_in_form = ALLOWED_SHARE * nominal.assembly.smallest_zone()
        self._polyhedra = [k for k, pair in enumerate(self._group_pairs) if method.is_bounded and _is_polyhedron(pair)]
        self._round = {k: (self._group_pairs[k].curvature, *_ball(self._group_pairs[k].P_m)) for k in candidates.curved}
        self._balls = [(side.part, *_ball(side.points)) for side in group.sides]

    def is_near(self, task: Task, state: State) -> Bool[Array, " n"]:
        """Return whether no part has rotated, and no contact point travelled, too far (n,)."""
        return ~self._is_turned(task, state) & ~self._is_far(task, state)

    def have_drifted(self, task: Task, state: State, sizes: float) -> Bool[Array, " n"]:
        """Return whether forces pulled a part further away than a number of sizes of the largest part (n,)."""
        if not self._presses:
            return np.zeros(len(task), dtype=bool)
        return self.displacement(task.raw, state.poses) / self._size > sizes

    def is_doubtful(self, task: Task, state: State) -> Bool[Array, " n"]:
        """Return whether an answer remains doubtful once the faces themselves are checked (n,).

        It does if a part rotated too far, also compared with its tolerances: without forces, contact has no reason to rotate a
        part by more than the depth of its gaps over the size of its face. If parts only travelled, perhaps so far that contact
        points were missed, the faces must not penetrate each other, and the active points must lie on them.
        """
        doubtful, far = self._is_turned(task, state), self._is_far(task, state)
        for k, search in self._candidates.bounded.items():
            if not self._presses:
                doubtful |= pose.turn(state.relative[:, k], task.relative[:, k]) > TURN_FACTOR * search.meeting.turn
            far |= ~search.meeting.reaches(state.relative[:, k])
        rows = np.flatnonzero(far & ~doubtful & state.solved & ~state.in_conflict)
        travelled = state.take(rows)
        for k, index in enumerate(self._pairs):
            faces, X_RM = self._nominal.face_pair(index) if rows.size else None, travelled.relative[:, k]
            if faces is None:
                continue
            carriers = self._candidates.carriers(k, travelled)
            for side, motion, points in (
                (faces.reference, X_RM, carriers.on_moving),
                (faces.moving, pose.inverse(X_RM), ~carriers.on_moving),
            ):
                realization = carriers.realization[points]
                overhang = side.face.overhang(pose.apply(motion[realization], carriers.places[points, None])[:, 0])
                doubtful[rows[realization[overhang > carriers.spacing]]] = True
            if not self._group_pairs[k].is_springy:  # compliant faces penetrate each other
                doubtful[rows] |= self._depth(k, X_RM, task.deviations[rows]) > self.allowed(k)
        return doubtful

    def _depth(self, k: int, X_RM: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        """Return how deep the faces of pair k of the group penetrate each other (n,) [mm]; 0 for locators, without faces."""
        pair, faces = self._group_pairs[k], self._nominal.face_pair(self._pairs[k])
        return np.zeros(len(X_RM)) if faces is None else faces.depth(X_RM, pair.heights(deviations), pair.form(deviations))

    def lie_in_form(self, task: Task, state: State) -> Bool[Array, " n"]:
        """Return whether faces with form interfere in a certified answer (n,), where no search finds the deepest place.

        These are polyhedra on a plane with form. The faces are compared at many points.
        """
        found, rows = np.zeros(len(state), dtype=bool), np.flatnonzero(state.certified)
        for k in self._polyhedra if rows.size else ():
            found[rows] |= self._depth(k, state.relative[rows, k], task.deviations[rows]) > self._allowed_in_form
        return found

    def _is_turned(self, task: Task, state: State) -> Bool[Array, " n"]:
        """Return whether a part rotated too far from its raw pose (n,)."""
        difference = state.poses[:, self._movers, :9] - task.raw[:, self._movers, :9]
        return ((difference**2).sum(axis=2) > self._max_turn).any(axis=1)

    def _is_far(self, task: Task, state: State) -> Bool[Array, " n"]:
        """Return whether a contact point may be too far from its raw place (n,)."""
        return self.displacement(task.raw, state.poses) > MAX_TRAVEL_SIZES * self._size

    def allowed(self, k: int) -> float:
        """Return the penetration [mm] of the faces of pair k of the group that an answer may have and not be doubtful."""
        return self._max_depth + self._group_pairs[k].facets

    def have_rolled(self, task: Task, state: State) -> Bool[Array, " n"]:
        """Return whether contact points slid along tangent planes into a curved face (n,), further than `allowed`.

        A tangent plane departs from a curved face by curvature times half the square of the distance from its contact point.
        Where this may be too far, the points are projected again.
        """
        found = np.zeros(len(state), dtype=bool)
        for k, (curvature, centre, radius) in self._round.items():
            slid = _displacement(state.relative[:, k] - pose.AT_REST, centre, radius)
            rows = np.flatnonzero(curvature * slid**2 / 2 > self.allowed(k))
            if rows.size:
                X_RM = state.relative[rows, k]
                depth = -self._candidates.pairs[k].projected(X_RM).min_gap(X_RM, task.deviations[rows])
                found[rows] |= depth > self.allowed(k)
        return found

    def displacement(self, start: Float[Array, "n part 12"], end: Float[Array, "n part 12"]) -> Float[Array, " n"]:
        """Return a bound of how far contact points move (n,) [mm] between two poses (n, part of the group, 12).

        It is the displacement of the centre of a ball around the points, and the ball's radius times the rotation.
        """
        bound = np.zeros(len(start))
        for part, centre, radius in self._balls:
            bound = np.maximum(bound, _displacement(end[:, part] - start[:, part], centre, radius))
        return bound


def _is_polyhedron(pair: ContactPoints) -> bool:
    """Return whether a pair with form has flat facets, and no search for the deepest place between contact points."""
    faces = pair.moving_face, pair.reference_face
    is_flat = all(face is not None and face.curvature == 0 for face in faces)
    return pair.has_form and pair.minima is None and not pair.is_springy and is_flat


def _displacement(difference: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
    """Return a bound of how far points of a ball move (n,) [mm], for differences of two poses (n, 12)."""
    turn = np.sqrt((difference[:, :9] ** 2).sum(axis=1))
    return np.linalg.norm(pose.apply(difference, centre)[:, 0], axis=1) + radius * turn


def _ball(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Return centre (1, 3) and radius [mm] of a ball around points (point, 3)."""
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return centre[None], float(np.linalg.norm(points - centre, axis=1).max())
