"""An elastic body from a stiffness matrix of another program. Forces act on its nodes, which are few: the matrix is dense."""

from pathlib import Path

import numpy as np
from scipy import linalg, sparse
from scipy.spatial import KDTree

from tolcontact.arrays import Array, Float, Int
from tolcontact.code_cache import digest
from tolcontact.elasticity.elastic_body import ElasticBody, rigid_motions
from tolcontact.elasticity.node_table import node_table
from tolcontact.elasticity.nodes_on_part import check_nodes
from tolcontact.elasticity.stiffness_checks import free_stiffness
from tolcontact.elasticity.stiffness_files import read_stiffness
from tolcontact.errors import GeometryFault

MAX_OFFSET = 0.01  # [mm] of a node from the point at which a force acts


def imported_body(
    stiffness: Path,
    nodes: Path,
    surface: tuple[Float[Array, "vertex 3"], Int[Array, "face 3"]] | None,
    tolerance: float,
) -> ElasticBody:
    """Return the elastic body of a `stiffness` file and the file of its `nodes`, which lie on a `surface` within `tolerance`.

    Raises GeometryFault with the name of the file if it cannot be read, or is not the stiffness of this part, free in space.
    """
    matrix = read_stiffness(stiffness)
    table = node_table(nodes)
    positions, K = free_stiffness(matrix, table)
    if surface is not None:
        check_nodes(positions, nodes, *surface, tolerance)
    shares = np.full(len(positions), 1 / len(positions))
    Q, _ = np.linalg.qr(rigid_motions(positions, shares))
    factor = linalg.cho_factor(K + np.abs(K).max() * (Q @ Q.T))  # the same as K for balanced forces
    tree = KDTree(positions)

    def pads(points: np.ndarray, directions: np.ndarray, radius: float | None) -> sparse.csc_array:
        distances, nearest = tree.query(points)
        if (distances > MAX_OFFSET).any():
            k = int(np.argmax(distances))
            raise GeometryFault(
                f'"{stiffness}" has no node at ({", ".join(f"{x:.6g}" for x in points[k])}), where something acts: the nearest '
                f"is {distances[k]:.3g} mm away; retain a node there, or move the point to the node"
            )
        rows = 3 * nearest[:, None] + np.arange(3)
        columns = np.broadcast_to(np.arange(len(points))[:, None], rows.shape)
        return sparse.csc_array((directions.ravel(), (rows.ravel(), columns.ravel())), shape=(len(K), len(points)))

    return ElasticBody(
        nodes=positions,
        shares=shares,
        mass=np.nan,
        pads=pads,
        balanced=lambda forces: linalg.cho_solve(factor, forces),
        restoring=lambda displacements: np.asarray(K @ displacements),
        key=digest(positions, K),
    )
