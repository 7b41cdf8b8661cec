"""Two bodies near each other: whether they interfere at given poses, and how deep."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import igl
import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.interference import depth_kernel, free_kernel, kernel, near_kernel, parting_kernel
from tolcontact.interference.free_region import CORNERS, free_region
from tolcontact.interference.kernel import LEAF
from tolcontact.interference.solid import Solid

LEVELS = 1 << 10  # cells along each side of a mesh, for sorting triangles
FLAT = 1e-12  # of coordinates: how far corners of a facet may be from its plane
MIN_TRIANGLES = 100  # of two bodies: with fewer, a complete test takes no longer than a certificate


class Interference(NamedTuple):
    """The interference of bodies A and B, in n realizations.

    depths      (n,) [mm]: depth of the deepest sample point of one body below the surface of the other
    triangles   (n, 2): of A and of B, the triangle of its solid that contains the point or is nearest to it; -1 minus an edge
    places      (n, 2, 3) [mm], in the frame of B: of A and of B, the sample point and the nearest point on the surface
    """

    depths: Float[Array, " n"]
    triangles: Int[Array, "n 2"]
    places: Float[Array, "n 2 3"]


class WayOut(NamedTuple):
    """The least motion that separates bodies A and B, in n realizations.

    places      (n, 3) [mm] of A: its lowest point in B, in the frame of A
    feet        (n, 3) [mm] of B: its highest point in A, in the frame of B
    normals     (n, 3): the direction of the motion of A relative to B, in the frame of B
    widths      (n,) [mm]: the length of the motion; 0 if no edge shows one
    """

    places: Float[Array, "n 3"]
    feet: Float[Array, "n 3"]
    normals: Float[Array, "n 3"]
    widths: Float[Array, " n"]


class BoxTree(NamedTuple):
    """A complete binary tree, its nodes in heap order: the children of node i are 2 i + 1 and 2 i + 2.

    triangles   (leaf, LEAF): indices of the triangles in each leaf, -1 where there is none
    boxes       (node, 6) [mm]: lower and upper corner of the box of each node; empty boxes reach from infinity to -infinity
    next        (node,): the node that follows if the children of a node are left out; the number of nodes at the end
    """

    triangles: Int[Array, "l 4"]
    boxes: Float[Array, "n 6"]
    next: Int[Array, " n"]


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Two bodies, which count as slightly smaller than they are.

    insets   [mm]: depths of the surfaces of A and of B inside the bodies. Touching bodies are apart by the sum of the insets;
             flush faces do not stay flush, since the insets differ
    reach    [mm]: usual motion of A relative to B, with deviations; beyond it, tests take longer
    round_faces    (t,) of the triangles of A and of B: the number of the round face that each represents, -1 for none. Two
                   faces of one number touch by their exact gaps (see `tolcontact.discretization.round_contact`), and their
                   triangles are not compared
    min_triangles  of both bodies; with fewer, no certificate is tried before the complete test
    """

    A: Solid
    B: Solid
    insets: tuple[float, float]
    reach: float
    round_faces: tuple[Int[Array, " t_A"], Int[Array, " t_B"]] | None = None
    min_triangles: float = MIN_TRIANGLES

    @cached_property
    def _inset(self) -> tuple[Solid, Solid]:
        """Both bodies, smaller by the insets."""
        return self.A.inset(self.insets[0]), self.B.inset(self.insets[1])

    @cached_property
    def _nominal(self) -> tuple[kernel.Side, kernel.Side]:
        """Both bodies without deviations."""
        A, B = self._inset
        round_A, round_B = self.round_faces or (np.full(len(body.faces), -1) for body in (A, B))
        return _side(A, round_A, B, round_B, self.reach), _side(B, round_B, A, round_A, self.reach)

    @property
    def varies(self) -> bool:
        """Whether faces of a body deviate."""
        return self.A.varies or self.B.varies

    @cached_property
    def _regions(self) -> list[free_kernel.Region]:
        """Regions that nominally contain one body and that the other one does not reach; none if tests are quick anyway."""
        if len(self.A.faces) + len(self.B.faces) < self.min_triangles:
            return []
        A, B = self._inset
        regions = (free_region(B, A, is_forward=True), free_region(A, B, is_forward=False))
        return [region for region in regions if region is not None]

    def are_apart(
        self, X_BA: Float[Array, "n 12"], deviations: Float[Array, "n contributor"] | None = None
    ) -> Bool[Array, " n"]:
        """Return whether one body certainly lies in a region that the other one does not reach (n,)."""
        are_apart = np.zeros(len(X_BA), dtype=bool)
        for region in self._regions:
            outer, inner = (
                np.zeros((len(X_BA), len(body.columns))) if deviations is None else _columns(body, deviations)
                for body in ((self.B, self.A) if region.is_forward else (self.A, self.B))
            )
            free_kernel.certify(region, X_BA, outer, inner, are_apart)
        return are_apart

    def _sides(self, deviations: np.ndarray | None) -> tuple[kernel.Side, kernel.Side]:
        if deviations is None:
            return self._nominal
        side_A, side_B = (
            nominal if not body.varies else _deviating(nominal, body, deviations)
            for body, nominal in zip((self.A, self.B), self._nominal, strict=True)
        )
        return side_A, side_B

    def interfere(
        self, X_BA: Float[Array, "n 12"], deviations: Float[Array, "n contributor"] | None = None
    ) -> Bool[Array, " n"]:
        """Return whether (n,) the bodies interfere by more than both insets at X_BA, the pose of A in the frame of B.

        Without `deviations`, faces are nominal.
        """
        X_BA, interferes = np.ascontiguousarray(X_BA), np.zeros(len(X_BA), dtype=bool)
        rows = np.flatnonzero(~self.are_apart(X_BA, deviations))
        if rows.size:
            of_rows = np.zeros(rows.size, dtype=bool)
            kernel.interfere(*self._sides(None if deviations is None else deviations[rows]), X_BA[rows], of_rows)
            interferes[rows] = of_rows
        return interferes

    def ways_out(
        self,
        X_BA: Float[Array, "n 12"],
        deviations: Float[Array, "n contributor"] | None = None,
        directions: Float[Array, "n 3"] | None = None,
    ) -> WayOut:
        """Return how bodies separate at poses X_BA (n, 12) at which they interfere.

        directions   (n, 3), in the frame of B: where bodies interfere at several places, the place counts whose separation is
                     closest to these, or else the deepest one
        """
        places, feet, normals = np.zeros((3, len(X_BA), 3))
        way = WayOut(places, feet, normals, np.zeros(len(X_BA)))
        given = np.zeros((len(X_BA), 3)) if directions is None else np.ascontiguousarray(directions)
        parting_kernel.ways_out(*self._sides(deviations), np.ascontiguousarray(X_BA), sum(self.insets), given, *way)
        return way

    def measured(self, X_BA: Float[Array, "n 12"], deviations: Float[Array, "n contributor"] | None = None) -> Interference:
        """Return the penetration of bodies at poses X_BA where they interfere."""
        result = Interference(np.empty(len(X_BA)), np.empty((len(X_BA), 2), dtype=np.int64), np.empty((len(X_BA), 2, 3)))
        depth_kernel.sound(*self._sides(deviations), np.ascontiguousarray(X_BA), *result)
        for solid, side, triangles in zip((self.A, self.B), self._nominal, result.triangles.T, strict=True):
            for row in np.flatnonzero(triangles < 0):
                is_edge = (solid.edges == side.edges[-1 - triangles[row]]).all(axis=1)
                triangles[row] = -1 - int(is_edge.argmax())
        return result._replace(depths=result.depths + sum(self.insets))


