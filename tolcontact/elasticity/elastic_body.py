"""A part as a free elastic body: nodes, and their displacements under forces. Lengths in mm, forces in N."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np
import scipy
from scipy import sparse

from tolcontact import code_cache
from tolcontact.arrays import Array, Float
from tolcontact.code_cache import digest
from tolcontact.errors import GeometryFault

BLOCK_LOADS = 64  # solved at a time: the displacements of one block are in memory
FEW_NODES, NEIGHBOURS = 200, 16  # up to this number, displacements are interpolated between all nodes; else between the nearest


Pads = Callable[[np.ndarray, np.ndarray, float | None], sparse.csc_array]  # see ElasticBody.spread


@dataclass(frozen=True, eq=False)
class ElasticBody:
    """A free elastic body. It responds to any forces, since inertia balances them.

    nodes      in the part's frame [mm]
    shares     of the volume that each node represents, 1 in total; equal shares if the volume is unknown
    mass       [kg]; NaN if it is unknown
    pads       spreads unit forces
    balanced   returns displacements (3 node, load) [mm], up to rigid motions, under balanced forces (3 node, load) [N]
    restoring  returns the nodal forces K u (3 node, load) [N] of displacements u (3 node, load) [mm]
    key        a digest of nodes and stiffness: equal bodies have equal keys
    finer      returns the same part from a mesh whose edges are this share of its own; None for an imported matrix
    """

    nodes: Float[Array, "node 3"]
    shares: Float[Array, " node"]
    mass: float
    pads: Pads
    balanced: Callable[[np.ndarray], np.ndarray]
    restoring: Callable[[np.ndarray], np.ndarray]
    key: str
    finer: "Callable[[float], ElasticBody] | None" = None

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
    return responses(body, loads, np.zeros((0, 3)))[0]


def responses(
    body: ElasticBody, loads: sparse.csc_array, points: Float[Array, "point 3"]
) -> tuple[Float[Array, "load load"], Float[Array, "point 3 load"]]:
    """Return the flexibility among `loads`, and the displacements at `points` [mm], which are interpolated between nodes."""
    key = "flexibility-" + digest(_sources(), body.key.encode(), body.shares, loads.data, loads.indices, loads.indptr, points)
    stored, count = code_cache.load(key), loads.shape[1]
    if stored is None:
        stored = np.concatenate(_responses(body, loads, points)).tobytes()
        code_cache.store(key, stored)
    values = np.frombuffer(stored).reshape(-1, count)
    return values[:count], values[count:].reshape(len(points), 3, count)


@cache
def _sources() -> bytes:
    """Return the sources of this package: what they compute is not what others computed."""
    return b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))


def _responses(body: ElasticBody, loads: sparse.csc_array, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    count, near = loads.shape[1], NEIGHBOURS if len(body.nodes) > FEW_NODES else None
    matrix, fields = np.zeros((count, count)), np.zeros((3 * len(points), count))
    for start in range(0, count, BLOCK_LOADS):
        block = slice(start, start + BLOCK_LOADS)
        displacements = body.response(loads[:, block].toarray())
        matrix[:, block] = loads.T @ displacements
        if len(points):
            at_nodes = displacements.reshape(len(body.nodes), -1)
            spline = scipy.interpolate.RBFInterpolator(body.nodes, at_nodes, near, kernel="linear", degree=0)
            fields[:, block] = spline(points).reshape(len(fields), -1)
    return (matrix + matrix.T) / 2, fields


def rigid_motions(nodes: Float[Array, "node 3"], shares: Float[Array, " node"]) -> Float[Array, "force 6"]:
    """Return three translations and three rotations about the centroid, scaled so that all are of a size."""
    arms = nodes - shares @ nodes / shares.sum()
    size = np.sqrt((arms**2).sum(axis=1).mean()) or 1.0
    rotations = np.cross(np.eye(3)[:, None], arms[None] / size)  # (axis, node, 3)
    translations = np.broadcast_to(np.eye(3)[:, None], rotations.shape)
    return np.concatenate([translations, rotations]).reshape(6, -1).T
