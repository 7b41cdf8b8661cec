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
        return np.add(*(self.at_face(k, row, places) for k, places in enumerate((P_m, P_r))))

    def at_face(self, k: int, row: Int[Array, " k"], places: Float[Array, "k 3"]) -> Float[Array, " k"]:
        """Return the heights (k,) [mm] of one face at its `places` (k, 3), each of its own row; face 0 is the moving one."""
        face = self.deviating[k]
        if face is None or face.form is None:
            return np.zeros(len(row))
        return face.form.sums(places, row, self.deviations[:, face.form_columns])

    def highest(self) -> Float[Array, "face row"]:
        """Return bounds [mm] of the heights of the moving and the reference face, from the heights at many places of each."""
        bounds = np.zeros((2, len(self.deviations)))
        for k, face in enumerate(self.deviating):
            if face is not None and face.form is not None:
                heights = self.deviations[:, face.form_columns] @ face.form.place_heights
                bounds[k] = heights.max(axis=1) + MARGIN_SHARE * np.ptp(heights, axis=1)
        return bounds
