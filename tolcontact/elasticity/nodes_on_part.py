"""Whether the nodes of an imported matrix lie on the part: in other units or another frame, they do not."""

from pathlib import Path

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.declaration.geometry import UNITS
from tolcontact.errors import GeometryFault
from tolcontact.geometry.triangle_mesh import triangle_tree

MIN_SPAN = 0.2  # of the part, by all nodes together: others may be in smaller units


def check_nodes(
    nodes: Float[Array, "node 3"],
    path: Path,
    vertices: Float[Array, "vertex 3"],
    faces: Int[Array, "face 3"],
    tolerance: float,
) -> None:
    """Raise GeometryFault unless `nodes` lie within `tolerance` [mm] of the part's surface.

    Nodes in smaller units lie close together, and may all be near the surface at the origin: those that span less than a fifth
    of the part must not fit it in other units.
    """
    distances = _distances(nodes, vertices, faces)
    span, size = np.linalg.norm(np.ptp(nodes, axis=0)), np.linalg.norm(np.ptp(vertices, axis=0))
    if distances.max() <= tolerance and span >= MIN_SPAN * size:
        return
    offsets = {unit: _distances(factor * nodes, vertices, faces).max() for unit, factor in UNITS.items() if unit != "mm"}
    fits = [unit for unit, offset in offsets.items() if offset <= tolerance and UNITS[unit] * span >= MIN_SPAN * size]
    if distances.max() <= tolerance and not fits:
        return  # all at one end of the part
    k = int(np.argmax(distances))
    unit = max(fits, key=lambda unit: UNITS[unit], default="")
    advice = (
        f"they do if they are in {unit}: convert them, and the stiffness, to mm and N/mm"
        if fits
        else "give them in mm in the part's own frame, or mend the tolerance"
    )
    raise GeometryFault(
        f'node file "{path}": its nodes do not lie on the part: node {k + 1} of {len(nodes)} is {distances[k]:.4g} mm from its '
        f"surface (at most {tolerance:g} mm is allowed), and they span {span:.4g} of {size:.4g} mm; {advice}"
    )


def _distances(nodes: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    vertices, faces = np.ascontiguousarray(vertices, dtype=float), np.ascontiguousarray(faces, dtype=np.int64)
    squares, _, _ = triangle_tree(vertices, faces).squared_distance(vertices, faces, np.ascontiguousarray(nodes))
    return np.asarray(np.sqrt(squares))
