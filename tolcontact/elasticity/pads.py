"""Forces on pads of a meshed surface, which keep their resultant and moment. Lengths in mm.

Loads at single points of a solid do not converge as its mesh is refined; forces on pads do.
"""

from functools import cache, cached_property

import numpy as np
from scipy import sparse
from scipy.spatial import KDTree

from tolcontact.arrays import Array, Float
from tolcontact.elasticity.tetrahedra import Tetrahedra, shape_functions
from tolcontact.errors import GeometryFault
from tolcontact.geometry.triangle_mesh import triangle_tree

SAMPLES = 4  # quadrature points across the radius of a pad
MIN_RADIUS = 0.05  # of the edges at the pad: the shape functions do not resolve a smaller one
SAME_FACE = 0.5  # cosine between normals within a pad
NEAREST = 1e-6  # of the size of the part: triangles at the distance of the nearest one
OFF_SURFACE = 0.05  # radii: higher points are outside the material


class SurfacePads:
    """The boundary of a mesh, on which forces are spread.

    A pad is the surface within the radius around a point, on the faces of its nearest triangles, with the pressure
    1 - (r / radius)^2. Around a point outside the material, such as one on the axis of a hole, it is all surface that faces the
    point, up to the radius beyond the nearest place. The force d at p acts as f(x) = w(x) (a + b x (x - c)) with
    the centroid c of w; a and b follow from the resultant d and the moment (p - c) x d.
    """

    def __init__(self, mesh: Tetrahedra, volume: float) -> None:
        """Prepare the boundary of a mesh. Its `volume` [mm^3] by its area is the thickness, and the usual radius of pads."""
        self.mesh = mesh
        self.corners = corners = mesh.nodes[mesh.triangles[:, :3]]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.areas = np.linalg.norm(normals, axis=1) / 2
        self.normals = normals / (2 * self.areas[:, None])
        self.usual_radius = 2 * volume / float(self.areas.sum())
        self.size = float(np.linalg.norm(np.ptp(mesh.nodes, axis=0)))
        self.edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        self.centres = corners.mean(axis=1)
        self.reach = float(np.linalg.norm(corners - self.centres[:, None], axis=2).max())

    @cached_property
    def tree(self) -> KDTree:
        return KDTree(self.centres)

    def __call__(
        self, points: Float[Array, "load 3"], directions: Float[Array, "load 3"], radius: float | None
    ) -> sparse.csc_array:
        """Return the nodal forces (3 node, load) [N] of forces `directions` [N] at `points` within a `radius`."""
        radius = self.usual_radius if radius is None else radius
        vertices, faces = np.ascontiguousarray(self.mesh.nodes), np.ascontiguousarray(self.mesh.triangles[:, :3])
        squares, _, _ = triangle_tree(vertices, faces).squared_distance(vertices, faces, np.ascontiguousarray(points))
        entries = [
            self._pad(point, direction, radius, distance)
            for point, direction, distance in zip(points, directions, np.sqrt(squares), strict=True)
        ]
        counts = [len(nodes) for nodes, _ in entries]
        rows = np.concatenate([(3 * nodes[:, None] + np.arange(3)).ravel() for nodes, _ in entries])
        values = np.concatenate([forces.ravel() for _, forces in entries])
        columns = np.repeat(np.arange(len(points)), 3 * np.array(counts))
        return sparse.csc_array((values, (rows, columns)), shape=(self.mesh.nodes.size, len(points)))

    def _pad(self, p: np.ndarray, d: np.ndarray, radius: float, distance: float) -> tuple[np.ndarray, np.ndarray]:
        """Return nodes (node,) and their forces (node, 3) of the force d at the point p, `distance` from the surface."""
        if distance > self.size:
            raise GeometryFault(
                f"something acts on it at ({', '.join(f'{x:.6g}' for x in p)}), {distance:.4g} mm off its surface; move "
                "the point onto the part"
            )
        largest = np.hypot(distance, max(radius, MIN_RADIUS * 2 * self.reach)) + NEAREST * self.size
        near = np.array(self.tree.query_ball_point(p, largest + self.reach))
        to_triangles = _triangle_distances(p, self.corners[near])
        nearest = near[to_triangles <= to_triangles.min() + NEAREST * self.size]
        radius = max(radius, MIN_RADIUS * self.edges[nearest].max())
        outer = float(np.hypot(distance, radius))
        height = ((p - self.corners[nearest, 0]) * self.normals[nearest]).sum(axis=1).max()
        samples, normals, areas, shapes, triangles = self._samples(near[to_triangles < outer], radius)
        offsets = samples - p
        weights = areas * np.maximum(1 - (offsets**2).sum(axis=1) / outer**2, 0)
        if height > OFF_SURFACE * radius:
            weights[(normals * offsets).sum(axis=1) >= 0] = 0
        else:
            weights[(normals @ self.normals[nearest].T).max(axis=1) < SAME_FACE] = 0
        inside = weights > 0
        samples, shapes, triangles, weights = samples[inside], shapes[inside], triangles[inside], weights[inside]
        c = weights @ samples / weights.sum()
        arms = samples - c
        inertia = (weights[:, None] * arms).T @ arms
        inertia = np.trace(inertia) * np.eye(3) - inertia
        turn = np.linalg.solve(inertia, np.cross(p - c, d))
        forces = weights[:, None] * (d / weights.sum() + np.cross(turn, arms))
        nodes, index = np.unique(self.mesh.triangles[triangles], return_inverse=True)
        return nodes, np.stack([np.bincount(index.ravel(), (shapes * forces[:, [c]]).ravel()) for c in range(3)], axis=1)

    def _samples(self, near: np.ndarray, radius: float) -> tuple[np.ndarray, ...]:
        """Return quadrature points (sample, 3) of triangles `near`: normals, areas, shape functions (sample, 6), triangles."""
        divisions = np.ceil(SAMPLES * self.edges[near] / radius).astype(int)
        pieces = []
        for count in np.unique(divisions):
            triangles = near[divisions == count]
            barycentric = _centres(int(count))
            shapes = shape_functions(barycentric)
            positions = np.einsum("sn,tnx->tsx", shapes, self.mesh.nodes[self.mesh.triangles[triangles]])
            share = len(barycentric)
            pieces.append(
                (
                    positions.reshape(-1, 3),
                    self.normals[triangles].repeat(share, axis=0),
                    self.areas[triangles].repeat(share) / share,
                    np.tile(shapes, (len(triangles), 1)),
                    triangles.repeat(share),
                )
            )
        return tuple(np.concatenate(columns) for columns in zip(*pieces, strict=True))


@cache
def _centres(count: int) -> np.ndarray:
    """Return the centres (count^2, 3), barycentric, of the equal triangles into which `count` divisions of edges divide one."""
    i, j = np.divmod(np.arange(count * count), count)
    upright = i + j < count
    first = np.where(upright, i + 1 / 3, count - i - 1 / 3)
    second = np.where(upright, j + 1 / 3, count - j - 1 / 3)
    return np.stack([count - first - second, first, second], axis=1) / count


def _triangle_distances(p: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the distance (triangle,) of a point from triangles with corners (triangle, 3, 3)."""
    edges, offsets = np.roll(corners, -1, axis=1) - corners, p - corners
    shares = np.clip((offsets * edges).sum(axis=2) / (edges**2).sum(axis=2), 0, 1)
    to_edges = np.linalg.norm(offsets - shares[..., None] * edges, axis=2).min(axis=1)
    normals = np.cross(edges[:, 0], edges[:, 1])
    sides = np.einsum("tcx,tcx->tc", np.cross(edges, offsets), normals[:, None])
    to_planes = np.abs((offsets[:, 0] * normals).sum(axis=1)) / np.linalg.norm(normals, axis=1)
    return np.where((sides >= 0).all(axis=1), to_planes, to_edges)
