"""Both faces of a contact pair as they are: how deep one lies in the other, not at contact points only."""

from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np
import trimesh

from tolcontact import poses as pose
from tolcontact.geometry.curvature import chord_height
from tolcontact.geometry.edges import rim
from tolcontact.geometry.surface import Surface
from tolcontact.vocabulary import ROUNDED

PROBES = 2000  # points of a face at least, beside the corners of its triangles
DENSER = 4  # times as close as contact points, as far as MOST allows
MOST = 20_000
SLIVERS = 20  # times as many would halving long triangles give: points are drawn instead
TOGETHER = 16  # poses at once


@dataclass(frozen=True, eq=False)
class Side:
    """A face in its nominal place, and the body that it belongs to.

    points   (point, 3) [mm], all over the face, its corners among them
    normals  (point, 3): outward ones there
    """

    face: Surface
    body: trimesh.Trimesh
    points: np.ndarray
    normals: np.ndarray

    def depth(self, points: np.ndarray) -> np.ndarray:
        """How deep `points` (point, 3) [mm] lie behind the face, in the body; outside, and beside it, at most ROUNDED.

        Distance to the face [mm]; 0 where a flat face is less than ROUNDED away, as most points of faces that touch are. Of a
        body that is not closed whatever is behind the face is inside.
        """
        depth = np.zeros(len(points))
        lower, upper = self.body.bounds
        near = np.flatnonzero(((points >= lower) & (points <= upper)).all(axis=1))
        if self._plane is not None:
            n, height = self._plane
            near = near[points[near] @ n < height - ROUNDED]
        if near.size:
            depth[near] = self.face.depth(points[near])
            near = near[depth[near] > 0]
        if near.size and self._is_closed:
            near = near[depth[near] > max(self._bulge, ROUNDED)]  # what touches need not be looked for in the body
        if near.size and self._is_closed:
            turns = igl.winding_number(self._vertices, self._faces, np.ascontiguousarray(points[near]))
            depth[near[turns <= 0.5]] = 0
        return depth

    @cached_property
    def _bulge(self) -> float:
        """How far [mm] known surfaces may stand out of the body's flat triangles."""
        return max((chord_height(piece.face) for piece in self.face.pieces), default=0.0)

    @cached_property
    def _plane(self) -> tuple[np.ndarray, float] | None:
        """Normal and height of the plane behind which a flat face lies; None of a face that is not flat."""
        normals = self.face.corner_normals.reshape(-1, 3)
        n = normals.mean(axis=0)
        n /= np.linalg.norm(n)
        return (n, float((self.face.mesh.vertices @ n).max())) if (normals @ n).min() > 1 - 1e-12 else None

    @cached_property
    def _is_closed(self) -> bool:
        return bool(self.body.is_watertight)

    @cached_property
    def _vertices(self) -> np.ndarray:
        return np.ascontiguousarray(self.body.vertices, dtype=np.float64)

    @cached_property
    def _faces(self) -> np.ndarray:
        return np.ascontiguousarray(self.body.faces, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class FacePair:
    """The faces of a pair, ready to be checked at any pose."""

    moving: Side
    reference: Side

    def depth(self, X_RM: np.ndarray, heights: np.ndarray) -> np.ndarray:
        """Largest depth (row,) [mm] of one face in the other's body at X_RM (row, 12), both ways round.

        Faces that lie farther out than they do nominally, by `heights` (row,) [mm] together, count as if one of them did.
        """
        found = np.zeros(len(X_RM))
        for first in range(0, len(X_RM), TOGETHER):
            X, farther = X_RM[first : first + TOGETHER], heights[first : first + TOGETHER]
            for body, motion, side in ((self.reference, X, self.moving), (self.moving, pose.inverse(X), self.reference)):
                places = pose.apply(motion, side.points)
                if farther.any():
                    places += farther[:, None, None] * (side.normals @ pose.rotation(motion).swapaxes(1, 2))
                depth = body.depth(places.reshape(-1, 3)).reshape(len(X), -1)
                found[first : first + TOGETHER] = np.maximum(found[first : first + TOGETHER], depth.max(axis=1, initial=0))
        return found


def side(face: Surface, body: trimesh.Trimesh, contacts: int) -> Side:
    """A side of a pair with so many contact points."""
    wanted = min(max(PROBES, contacts * DENSER**2), MOST)
    step = float(np.sqrt(face.mesh.area / wanted))
    points = np.unique(_all_over(face.mesh, step, wanted), axis=0)
    if len(points) > MOST:
        points = points[np.random.default_rng(0).choice(len(points), MOST, replace=False)]
    triangle, nearest = face.nearest(points)
    return Side(face, body, face.project(points)[0] if face.surfaces else points, face.normals(triangle, nearest))


def _all_over(mesh: trimesh.Trimesh, step: float, wanted: int) -> np.ndarray:
    """Points (point, 3) of a face some `step` [mm] apart, its rim and vertices among them.

    Where halving the edges of long slivers would give too many, so many as are `wanted` are drawn inside, with a fixed seed.
    """
    vertices, corners = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    if (4.0 ** np.ceil(np.log2(np.maximum(longest / step, 1)))).sum() <= SLIVERS * wanted:
        return np.asarray(trimesh.remesh.subdivide_to_size(vertices, mesh.faces, max_edge=step, max_iter=30)[0])
    inside, _ = trimesh.sample.sample_surface(mesh, wanted, seed=0)
    along_rim = [
        np.linspace(start, end, int(np.ceil(np.linalg.norm(end - start) / step)) + 1)
        for start, end in vertices[rim(mesh.faces)]
    ]
    return np.concatenate([vertices, inside, *along_rim])
