"""Heights of the faces of a pair: at its contact points, linear in the deviations, and of form at any point."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.features import FaceDeviation

MARGIN_SHARE = 0.05  # of the range of heights at many points: how much higher others may be


@dataclass(frozen=True, eq=False)
class Offsets:
    """Heights of the contact points of a pair along n^r, linear in the deviations. Gaps are smaller by these heights.

    columns   (contributor,): columns of the deviations
    matrix    (contributor, point): height of each point per unit deviation
    """

    columns: np.ndarray
    matrix: np.ndarray

    @classmethod
    def joined(cls, terms: "Sequence[Offsets]", points: int) -> "Offsets":
        """Return the sum of offsets of the same points; without terms, heights do not vary."""
        columns = np.unique(np.concatenate([np.zeros(0, dtype=int), *(term.columns for term in terms)]))
        matrix = np.zeros((len(columns), points))
        for term in terms:
            matrix[np.searchsorted(columns, term.columns)] += term.matrix
        return cls(columns, matrix)

    def take(self, points: np.ndarray) -> "Offsets":
        """Return the offsets of some points."""
        return Offsets(self.columns, self.matrix[:, points])

    def heights(self, deviations: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return heights (row, slot) [mm] of `points` (row, slot) for deviations (row, column), summed up in a fixed order."""
        heights = np.zeros(points.shape)
        for column, row in zip(self.columns, self.matrix, strict=True):
            heights += deviations[:, column, None] * row[points]
        return heights


@dataclass(frozen=True, eq=False)
class PairForm:
    """Heights of the forms of a moving and a reference plane that face each other, for deviations (row, contributor)."""

    deviating: Sequence[FaceDeviation | None]
    deviations: Float[Array, "row contributor"]

    def take(self, rows: slice | np.ndarray) -> "PairForm":
        """Return the forms of some rows."""
        return PairForm(self.deviating, self.deviations[rows])

    def at(self, row: Int[Array, " k"], P_m: Float[Array, "k 3"], P_r: Float[Array, "k 3"]) -> Float[Array, " k"]:
        """Return the sum of both heights (k,) [mm] at points P_m, P_r (k, 3) of the nominal faces, each of its own row (k,)."""
        return np.add(*(self.at_face(k, row, places) for k, places in enumerate((P_m, P_r))))

    def at_face(self, k: int, row: Int[Array, " k"], places: Float[Array, "k 3"]) -> Float[Array, " k"]:
        """Return the heights (k,) [mm] of one face at points `places` (k, 3), each of its own row; face 0 is the moving one."""
        face = self.deviating[k]
        if face is None or face.form is None:
            return np.zeros(len(row))
        return face.form.sums(places, row, self.deviations[:, face.form_columns])

    def highest(self) -> Float[Array, "face row"]:
        """Return bounds [mm] of the heights of the moving and the reference face, from the heights at many points of each."""
        bounds = np.zeros((2, len(self.deviations)))
        for k, face in enumerate(self.deviating):
            if face is not None and face.form is not None:
                heights = self.deviations[:, face.form_columns] @ face.form.place_heights
                bounds[k] = heights.max(axis=1) + MARGIN_SHARE * np.ptp(heights, axis=1)
        return bounds
