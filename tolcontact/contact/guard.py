"""Guards of pairs whose bodies end: they see that bodies lie in each other where the list of places shows nothing."""

from dataclasses import dataclass

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float
from tolcontact.compilation import Program
from tolcontact.interference import Neighbours, WayOut, ordered

GUARD = 1 << 41  # label of the place that a guard adds


@dataclass(frozen=True, eq=False)
class Guard:
    """The bodies of a pair as the search moves them: as a whole, with the face that touches.

    is_swapped   whether the moving body is the second one of the neighbours
    """

    neighbours: Neighbours
    is_swapped: bool

    @classmethod
    def of(cls, program: Program, index: int) -> "Guard | None":
        """Return the guard of a pair; None if its bodies may lie in each other, have no inside, or grow where they touch."""
        pair = program.nominal.pairs[index]
        assert pair.reference is not None
        if any(face is not None and face.grows for face in pair.deviating):
            return None
        bodies = ordered(pair.moving, pair.reference)
        neighbours = program.watch.neighbours(bodies)
        return None if neighbours is None else cls(neighbours, pair.moving != bodies[0])

    def interferes(self, X_RM: Float[Array, "n 12"]) -> Bool[Array, " n"]:
        """Return whether the bodies lie in each other at X_RM (n,)."""
        return self.neighbours.interfere(pose.inverse(X_RM) if self.is_swapped else X_RM)

    def ways_out(self, X_RM: Float[Array, "n 12"]) -> WayOut:
        """Return how the bodies part: P_m, P_r and n_r of the paper, and how deep the place P_m lies (n,) [mm]."""
        if not self.is_swapped:
            return self.neighbours.ways_out(X_RM)
        way = self.neighbours.ways_out(pose.inverse(X_RM))
        normals = -np.einsum("nij,nj->ni", pose.rotation(X_RM), way.normals)
        return WayOut(way.feet, way.places, normals, way.widths)
