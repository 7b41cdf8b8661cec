"""A body whose faces deviate: its vertices stay on all planes that meet in them, wherever these planes move."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.geometry.analytic_surfaces import Cylinder
from tolcontact.interference.solid import Solid

IN_PLANE = 1e-9  # of the largest motion of a vertex: a motion along the normal that is rounding


@dataclass(frozen=True, eq=False)
class DeviatingSolid:
    """A solid and the deviations that move its faces.

    solid      without deviations
    columns    (k,) of the deviations that move its faces
    motions    (m,), (m, 3, k) [mm]: the vertices that deviations move, and how far for unit deviations
    bulges     (t,) [mm]: how far triangles of hollow round faces protrude into the hollow
    cylinders  that are known to contain some of its triangles, in its frame
    """

    solid: Solid
    columns: Int[Array, " k"]
    motions: tuple[Int[Array, " m"], Float[Array, "m 3 k"]]
    bulges: Float[Array, " t"]
    cylinders: tuple[Cylinder, ...] = ()

    @property
    def varies(self) -> bool:
        """Whether faces deviate."""
        return bool(self.columns.size)

    @cached_property
    def moves(self) -> Bool[Array, " t"]:
        """Whether deviations move the plane of each triangle (t,); corners may move in it."""
        vertices, motions = self.motions
        of_vertices = np.zeros((len(self.solid.vertices), 3, len(self.columns)))
        of_vertices[vertices] = motions
        heights = np.abs(np.einsum("tj,tcjk->tck", self.solid.normals, of_vertices[self.solid.faces]))
        return np.asarray((heights > IN_PLANE * np.abs(motions).max(initial=0)).any(axis=(1, 2)))

    @cached_property
    def facet_of(self) -> Int[Array, " t"]:
        """The facet of each triangle (t,): neighbours in one plane are one facet, unless deviations move their planes."""
        pairs = self.solid.flat[~self.moves[self.solid.flat].any(axis=1)]
        return np.asarray(trimesh.graph.connected_component_labels(pairs, node_count=len(self.solid.faces)), dtype=np.int64)

    @cached_property
    def first_of_facet(self) -> Int[Array, " f"]:
        """A triangle of each facet."""
        return np.unique(self.facet_of, return_index=True)[1]

    def growth(self, deviations: Float[Array, "n contributor"]) -> float:
        """Return how far [mm] deviations (n, contributor) move any vertex at most."""
        if not self.varies:
            return 0.0
        lengths = np.linalg.norm(self.motions[1], axis=1).max(axis=0, initial=0)
        return float((np.abs(deviations[:, self.columns]) @ lengths).max(initial=0))

    def inset(self, depth: float) -> Float[Array, "v 3"]:
        """Return the vertices (v, 3) [mm] of a body whose surface lies `depth` [mm] deeper, and inside round faces."""
        return np.ascontiguousarray(self.solid.vertices + self.solid.inset(depth + self.bulges))


def deviating_solid(
    solid: Solid,
    faces: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]],
    bulges: np.ndarray,
    cylinders: Sequence[Cylinder] = (),
) -> DeviatingSolid:
    """Return a solid whose faces deviate: triangles (m,), columns (k,) and motions (m, 3, 3, k) of the corners of each face."""
    columns = np.unique(np.concatenate([np.zeros(0, dtype=int), *(face[1] for face in faces)]))
    is_moved = np.zeros(len(solid.vertices), dtype=bool)
    for triangles, _, _ in faces:
        is_moved[solid.faces[triangles]] = True
    around = np.flatnonzero(is_moved[solid.faces].any(axis=1))
    motions = np.zeros((len(around), 3, 3, len(columns)))
    for triangles, of_face, motion in faces:
        rows = np.searchsorted(around, triangles)
        motions[np.ix_(rows, np.arange(3), np.arange(3), np.searchsorted(columns, of_face))] += motion
    shifts = solid.shifts(around, motions)
    moved = np.flatnonzero(np.abs(shifts).max(axis=(1, 2), initial=0) > 0)
    return DeviatingSolid(solid, columns, (moved, shifts[moved]), bulges, tuple(cylinders))
