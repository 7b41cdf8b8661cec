"""Points that follow from every pose and always have a row of the QP: nothing is searched."""

from collections.abc import Sequence

import numpy as np

from tolcontact.compilation import Program
from tolcontact.contact.fixed_search import Carriers, FixedSearch, Search
from tolcontact.contact.scan import Scan
from tolcontact.contact.slots import Slots
from tolcontact.discretization import FollowingContact
from tolcontact.mechanics import MOMENTS

STEP = 1e-6  # mm, for finite differences of the gaps


class StandingSearch(FixedSearch, Scan):
    """The points of a pair whose gaps are a function of the pose. It is its own scan, at any pose."""

    pair: FollowingContact

    def __init__(self, program: Program, index: int, tables: Sequence[np.ndarray] = ()) -> None:
        super().__init__(program, index, tables)
        self._at = program.gaps[index]

    def gaps(self, X_RM: np.ndarray, deviations: np.ndarray, points: np.ndarray | None = None) -> np.ndarray:
        gaps = self._at(X_RM=X_RM, deviations=deviations)["gaps"]
        return np.asarray(gaps if points is None else gaps[:, points])

    def touching_counts(self, X_RM: np.ndarray, deviations: np.ndarray, limit: float) -> np.ndarray:
        return np.asarray((self._at(X_RM=X_RM, deviations=deviations)["distances"] < limit).sum(axis=0))

    def touching(self, X_RM: np.ndarray, deviations: np.ndarray, nearness: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the points that touch; normals are the derivatives of gaps by translation."""
        shifts = STEP * np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])
        X = np.repeat(X_RM, len(shifts), axis=0)
        X[:, -3:] += shifts
        distances = self._at(X_RM=X, deviations=np.repeat(deviations, len(shifts), axis=0))["distances"]
        is_near = distances[0] < nearness
        normals = ((distances[1:4] - distances[4:]) / (2 * STEP)).T[is_near]
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        return self.pair.touching(X_RM[0], is_near, normals), normals

    def scan(self, X_RM: np.ndarray, deviations: np.ndarray, search: Search, former: Scan | None, slots: Slots | None) -> Scan:
        return self

    def raw_active(self, X_RM: np.ndarray, deviations: np.ndarray, activity: float) -> None:
        return None

    def carriers(self, loaded: np.ndarray, points: np.ndarray | Slots) -> Carriers:
        places, on_moving, may_not_overhang, overhang = self.pair.ends()
        realization, column = np.nonzero(loaded & may_not_overhang)
        return Carriers(realization, places[column], on_moving[column], overhang)

    def min_gap(self, relative: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        return np.asarray(self.gaps(relative, deviations).min(axis=1))

    def survey(self, X_RM: np.ndarray, deviations: np.ndarray, activity: float) -> tuple[np.ndarray, np.ndarray]:
        active = self.gaps(X_RM, deviations) < activity
        sums = [[np.where(active, row, 0.0).sum(axis=1) for row in table] for table in self._tables]
        moments = np.array(sums).transpose(2, 0, 1) if sums else np.empty((len(active), 0, MOMENTS))
        return active.sum(axis=1), moments
