"""A part as a free elastic body: nodes, and their displacements under forces. Lengths in mm, forces in N."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy import sparse

from tolcontact import code_cache
from tolcontact.arrays import Array, Float
from tolcontact.errors import GeometryFault

BLOCK_LOADS = 64  # solved at a time: the displacements of one block are in memory


class Pads(Protocol):
    """How unit forces act on the nodes of a body."""

    def __call__(
        self, points: Float[Array, "load 3"], directions: Float[Array, "load 3"], radius: float | None
    ) -> sparse.csc_array: ...


@dataclass(frozen=True, eq=False)
class ElasticBody:
    """A free elastic body. It responds to any forces, since inertia balances them.

    nodes      in the part's frame [mm]
    shares     of the volume that each node represents, 1 in total; equal shares if the volume is unknown
    mass       [kg]; NaN if it is unknown
    pads       spreads unit forces
    balanced   returns displacements (3 node, load) [mm], up to rigid motions, under balanced forces (3 node, load) [N]
    key        a digest of nodes and stiffness: equal bodies have equal keys
    """

    nodes: Float[Array, "node 3"]
    shares: Float[Array, " node"]
    mass: float
    pads: Pads
    balanced: Callable[[np.ndarray], np.ndarray]
    key: str

    def spread(
        self, points: Float[Array, "load 3"], directions: Float[Array, "load 3"], radius: float | None
    ) -> sparse.csc_array:
        """Return the nodal forces (3 node, load) [N] of forces `directions` [N] at `points` [mm].

        On a mesh, a force acts on a pad, the surface within `radius` [mm] of its point, with the same resultant and moment;
        None is twice the volume by the surface area, the thickness of a sheet. On an imported matrix it acts on the node at its
        point. Raises GeometryFault if there is no such node or surface.
        """
        if not len(points):  # of a part where nothing is measured
            return sparse.csc_array((self.nodes.size, 0))
        return self.pads(points, directions, radius)

    def weight(self, acceleration: Float[Array, " 3"]) -> Float[Array, " force"]:
        """Return the consistent nodal forces (3 node,) [N] of gravity, `acceleration` [m/s^2].

        Raises GeometryFault if the mass is unknown.
        """
        if not np.isfinite(self.mass):
            raise GeometryFault("its mass is unknown, so it has no weight; give a density [kg/m3] and no imported stiffness")
        return (self.mass * self.shares[:, None] * acceleration).ravel()

    def response(self, forces: Float[Array, "force load"]) -> Float[Array, "force load"]:
        """Return displacements (3 node, load) [mm] under nodal `forces` (3 node, load) [N], without their mean rigid motion.

        u = P K^+ P' f with P = I - R T'. R are the rigid motions, and T = W R (R'WR)^-1 with the shares W of nodes: P' f is f
        with the inertia forces that balance it, and P u is u without its mean rigid motion, so the flexibility is symmetric.
        """
        R, T = self.rigid
        displacements = self.balanced(forces - T @ (R.T @ forces))
        return displacements - R @ (T.T @ displacements)

    @cached_property
    def rigid(self) -> tuple[np.ndarray, np.ndarray]:
        """Rigid motions R (3 node, 6), and T (3 node, 6) with T'R = I, which measures them in displacements."""
        R = rigid_motions(self.nodes, self.shares)
        weighted = np.repeat(self.shares, 3)[:, None] * R
        return R, np.linalg.solve(R.T @ weighted, weighted.T).T


def flexibility(body: ElasticBody, loads: sparse.csc_array) -> Float[Array, "load load"]:
    """Return the flexibility N'GN [mm/N] among `loads` N (3 node, load): entry (i, j) is the displacement at i due to load j.

    By Betti's theorem it is symmetric; rounding is evened out. It is kept in the cache folder of the user.
    """
    key = "flexibility-" + digest(_sources(), body.key.encode(), body.shares, loads.data, loads.indices, loads.indptr)
    stored = code_cache.load(key)
    if stored is None:
        stored = _flexibility(body, loads).tobytes()
        code_cache.store(key, stored)
    return np.frombuffer(stored).reshape(loads.shape[1], loads.shape[1])


def digest(*contents: np.ndarray | bytes) -> str:
    """Return a digest of arrays and bytes."""
    pieces = (content.tobytes() if isinstance(content, np.ndarray) else content for content in contents)
    return hashlib.blake2b(b"".join(hashlib.blake2b(piece).digest() for piece in pieces), digest_size=16).hexdigest()


@cache
def _sources() -> bytes:
    """Return the sources of this package: what they compute is not what others computed."""
    return b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))


def _flexibility(body: ElasticBody, loads: sparse.csc_array) -> np.ndarray:
    blocks = range(0, loads.shape[1], BLOCK_LOADS)
    columns = [loads.T @ body.response(loads[:, start : start + BLOCK_LOADS].toarray()) for start in blocks]
    matrix = np.concatenate(columns, axis=1) if columns else np.zeros((0, 0))
    return (matrix + matrix.T) / 2


def rigid_motions(nodes: Float[Array, "node 3"], shares: Float[Array, " node"]) -> Float[Array, "force 6"]:
    """Return three translations and three rotations about the centroid, scaled so that all are of a size."""
    arms = nodes - shares @ nodes / shares.sum()
    size = np.sqrt((arms**2).sum(axis=1).mean()) or 1.0
    rotations = np.cross(np.eye(3)[:, None], arms[None] / size)  # (axis, node, 3)
    translations = np.broadcast_to(np.eye(3)[:, None], rotations.shape)
    return np.concatenate([translations, rotations]).reshape(6, -1).T
