"""Doubt: an answer far from the raw pose may obey half-spaces that no face fills there.

Contact points are kept on one side of planes, which stand for the reference face as long as the parts stay near. Farther away
a point may be held by a plane beside the face, or a part may have turned over into another pose that locators allow.
"""

from collections.abc import Callable

import numpy as np

from tolcontact import poses as pose
from tolcontact.discretization import Nominal
from tolcontact.method import Method
from tolcontact.simulation.resolution import State, Task
from tolcontact.symbolic import Group

Carriers = Callable[[np.ndarray, int], tuple[np.ndarray, np.ndarray, float]]
INSIDE = 1e-4  # sizes of the parts: what the faces of a far answer may lie in each other, being triangles


class Doubt:
    """The limits of a method for one group of parts, the largest of which has a certain `size` [mm]."""

    def __init__(self, nominal: Nominal, group: Group, method: Method, size: float) -> None:
        self._nominal, self._pairs = nominal, group.pairs
        self._method, self._size = method, size
        self._movers = [k for k, carried in enumerate(group.carried) if carried.movers]
        self._corners = [(side.part, _corners(side.points)) for side in group.sides]

    def is_near(self, task: Task, state: State) -> np.ndarray:
        """(row,): whether no part has turned, and no contact point travelled, farther than the method's limits."""
        return np.asarray(~(self._turns(task, state) > self._method.near_turn) & ~self._travels(task, state))

    def remains(self, task: Task, state: State, carriers: Carriers) -> np.ndarray:
        """(row,): whether the doubt remains once the faces themselves were looked at.

        It does where a part turned too far. Where it only travelled, the faces must be free of penetration, and hold the
        points that carry: `carriers` gives those of some rows and a pair, which row each belongs to and where it is nominally
        (point, 3), and the usual distance of contact points.
        """
        turned = self._turns(task, state) > self._method.near_turn
        doubtful = turned.copy()
        rows = np.flatnonzero(self._travels(task, state) & ~turned & state.solved & ~state.in_conflict)
        for k, index in enumerate(self._pairs):
            faces, X_RM = self._nominal.face_pair(index) if rows.size else None, state.relative[rows, k]
            if faces is not None:
                row, points, spacing = carriers(rows, k)
                beside = faces.reference.face.overhang(pose.apply(X_RM[row], points[:, None])[:, 0])
                doubtful[rows[row[beside > spacing]]] = True
                doubtful[rows] |= faces.depth(X_RM) > INSIDE * self._size
        return doubtful

    def _turns(self, task: Task, state: State) -> np.ndarray:
        """Largest turn (row,) [rad] of a part from its raw pose."""
        if not self._movers:
            return np.zeros(len(task.raw))
        return np.asarray(pose.turn(task.raw[:, self._movers], state.poses[:, self._movers]).max(axis=1))

    def _travels(self, task: Task, state: State) -> np.ndarray:
        """(row,): whether a contact point is farther from its raw place than the limit; seen at the corners around them."""
        apart = state.poses - task.raw
        far = np.zeros(len(apart))
        for part, corners in self._corners:
            moved = pose.apply(apart[:, part], corners)
            far = np.maximum(far, (moved**2).sum(axis=2).max(axis=1))
        return np.asarray(far > (self._method.near_travel * self._size) ** 2)


def _corners(points: np.ndarray) -> np.ndarray:
    """Corners (8, 3) of the box around points (point, 3)."""
    limits = points.min(axis=0), points.max(axis=0)
    return np.array([[limits[i][0], limits[j][1], limits[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