def _columns(body: Solid, deviations: np.ndarray) -> np.ndarray:
    """Return the deviations (n, k) that move the faces of a body."""
    return np.ascontiguousarray(deviations[:, body.columns])


def _side(body: Solid, round_faces: np.ndarray, target: Solid, round_faces_of_target: np.ndarray, reach: float) -> kernel.Side:
    """Return a body for compiled passes, with the arrays that depend on the other body. Both are smaller by their insets."""
    vertices, corners = body.vertices, body.corners
    tree, tree_of_target = box_tree(corners), box_tree(target.corners)
    ends, distances = vertices[body.edges], np.empty(len(body.edges))
    near_kernel.distances(ends.min(axis=1), ends.max(axis=1), tree_of_target.boxes, tree_of_target.next, distances)
    order = np.argsort(distances, kind="stable")
    squares, _, _ = igl.point_mesh_squared_distance(vertices, target.vertices, target.faces)
    witnesses = np.array([rows[np.argmax(squares[rows])] for rows in body.components])
    turns = igl.winding_number(target.vertices, target.faces, np.ascontiguousarray(vertices[witnesses]))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    planes = np.column_stack([normals, (normals * corners[:, 0]).sum(axis=1)])
    round_edges, round_facets = round_faces[body.sides].max(axis=1), round_faces_of_target[target.first_of_facet]
    starts, listed, reaches = _near_facets(ends[order], round_edges[order], target, tree_of_target, round_facets, reach)
    return kernel.Side(
        vertices=vertices,
        moved=np.full(len(vertices), -1),
        motions=np.zeros((0, 0, 3)),
        deviations=np.zeros((1, 0)),
        shifts=np.zeros((0, 3)),
        faces=body.faces,
        planes=planes,
        edges=np.ascontiguousarray(body.edges[order]),
        sides=np.ascontiguousarray(body.facet_of[body.sides[order]]),
        outward=np.ascontiguousarray(body.normals[body.sides[order]].sum(axis=1)),
        distances=distances[order],
        facets=np.concatenate(
            [_boxes_of_facets(body, corners.min(axis=1), corners.max(axis=1)), _planes_of_facets(body, corners, planes)], axis=1
        ),
        facet_of=body.facet_of,
        members=np.argsort(body.facet_of, kind="stable"),
        first_members=np.cumsum([0, *np.bincount(body.facet_of)]),
        vertices_of_facets=np.where(body.moves[body.first_of_facet][:, None], body.faces[body.first_of_facet], -1),
        starts=starts,
        listed=listed,
        reaches=reaches,
        reach=reach,
        triangles=tree.triangles,
        boxes=tree.boxes,
        next=tree.next,
        bounds=np.where(CORNERS == 0, vertices.min(axis=0), vertices.max(axis=0)),
        witnesses=witnesses,
        clearances=np.sqrt(squares[witnesses]),
        is_in=np.atleast_1d(turns) > 0.5,
    )


