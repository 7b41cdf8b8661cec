"""Locators with numbers, and the locator matrix: what six of them, or more, say about the pose of their part."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tolcontact.declaration import Tolerance
from tolcontact.errors import GeometryFault
from tolcontact.features import FaceDeviation

CONDITION_LIMIT = 1e8


@dataclass(frozen=True, eq=False)
class Locators:
    """Locators of a part, or of a model, in the nominal assembly frame.

    labels       "part.locator" for each
    points       (locator, 3) [mm]
    directions   (locator, 3): unit vectors into the part
    tolerances   one for each
    stiffness    (locator,) [N/mm]
    one_sided    (locator,) bool: supports that the part may lift off
    faces        of the features that they stand against, one for each; None of one that stands against a nominal face
    floating     middle (3,) and size [mm] of a part that they leave freedoms; None of one that they fix
    """

    labels: tuple[str, ...]
    points: np.ndarray
    directions: np.ndarray
    tolerances: tuple[Tolerance, ...]
    stiffness: np.ndarray
    one_sided: np.ndarray
    faces: tuple[FaceDeviation | None, ...]
    floating: tuple[np.ndarray, float] | None = None

    def __len__(self) -> int:
        return len(self.labels)

    @classmethod
    def joined(cls, several: Iterable["Locators"]) -> "Locators":
        """Those of several parts, one after the other."""
        every = tuple(several)
        return cls(
            labels=tuple(label for own in every for label in own.labels),
            points=np.vstack([own.points for own in every]),
            directions=np.vstack([own.directions for own in every]),
            tolerances=tuple(tolerance for own in every for tolerance in own.tolerances),
            stiffness=np.concatenate([own.stiffness for own in every]),
            one_sided=np.concatenate([own.one_sided for own in every]),
            faces=tuple(face for own in every for face in own.faces),
        )

    def pushes(self, locator: int) -> tuple[np.ndarray, np.ndarray]:
        """Columns (k,) of the deviations by which the face at a locator comes out of its part there, and how far for 1 (k,)."""
        face = self.faces[locator]
        if face is None:
            return np.zeros(0, dtype=int), np.zeros(0)
        return face.columns, face.outward(self.points[locator, None], -self.directions[locator, None])[0]

    @property
    def matrix(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows [n', (p - c) x n)'] of the locator matrix J (locator, 6), and the centroid c (3,) that they turn about."""
        centre = self.points.mean(axis=0) if self.floating is None else self.floating[0]
        return np.hstack([self.directions, np.cross(self.points - centre, self.directions)]), centre

    @property
    def placing_matrix(self) -> tuple[np.ndarray, np.ndarray]:
        """The matrix M (6, locator) of q = M d, and the centroid c (3,) about which the part turns.

        Where they leave freedoms the part moves as little as it can. Six locators give M = J^-1. Of more than six the
        two-sided ones are kept exactly, and the one-sided ones as well as it goes, in the sense of least squares.
        """
        J, centre = self.matrix
        if self.floating is not None:
            return self._least_motion(J, self.floating[1]), centre
        if len(J) == 6:
            return np.linalg.inv(J), centre
        exact, supports = J[~self.one_sided], J[self.one_sided]
        kkt = np.block([[supports.T @ supports, exact.T], [exact, np.zeros((len(exact), len(exact)))]])
        M = np.zeros((6, len(J)))
        inverse = np.linalg.inv(kkt)[:6]
        M[:, self.one_sided], M[:, ~self.one_sided] = inverse[:, :6] @ supports.T, inverse[:, 6:]
        return M, centre

    def _least_motion(self, J: np.ndarray, size: float) -> np.ndarray:
        """M (6, locator) of the least motion that keeps two-sided locators exactly, and one-sided ones as well as it goes.

        Motions count as translations, and rotations [rad] times the part's `size` [mm].
        """
        to_q = np.diag([1.0] * 3 + [1 / size] * 3)
        exact, supports = (J @ to_q)[~self.one_sided], (J @ to_q)[self.one_sided]
        M = np.zeros((6, len(J)))
        M[:, ~self.one_sided] = np.linalg.pinv(exact)
        open_ = np.linalg.svd(exact)[2][len(exact) :].T
        back = open_ @ np.linalg.pinv(supports @ open_, rcond=1 / CONDITION_LIMIT)
        M[:, ~self.one_sided] -= back @ supports @ M[:, ~self.one_sided]
        M[:, self.one_sided] = back
        return np.asarray(to_q @ M)

    def _contradicting(self, J: np.ndarray) -> str:
        """Names of two-sided locators that hold the same, by rows (locator, 6) of theirs; none if all are independent."""
        U, S, _ = np.linalg.svd(J)
        if not len(J) or S[-1] * CONDITION_LIMIT > S[0]:
            return ""
        share = np.abs(U[:, len(S) - 1])
        names = np.array(self.labels)[~self.one_sided]
        return ", ".join(str(name) for name in names[share > 1e-6 * share.max()])

    def check_independent(self) -> None:
        """Raise GeometryFault if they do not fix their part, or if those of a floating part contradict each other."""
        J, centre = self.matrix
        if self.floating is not None:
            scaled = J / np.array([1, 1, 1, *[self.floating[1]] * 3])
            if names := self._contradicting(scaled[~self.one_sided]):
                raise GeometryFault(f"it is over-constrained: locators {names} hold the same; leave one of them out")
            return
        size = np.sqrt(((self.points - centre) ** 2).sum(axis=1).mean())
        scaled = J / np.array([1, 1, 1, size, size, size]) if size > 0 else np.zeros_like(J)
        two_sided = scaled[~self.one_sided]
        condition = max(np.linalg.cond(scaled), np.linalg.cond(two_sided) if len(two_sided) else 0.0)
        if not condition < CONDITION_LIMIT:
            names = self._contradicting(two_sided)
            held = f"{names} hold the same, so they contradict each other and leave a direction free; " if names else ""
            raise GeometryFault(
                f"its {len(J)} locators do not fix it: {held}the locator matrix has condition number {condition:.1e}, the "
                f"limit is {CONDITION_LIMIT:.0e}; the points of the primary face must not lie on a line, and the directions "
                "together must constrain all three translations and all three rotations"
            )
