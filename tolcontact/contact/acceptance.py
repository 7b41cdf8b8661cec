"""Doubt: an answer far from the raw pose may obey half-spaces that no face fills there.

Contact points are kept on one side of planes, which represent the reference face as long as the parts stay near. Farther away
a point may be held by a plane beside the face, or a part may have turned over into another pose that locators allow.
"""

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float
from tolcontact.contact.candidates import Candidates
from tolcontact.contact.state import State, Task
from tolcontact.discretization import Nominal
from tolcontact.mechanics import Group, curved_pairs
from tolcontact.method import Method

ADRIFT = 10  # sizes of the parts: one that came so far has found nothing to rest on
LOST = 1e5  # sizes of the parts: no step will bring it back
INSIDE = 1e-4  # sizes of the parts, and
SHARE = 0.01  # of the smallest tolerance range: what faces may lie in each other, beside what their triangles leave open


class Doubt:
    """The limits of a method for one group of parts, the largest of which has a certain `size` [mm]."""

    def __init__(self, nominal: Nominal, group: Group, method: Method, size: float) -> None:
        self._nominal, self._pairs = nominal, group.pairs
        self._presses = method.minimizes.presses
        self._size, self._farthest = size, method.near_travel * size
        self._turned_far = 8 * np.sin(method.near_turn / 2) ** 2  # |R - S|^2 of rotations that far apart
        self._movers = [k for k, carried in enumerate(group.carried) if carried.movers]
        self._group_pairs = [nominal.pairs[index] for index in group.pairs]
        self._open = min(INSIDE * size, SHARE * nominal.assembly.finest())
        self._round = {}
        for k in curved_pairs(nominal, group):
            surface, points = self._group_pairs[k].reference_face, self._group_pairs[k].P_m
            self._round[k] = (surface.curvature if surface is not None else 0.0, *_ball(points))
        self._balls = [(side.part, *_ball(side.points)) for side in group.sides]

    def is_near(self, task: Task, state: State) -> Bool[Array, " n"]:
        """(n,): whether no part has turned, and no contact point travelled, farther than the method's limits."""
        return np.asarray(~self._turned(task, state) & ~self._is_far(task, state))

    def is_lost(self, task: Task, state: State) -> Bool[Array, " n"]:
        """(n,): whether forces pulled a part so far away that no step will bring it back."""
        return self._has_drifted(task, state, LOST)

    def is_adrift(self, task: Task, state: State) -> Bool[Array, " n"]:
        """(n,): whether forces found nothing for a part to rest on."""
        return self._has_drifted(task, state, ADRIFT)

    def _has_drifted(self, task: Task, state: State, sizes: float) -> np.ndarray:
        if not self._presses:
            return np.zeros(len(task), dtype=bool)
        return np.asarray(self.displacement(task.raw, state.poses) / self._size > sizes)

    def remains(self, task: Task, state: State, candidates: Candidates) -> Bool[Array, " n"]:
        """(n,): whether the doubt remains once the faces themselves were looked at.

        It does if a part turned too far. If it only travelled, the faces must be free of penetration, and hold the points
        that carry.
        """
        doubtful = self._turned(task, state)
        far = np.flatnonzero(self._is_far(task, state) & ~doubtful & state.solved & ~state.in_conflict)
        travelled = state.take(far)
        for k, index in enumerate(self._pairs):
            faces, X_RM = self._nominal.face_pair(index) if far.size else None, travelled.relative[:, k]
            if faces is not None:
                carriers = candidates.carriers(k, travelled)
                for side, motion, some in (
                    (faces.reference, X_RM, carriers.on_moving),
                    (faces.moving, pose.inverse(X_RM), ~carriers.on_moving),
                ):
                    own = carriers.realization[some]
                    beside = side.face.overhang(pose.apply(motion[own], carriers.places[some, None])[:, 0])
                    doubtful[far[own[beside > carriers.spacing]]] = True
                heights = self._group_pairs[k].heights(task.deviations[far])
                doubtful[far] |= faces.depth(X_RM, heights) > self.allowed(k)
        return doubtful

    def _turned(self, task: Task, state: State) -> Bool[Array, " n"]:
        """(n,): whether a part turned too far from its raw pose."""
        apart = state.poses[:, self._movers, :9] - task.raw[:, self._movers, :9]
        return np.asarray(((apart**2).sum(axis=2) > self._turned_far).any(axis=1))

    def _is_far(self, task: Task, state: State) -> Bool[Array, " n"]:
        """(n,): whether a contact point may be too far from its raw place."""
        return np.asarray(self.displacement(task.raw, state.poses) > self._farthest)

    def allowed(self, k: int) -> float:
        """How deep [mm] the faces of pair k of the group may lie in each other before an answer is doubted."""
        return self._open + self._group_pairs[k].facets

    def rolled(self, k: int, state: State) -> Bool[Array, " n"]:
        """(n,): whether points may have slid around the reference face of pair k until their planes are not its own.

        Beside its foot a plane leaves a curved face by the curvature times half the square of the distance.
        """
        curvature, centre, radius = self._round[k]
        slid = _displacement(state.relative[:, k] - pose.AT_REST, centre, radius)
        return np.asarray(curvature * slid**2 / 2 > self.allowed(k))

    def displacement(self, before: Float[Array, "n part 12"], after: Float[Array, "n part 12"]) -> Float[Array, " n"]:
        """What no contact point moves farther than (n,) [mm] between two poses (n, part of the group, 12).

        That of the centre of a ball around the points, and the ball's radius times the turn.
        """
        most = np.zeros(len(before))
        for part, centre, radius in self._balls:
            most = np.maximum(most, _displacement(after[:, part] - before[:, part], centre, radius))
        return most


def _displacement(apart: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
    """What no point of a ball moves farther than (n,) [mm], for differences of two poses (n, 12)."""
    turn = np.sqrt((apart[:, :9] ** 2).sum(axis=1))
    return np.asarray(np.linalg.norm(pose.apply(apart, centre)[:, 0], axis=1) + radius * turn)


def _ball(points: np.ndarray) -> tuple[np.ndarray, float]:
    """Centre (1, 3) and radius [mm] of a ball around points (point, 3)."""
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    return centre[None], float(np.linalg.norm(points - centre, axis=1).max())
