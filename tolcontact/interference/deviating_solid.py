"""A body whose faces deviate: its vertices stay on all planes that meet in them, wherever these planes go."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.interference.solid import Solid


@dataclass(frozen=True, eq=False)
class DeviatingSolid:
    """A solid and what moves its faces.

    solid      without deviations
    columns    (k,) of the deviations that move its faces
    outward    (t, 3, k) [mm]: how far the plane of each triangle moves outwards at each of its corners for unit deviations
    bulges     (t,) [mm]: how far triangles of hollow round faces stand in the hollow
    """

    solid: Solid
    columns: Int[Array, " k"]
    outward: Float[Array, "t 3 k"]
    bulges: Float[Array, " t"]

    @property
    def varies(self) -> bool:
        """Whether faces deviate."""
        return bool(self.columns.size)

    @cached_property
    def _motions(self) -> tuple[np.ndarray, np.ndarray]:
        """The vertices that deviations move (m,), and how far (m, 3, k) [mm] for unit deviations."""
        shifts = self.solid.shifts(self.outward)
        moved = np.flatnonzero(np.abs(shifts).max(axis=(1, 2), initial=0) > 0)
        return moved, shifts[moved]

    def shifts_of(self, deviations: Float[Array, "n contributor"]) -> Float[Array, "n v 3"]:
        """Return how far deviations (n, contributor) move the vertices [mm]."""
        shifts, (moved, motions) = np.zeros((len(deviations), *self.solid.vertices.shape)), self._motions
        shifts[:, moved] = np.einsum("vik,nk->nvi", motions, deviations[:, self.columns])
        return shifts

    def growth(self, deviations: Float[Array, "n contributor"]) -> float:
        """Return how far [mm] deviations (n, contributor) move any vertex at most."""
        if not self.varies:
            return 0.0
        lengths = np.linalg.norm(self._motions[1], axis=1).max(axis=0, initial=0)
        return float((np.abs(deviations[:, self.columns]) @ lengths).max(initial=0))

    def inset(self, depth: float) -> Float[Array, "v 3"]:
        """Return the vertices (v, 3) [mm] of a body whose surface lies `depth` [mm] deeper, and inside round faces."""
        return self.solid.vertices + self.solid.inset(depth + self.bulges)


def deviating_solid(
    solid: Solid, faces: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]], bulges: np.ndarray
) -> DeviatingSolid:
    """Return a solid whose faces deviate: triangles (m,), columns (k,) and outward (m, 3, k) of each face."""
    columns = np.unique(np.concatenate([np.zeros(0, dtype=int), *(face[1] for face in faces)]))
    outward = np.zeros((len(solid.faces), 3, len(columns)))
    for triangles, of_face, motion in faces:
        outward[np.ix_(triangles, range(3), np.searchsorted(columns, of_face))] += motion
    return DeviatingSolid(solid, columns, outward, bulges)