def _near_facets(
    ends: np.ndarray, round_edges: np.ndarray, target: Solid, tree: BoxTree, round_facets: np.ndarray, reach: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return starts, listed and reaches (see kernel.Side) of the facets of a body within `reach` [mm] of edges (e, 2, 3).

    Facets (f,) of the same number of a round face as the edge (e,) are left out.
    """
    corners = target.corners
    boxes = np.ascontiguousarray(ends.min(axis=1)), np.ascontiguousarray(ends.max(axis=1))
    around = np.concatenate([corners.min(axis=1), corners.max(axis=1)], axis=1)
    starts, listed, reaches = np.zeros(len(ends) + 1, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0)
    near_kernel.near_facets(*boxes, tree, around, target.facet_of, reach, False, starts, listed, reaches)
    listed, reaches = np.empty(starts[-1], dtype=np.int64), np.empty(starts[-1])
    near_kernel.near_facets(*boxes, tree, around, target.facet_of, reach, True, starts, listed, reaches)
    edge = np.repeat(np.arange(len(ends)), np.diff(starts))
    kept = (round_edges[edge] < 0) | (round_edges[edge] != round_facets[listed])
    return np.cumsum([0, *np.bincount(edge[kept], minlength=len(ends))]), listed[kept], reaches[kept]


def _planes_of_facets(body: Solid, corners: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Return the planes (f, 4) of the facets; NaN where corners (t, 3, 3) of their triangles lie off these planes.

    Coplanar triangles do not stay coplanar where a vertex of a smaller body cannot lie on all planes around it.
    """
    of_facets = planes[body.first_of_facet]
    n = of_facets[body.facet_of, None, :3]
    heights = np.abs((n * corners).sum(axis=2) - of_facets[body.facet_of, None, 3]) / np.linalg.norm(n, axis=2)
    largest = np.zeros(len(of_facets))
    np.maximum.at(largest, body.facet_of, heights.max(axis=1))
    size = float(np.abs(corners).max(initial=1.0))
    return np.where(largest[:, None] > FLAT * size, np.nan, of_facets)


def _boxes_of_facets(body: Solid, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Return the boxes (f, 6) of the facets, from the boxes of the triangles, `lower` to `upper` (t, 3)."""
    count = len(body.first_of_facet)
    boxes = np.concatenate([np.full((count, 3), np.inf), np.full((count, 3), -np.inf)], axis=1)
    np.minimum.at(boxes[:, :3], body.facet_of, lower)
    np.maximum.at(boxes[:, 3:], body.facet_of, upper)
    return boxes


def _deviating(side: kernel.Side, body: Solid, deviations: np.ndarray) -> kernel.Side:
    """Return a body with the deviations (n, contributor) of some realizations."""
    (vertices, motions), of_body = body.motions, _columns(body, deviations)
    moved = side.moved.copy()
    moved[vertices] = np.arange(len(vertices))
    extremes = motions * of_body.min(axis=0, initial=0), motions * of_body.max(axis=0, initial=0)
    low, high = side.vertices.copy(), side.vertices.copy()
    low[vertices] += np.minimum(*extremes).sum(axis=2)
    high[vertices] += np.maximum(*extremes).sum(axis=2)
    lower, upper = low[side.faces].min(axis=1), high[side.faces].max(axis=1)
    facets = side.facets.copy()
    facets[:, :6] = _boxes_of_facets(body, lower, upper)
    return side._replace(
        facets=facets,
        moved=moved,
        motions=np.ascontiguousarray(motions.swapaxes(1, 2)),
        deviations=of_body,
        shifts=np.zeros((len(vertices), 3)),
        planes=np.where(body.moves[:, None], np.nan, side.planes),
        boxes=boxes_of_nodes(side.triangles, lower, upper),
    )


def box_tree(corners: Float[Array, "t 3 3"]) -> BoxTree:
    """Return the tree of triangles (t, 3, 3) [mm], which are sorted along a Morton curve."""
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    leaves = 1 << max(int(np.ceil(np.log2(max(len(corners), 1) / LEAF))), 0)
    order = np.argsort(_morton(corners.mean(axis=1)), kind="stable")
    places = np.full(leaves * LEAF, -1)
    # Triangles are spread over all leaves, so that all are about equally full.
    leaf = np.arange(len(corners)) * leaves // max(len(corners), 1)
    places[leaf * LEAF + np.arange(len(corners)) - np.searchsorted(leaf, leaf)] = order
    triangles = places.reshape(leaves, LEAF)
    return BoxTree(triangles, boxes_of_nodes(triangles, lower, upper), _successors(2 * leaves - 1))


def boxes_of_nodes(triangles: Int[Array, "l 4"], lower: Float[Array, "t 3"], upper: Float[Array, "t 3"]) -> Float[Array, "n 6"]:
    """Return the boxes of the nodes of a tree with `triangles` in its leaves, whose boxes are `lower` to `upper`."""
    places = triangles.ravel()
    boxes = np.concatenate([np.full((places.size, 3), np.inf), np.full((places.size, 3), -np.inf)], axis=1)
    boxes[places >= 0] = np.concatenate([lower, upper], axis=1)[places[places >= 0]]
    level = _joined(boxes, LEAF)
    levels = [level]
    while len(level) > 1:
        level = _joined(level, 2)
        levels.insert(0, level)
    return np.concatenate(levels)


def _joined(boxes: np.ndarray, count: int) -> np.ndarray:
    """Return the boxes around each `count` boxes in a row."""
    groups = boxes.reshape(-1, count, 6)
    return np.concatenate([groups[..., :3].min(axis=1), groups[..., 3:].max(axis=1)], axis=1)


def _successors(count: int) -> np.ndarray:
    """Return the node that follows each node and its children, in preorder."""
    successors = np.full(count, count)
    for node in range(1, count):
        successors[node] = node + 1 if node % 2 else successors[(node - 1) // 2]
    return successors


def _morton(points: np.ndarray) -> np.ndarray:
    """Return the places of points (point, 3) on a Morton curve."""
    lower, span = points.min(axis=0, initial=np.inf), np.ptp(points, axis=0).max() if len(points) else 1.0
    cells = ((points - lower) / max(float(span), 1e-300) * (LEVELS - 1)).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code
