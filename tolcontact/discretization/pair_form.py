"""The forms of the two faces of a contact pair, at any of their places."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.features import FaceDeviation

MARGIN_SHARE = 0.05  # of the range of heights at many places: what others may stand higher


@dataclass(frozen=True, eq=False)
class PairForm:
    """Heights of the forms of a moving and a reference plane that face each other, for deviations (row, contributor)."""

    deviating: Sequence[FaceDeviation | None]
    deviations: Float[Array, "row contributor"]

    def take(self, rows: slice | np.ndarray) -> "PairForm":
        """Return the forms of some rows."""
        return PairForm(self.deviating, self.deviations[rows])

    def at(self, row: Int[Array, " k"], P_m: Float[Array, "k 3"], P_r: Float[Array, "k 3"]) -> Float[Array, " k"]:
        """Return the sum of both heights (k,) [mm] at places P_m, P_r (k, 3) of the nominal faces, each of its own row (k,)."""
        heights = np.zeros(len(row))
        for face, places in zip(self.deviating, (P_m, P_r), strict=True):
            if face is not None and face.form is not None:
                heights += face.form.sums(places, row, self.deviations[:, face.form_columns])
        return heights

    def bounds(self) -> Float[Array, " row"]:
        """Return bounds (row,) [mm] of the sums of both heights, up or down: those of all modes at their highest places."""
        bound = np.zeros(len(self.deviations))
        for face in self.deviating:
            if face is not None and face.form is not None:
                for column, mode in zip(face.form_columns, face.form.place_heights, strict=True):
                    bound += (1 + MARGIN_SHARE) * np.abs(mode).max() * np.abs(self.deviations[:, column])
        return bound

    def highest(self) -> Float[Array, " row"]:
        """Return a bound (row,) [mm] of the sums of both heights, from the heights at many places of each face."""
        bound = np.zeros(len(self.deviations))
        for face in self.deviating:
            if face is not None and face.form is not None:
                heights = self.deviations[:, face.form_columns] @ face.form.place_heights
                bound += heights.max(axis=1) + MARGIN_SHARE * np.ptp(heights, axis=1)
        return bound
