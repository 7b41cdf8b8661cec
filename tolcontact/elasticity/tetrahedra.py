"""Quadratic tetrahedra: isoparametric, with ten nodes each. Their stiffness, volumes and boundary. Lengths in mm."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from tolcontact.arrays import Array, Float, Int
from tolcontact.errors import GeometryFault

EDGES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))  # of nodes 4 to 9, as netgen orders them
FACES = np.array([(1, 2, 3, 9, 8, 7), (0, 3, 2, 9, 5, 6), (0, 1, 3, 8, 6, 4), (0, 2, 1, 7, 4, 5)])  # as Tetrahedra.triangles
_NEAR, _FAR = 0.5854101966249685, 0.1381966011250105  # (5 + 3 sqrt 5) / 20 and (5 - sqrt 5) / 20
POINTS = np.full((4, 4), _FAR) + (_NEAR - _FAR) * np.eye(4)  # quadrature of second degree, barycentric, weights 1/24
BLOCK_ELEMENTS = 4000
_BARYCENTRIC = np.array([[-1.0, -1, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]])  # derivatives of coordinates 0 to 3


@dataclass(frozen=True, eq=False)
class Tetrahedra:
    """A mesh of second order.

    elements    (element, 10) nodes: corners, then the midpoints of EDGES
    """

    nodes: Float[Array, "node 3"]
    elements: Int[Array, "element 10"]

    @property
    def piece_count(self) -> int:
        """The number of pieces that share no node."""
        hub = self.elements[:, :1].repeat(9, axis=1)
        links = sparse.coo_array((np.ones(hub.size), (hub.ravel(), self.elements[:, 1:].ravel())), shape=(len(self.nodes),) * 2)
        return int(sparse.csgraph.connected_components(links, directed=False)[0])

    @cached_property
    def triangles(self) -> Int[Array, "triangle 6"]:
        """The boundary, with normals outward: corners, then the midpoints opposite to them."""
        a, b, c = np.moveaxis(self.nodes[self.elements[:, 1:4]] - self.nodes[self.elements[:, :1]], 1, 0)
        is_right = np.einsum("ex,ex->e", np.cross(a, b), c) > 0
        faces = np.where(is_right[:, None, None], self.elements[:, FACES], self.elements[:, FACES][..., [0, 2, 1, 3, 5, 4]])
        faces = faces.reshape(-1, 6)
        _, first, counts = np.unique(np.sort(faces[:, :3], axis=1), axis=0, return_index=True, return_counts=True)
        return faces[first[counts == 1]]


def shape_functions(barycentric: Float[Array, "point corner"]) -> Float[Array, "point node"]:
    """Return the quadratic shape functions of a tetrahedron, or of a triangle with three `barycentric` coordinates."""
    count = barycentric.shape[1]
    edges = EDGES if count == 4 else ((1, 2), (0, 2), (0, 1))
    corners = barycentric * (2 * barycentric - 1)
    return np.column_stack([corners, *(4 * barycentric[:, i] * barycentric[:, j] for i, j in edges)])


def straightened(mesh: Tetrahedra) -> Tetrahedra:
    """Return the mesh with the edges of elements straight that its curved edges turn inside out.

    Raises GeometryFault if straight elements have no volume, too.
    """
    nodes = mesh.nodes.copy()
    for _ in range(2):
        _, volumes = _gradients(nodes, mesh.elements)
        sense = np.sign(np.median(volumes))
        turned = (sense * volumes <= 0).any(axis=1)
        if not turned.any():
            return Tetrahedra(nodes, mesh.elements)
        elements = mesh.elements[turned]
        for k, (i, j) in enumerate(EDGES, start=4):
            nodes[elements[:, k]] = (nodes[elements[:, i]] + nodes[elements[:, j]]) / 2
    raise GeometryFault(f"{turned.sum()} of its {len(turned)} tetrahedra are flat or inside out; give another element_size")


def node_volumes(mesh: Tetrahedra) -> Float[Array, " node"]:
    """Return the integral (node,) [mm^3] of each node's shape function, which is negative at corners."""
    _, volumes = _gradients(mesh.nodes, mesh.elements)
    total = np.zeros(len(mesh.nodes))
    np.add.at(total, mesh.elements, np.abs(volumes) @ shape_functions(POINTS))
    return total


def stiffness_of(mesh: Tetrahedra, young: float, poisson: float) -> sparse.csr_array:
    """Return the stiffness (3 node, 3 node) [N/mm] of an isotropic material.

    K_ij = sum over points of w (lambda g_i g_j' + mu g_j g_i' + mu g_i.g_j 1), with the gradients g of shape functions.
    """
    lame, shear = young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)
    size = 3 * len(mesh.nodes)
    stiffness = sparse.csr_array((size, size))
    for start in range(0, len(mesh.elements), BLOCK_ELEMENTS):
        elements = mesh.elements[start : start + BLOCK_ELEMENTS]
        gradients, volumes = _gradients(mesh.nodes, elements)  # (element, point, node, 3), (element, point)
        flat = (np.sqrt(np.abs(volumes))[..., None, None] * gradients).reshape(len(elements), len(POINTS), 30)
        products = (flat.swapaxes(1, 2) @ flat).reshape(-1, 10, 3, 10, 3)  # (element, i, a, j, b)
        blocks = lame * products + shear * products.transpose(0, 1, 4, 3, 2)
        blocks += shear * np.einsum("eicjc,ab->eiajb", products, np.eye(3))
        freedoms = (3 * elements[..., None] + np.arange(3)).reshape(len(elements), 30)
        rows, columns = np.repeat(freedoms, 30, axis=1), np.tile(freedoms, 30)
        stiffness += sparse.coo_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size)).tocsr()
    return stiffness


def _gradients(nodes: np.ndarray, elements: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return gradients (element, point, node, 3) [1/mm] at POINTS, and the signed volume (element, point) of each point."""
    slopes = np.empty((len(POINTS), 10, 3))
    slopes[:, :4] = (4 * POINTS - 1)[..., None] * _BARYCENTRIC
    for k, (i, j) in enumerate(EDGES, start=4):
        slopes[:, k] = 4 * (POINTS[:, [j]] * _BARYCENTRIC[i] + POINTS[:, [i]] * _BARYCENTRIC[j])
    jacobians = np.einsum("enx,pns->epxs", nodes[elements], slopes)
    with np.errstate(invalid="ignore", divide="ignore"):
        determinants = np.linalg.det(jacobians)
        regular = np.where(determinants[..., None, None] == 0, np.eye(3), jacobians)
        gradients = np.einsum("pns,epsx->epnx", slopes, np.linalg.inv(regular))
    return gradients, determinants / 24
