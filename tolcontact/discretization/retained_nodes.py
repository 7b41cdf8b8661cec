"""Contact points at the nodes of imported stiffness matrices, where forces can act."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tolcontact.arrays import Array, Float
from tolcontact.discretization.locators import NominalPart
from tolcontact.elasticity import MAX_OFFSET, node_table
from tolcontact.geometry.surface import Surface


def retained_nodes(parts: Sequence[NominalPart], face: Surface) -> Float[Array, "node 3"] | None:
    """Return the nodes (node, 3) of the first part that has a matrix, where they lie on the `face` or are projected onto it.

    None if no part has one. Raises GeometryFault if its nodes cannot be read.
    """
    for number, part in enumerate(parts):
        elastic = part.part.elasticity
        if elastic is not None and elastic.nodes is not None:
            nodes = part.placed(node_table(Path(elastic.nodes))[0])
            on_face, _, is_over = face.project(nodes)
            if number:
                return np.asarray(on_face[is_over])
            return np.asarray(nodes[np.linalg.norm(nodes - on_face, axis=1) <= MAX_OFFSET])
    return None
