"""The wall thickness of a part, which limits the size of its tetrahedra. Lengths in mm."""

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.errors import GeometryFault
from tolcontact.geometry.triangle_mesh import triangle_tree

RAYS = 600
WALL_COSINE = -0.5  # of normals: a ray that leaves through a face turned further away has crossed no wall
THIN_SHARE = 0.1  # of the surface that may be thinner: edges of wedges, small lips
MAX_RATIO = 5.0  # edge by thickness: clamped sheets under pressure deflect 1.3 % too little there, 25 % at 10
USUAL_RATIO, USUAL_DIVISIONS = 2.5, 25  # edges by thickness, and along the diagonal of the part
MAX_NODES = 60_000
NODES_PER_SQUARE = 7.0  # of the surface of a sheet, for edges of length 1; measured


def wall_thickness(vertices: Float[Array, "vertex 3"], faces: Int[Array, "face 3"]) -> float:
    """Return the thickness [mm] that nine tenths of the surface exceed: rays go inward from points even in area."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    triangle = np.searchsorted(np.cumsum(areas), (np.arange(RAYS) + 0.5) / RAYS * areas.sum())
    normals = normals / np.maximum(areas, np.finfo(float).tiny)[:, None]
    u, v = np.modf(np.outer([0.7548776662466927, 0.5698402909980532], np.arange(1, RAYS + 1)))[0]  # even in the unit square
    u, v = np.where(u + v > 1, (1 - u, 1 - v), (u, v))
    weights = np.stack([1 - u - v, u, v], axis=1)
    origins = np.einsum("rc,rcx->rx", weights, corners[triangle])
    hits = triangle_tree(vertices, faces).intersect_ray(vertices, faces, origins, -normals[triangle])
    walls = np.full(RAYS, np.inf)
    for k, crossed in enumerate(hits):
        lengths = [t for face, t, *_ in crossed if face != triangle[k] and normals[face] @ normals[triangle[k]] < WALL_COSINE]
        walls[k] = min(lengths, default=np.inf)
    thickness = float(np.quantile(walls, THIN_SHARE))
    return thickness if np.isfinite(thickness) else float(np.linalg.norm(np.ptp(vertices, axis=0)))


def element_size(vertices: Float[Array, "vertex 3"], faces: Int[Array, "face 3"], area: float, required: float | None) -> float:
    """Return the edge length [mm] of tetrahedra, `required` or by thickness. `area` is the area [mm^2] of the surface.

    Raises GeometryFault if they would be too coarse to bend, or too many.
    """
    thickness = wall_thickness(vertices, faces)
    finest = float(np.sqrt(NODES_PER_SQUARE * area / MAX_NODES))
    largest = MAX_RATIO * thickness
    if required is not None:
        if required > largest:
            raise GeometryFault(
                f"element_size is {required:g} mm, and walls are {thickness:.3g} mm thick: sheets of such tetrahedra are "
                f"far too stiff; give at most {largest:.3g} mm (5 times the thickness), or import a stiffness matrix"
            )
        if required < finest:
            raise GeometryFault(
                f"element_size is {required:g} mm, which gives more than {MAX_NODES} nodes on {area:.3g} mm2; give at least "
                f"{finest:.3g} mm"
            )
        return required
    if finest > largest:
        raise GeometryFault(
            f"its walls are {thickness:.3g} mm thick, too thin for its {area:.3g} mm2: tetrahedra that can bend would have "
            f"more than {MAX_NODES} nodes; import a stiffness matrix of shells (stiffness=, nodes=)"
        )
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    return max(min(USUAL_RATIO * thickness, diagonal / USUAL_DIVISIONS), min(1.5 * finest, largest))
