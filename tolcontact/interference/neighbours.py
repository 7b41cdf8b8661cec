"""Two bodies near each other: whether they interfere at given poses, and how deep."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import igl
import numpy as np

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.interference import depth_kernel, free_kernel, kernel, near_kernel, parting_kernel
from tolcontact.interference.box_tree import BoxTree, box_tree, boxes_of_nodes
from tolcontact.interference.deviating_solid import DeviatingSolid
from tolcontact.interference.free_region import CORNERS, InsetBody, free_region

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


FLAT = 1e-12  # of coordinates: how far corners of a facet may be from its plane


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

    A: DeviatingSolid
    B: DeviatingSolid
    insets: tuple[float, float]
    reach: float
    round_faces: tuple[Int[Array, " t_A"], Int[Array, " t_B"]] | None = None
    min_triangles: float = MIN_TRIANGLES

    @cached_property
    def _nominal(self) -> tuple[kernel.Side, kernel.Side]:
        """Both bodies without deviations."""
        vertices_A, vertices_B = (body.inset(depth) for body, depth in zip((self.A, self.B), self.insets, strict=True))
        none = (np.full(len(body.solid.faces), -1) for body in (self.A, self.B))
        round_A, round_B = self.round_faces or none
        return (
            _side(self.A, vertices_A, round_A, self.B, vertices_B, round_B, self.reach),
            _side(self.B, vertices_B, round_B, self.A, vertices_A, round_A, self.reach),
        )

    @property
    def varies(self) -> bool:
        """Whether faces of a body deviate."""
        return self.A.varies or self.B.varies

    @cached_property
    def _regions(self) -> list[free_kernel.Region]:
        """Regions that nominally contain one body and that the other one does not reach; none if tests are quick anyway."""
        A, B = (InsetBody(body, side.vertices) for body, side in zip((self.A, self.B), self._nominal, strict=True))
        if len(self.A.solid.faces) + len(self.B.solid.faces) < self.min_triangles:
            return []
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

    def ways_out(self, X_BA: Float[Array, "n 12"], directions: Float[Array, "n 3"] | None = None) -> WayOut:
        """Return how bodies without deviations separate at poses X_BA (n, 12) at which they interfere.

        directions   (n, 3), in the frame of B: where bodies interfere at several places, the place counts whose separation is
                     closest to these, or else the deepest one
        """
        places, feet, normals = np.zeros((3, len(X_BA), 3))
        way = WayOut(places, feet, normals, np.zeros(len(X_BA)))
        given = np.zeros((len(X_BA), 3)) if directions is None else np.ascontiguousarray(directions)
        parting_kernel.ways_out(*self._nominal, np.ascontiguousarray(X_BA), sum(self.insets), given, *way)
        return way

    def measured(self, X_BA: Float[Array, "n 12"], deviations: Float[Array, "n contributor"] | None = None) -> Interference:
        """Return the penetration of bodies at poses X_BA where they interfere."""
        result = Interference(np.empty(len(X_BA)), np.empty((len(X_BA), 2), dtype=np.int64), np.empty((len(X_BA), 2, 3)))
        depth_kernel.sound(*self._sides(deviations), np.ascontiguousarray(X_BA), *result)
        for solid, side, triangles in zip((self.A.solid, self.B.solid), self._nominal, result.triangles.T, strict=True):
            for row in np.flatnonzero(triangles < 0):
                is_edge = (solid.edges == side.edges[-1 - triangles[row]]).all(axis=1)
                triangles[row] = -1 - int(is_edge.argmax())
        return result._replace(depths=result.depths + sum(self.insets))


def _columns(body: DeviatingSolid, deviations: np.ndarray) -> np.ndarray:
    """Return the deviations (n, k) that move the faces of a body."""
    return np.ascontiguousarray(deviations[:, body.columns])


def _side(
    body: DeviatingSolid,
    vertices: np.ndarray,
    round_faces: np.ndarray,
    target: DeviatingSolid,
    vertices_of_target: np.ndarray,
    round_faces_of_target: np.ndarray,
    reach: float,
) -> kernel.Side:
    """Return a body with inset vertices (v, 3) for compiled passes, with the arrays that depend on the other body."""
    solid, tree, tree_of_target = (
        body.solid,
        box_tree(vertices[body.solid.faces]),
        box_tree(vertices_of_target[target.solid.faces]),
    )
    ends, distances = vertices[solid.edges], np.empty(len(solid.edges))
    near_kernel.distances(ends.min(axis=1), ends.max(axis=1), tree_of_target.boxes, tree_of_target.next, distances)
    order = np.argsort(distances, kind="stable")
    squares, _, _ = igl.point_mesh_squared_distance(vertices, vertices_of_target, target.solid.faces)
    witnesses = np.array([rows[np.argmax(squares[rows])] for rows in solid.components])
    turns = igl.winding_number(vertices_of_target, target.solid.faces, np.ascontiguousarray(vertices[witnesses]))
    corners = vertices[solid.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    planes = np.column_stack([normals, (normals * corners[:, 0]).sum(axis=1)])
    lists = _near_facets(ends[order], tree_of_target, vertices_of_target[target.solid.faces], target.facet_of, reach)
    round_edges, round_facets = round_faces[solid.sides].max(axis=1), round_faces_of_target[target.first_of_facet]
    lists = lists.without(round_edges[order], round_facets)
    return kernel.Side(
        vertices=vertices,
        moved=np.full(len(vertices), -1),
        motions=np.zeros((0, 0, 3)),
        deviations=np.zeros((1, 0)),
        shifts=np.zeros((0, 3)),
        faces=solid.faces,
        planes=planes,
        edges=np.ascontiguousarray(solid.edges[order]),
        sides=np.ascontiguousarray(body.facet_of[solid.sides[order]]),
        outward=np.ascontiguousarray(solid.normals[solid.sides[order]].sum(axis=1)),
        distances=distances[order],
        facets=np.concatenate(
            [_boxes_of_facets(body, corners.min(axis=1), corners.max(axis=1)), _planes_of_facets(body, corners, planes)], axis=1
        ),
        facet_of=body.facet_of,
        members=np.argsort(body.facet_of, kind="stable"),
        first_members=np.cumsum([0, *np.bincount(body.facet_of)]),
        vertices_of_facets=np.where(body.moves[body.first_of_facet][:, None], solid.faces[body.first_of_facet], -1),
        **lists._asdict(),
        reach=reach,
        triangles=tree.triangles,
        boxes=tree.boxes,
        next=tree.next,
        bounds=np.where(CORNERS == 0, vertices.min(axis=0), vertices.max(axis=0)),
        witnesses=witnesses,
        clearances=np.sqrt(squares[witnesses]),
        is_in=np.atleast_1d(turns) > 0.5,
    )


class _NearFacets(NamedTuple):
    """See kernel.Side."""

    starts: np.ndarray
    listed: np.ndarray
    reaches: np.ndarray

    def without(self, round_edges: np.ndarray, round_facets: np.ndarray) -> "_NearFacets":
        """Return the lists without facets (f,) of the same number of a round face as the edge (e,)."""
        edge = np.repeat(np.arange(len(round_edges)), np.diff(self.starts))
        kept = (round_edges[edge] < 0) | (round_edges[edge] != round_facets[self.listed])
        starts = np.cumsum([0, *np.bincount(edge[kept], minlength=len(round_edges))])
        return _NearFacets(starts, self.listed[kept], self.reaches[kept])


def _near_facets(edges: np.ndarray, tree: BoxTree, corners: np.ndarray, facets: np.ndarray, reach: float) -> _NearFacets:
    """Return the facets within `reach` [mm] of edges (e, 2, 3); triangles have `corners` (t, 3, 3)."""
    boxes = np.ascontiguousarray(edges.min(axis=1)), np.ascontiguousarray(edges.max(axis=1))
    around = np.concatenate([corners.min(axis=1), corners.max(axis=1)], axis=1)
    lists = _NearFacets(np.zeros(len(edges) + 1, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))
    near_kernel.near_facets(*boxes, tree, around, facets, reach, False, *lists)
    count = int(lists.starts[-1])
    lists = lists._replace(listed=np.empty(count, dtype=np.int64), reaches=np.empty(count))
    near_kernel.near_facets(*boxes, tree, around, facets, reach, True, *lists)
    return lists


def _planes_of_facets(body: DeviatingSolid, corners: np.ndarray, planes: np.ndarray) -> np.ndarray:
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


def _boxes_of_facets(body: DeviatingSolid, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Return the boxes (f, 6) of the facets, from the boxes of the triangles, `lower` to `upper` (t, 3)."""
    count = len(body.first_of_facet)
    boxes = np.concatenate([np.full((count, 3), np.inf), np.full((count, 3), -np.inf)], axis=1)
    np.minimum.at(boxes[:, :3], body.facet_of, lower)
    np.maximum.at(boxes[:, 3:], body.facet_of, upper)
    return boxes


def _deviating(side: kernel.Side, body: DeviatingSolid, deviations: np.ndarray) -> kernel.Side:
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
