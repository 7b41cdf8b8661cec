"""Two bodies near each other: whether, and how deep, they lie in each other at any poses."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import igl
import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.interference import kernel
from tolcontact.interference.deviating_solid import DeviatingSolid

CORNERS = np.array(np.meshgrid(*[(0, 1)] * 3)).reshape(3, -1).T


class Interference(NamedTuple):
    """How bodies A and B lie in each other, in n realizations.

    depths      (n,) [mm]: how deep the deepest of some places on edges of one lies below the surface of the other
    triangles   (n, 2): of A and of B, the triangle of its solid nearest to that place, or -1 minus the edge on which it lies
    places      (n, 2, 3) [mm], in the frame of B: of A and of B, the place on the edge and the nearest one on the surface
    """

    depths: Float[Array, " n"]
    triangles: Int[Array, "n 2"]
    places: Float[Array, "n 2 3"]


class WayOut(NamedTuple):
    """How bodies A and B part with the least motion, in n realizations.

    places      (n, 3) [mm] of A: its lowest point in B, in the frame of A
    feet        (n, 3) [mm] of B: its highest point in A, in the frame of B
    normals     (n, 3): the direction in which A moves against B, in the frame of B
    widths      (n,) [mm] by which it does; 0 if no edge shows one
    """

    places: Float[Array, "n 3"]
    feet: Float[Array, "n 3"]
    normals: Float[Array, "n 3"]
    widths: Float[Array, " n"]


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Two bodies, which count as a little smaller than they are.

    insets   [mm] by which the surfaces of A and of B lie inside the bodies: touching bodies are apart by their sum, and faces
             that are flush are not, since the insets differ
    """

    A: DeviatingSolid
    B: DeviatingSolid
    insets: tuple[float, float]

    @cached_property
    def _nominal(self) -> tuple[kernel.Side, kernel.Side]:
        """Both bodies without deviations."""
        first, second = (body.inset(depth) for body, depth in zip((self.A, self.B), self.insets, strict=True))
        return _side(self.A, first, self.B, second), _side(self.B, second, self.A, first)

    @property
    def varies(self) -> bool:
        """Whether faces of a body deviate."""
        return self.A.varies or self.B.varies

    def _sides(self, deviations: np.ndarray | None) -> tuple[kernel.Side, kernel.Side]:
        if deviations is None:
            return self._nominal
        sides = []
        for body, nominal in zip((self.A, self.B), self._nominal, strict=True):
            side = nominal
            if body.varies:
                shifts = body.shifts_of(deviations)
                side = side._replace(vertices=side.vertices + shifts, spare=side.spare + _farthest(shifts))
            sides.append(side)
        return sides[0], sides[1]

    def interfere(
        self, X_BA: Float[Array, "n 12"], deviations: Float[Array, "n contributor"] | None = None
    ) -> Bool[Array, " n"]:
        """Return whether (n,) the bodies lie in each other by more than both insets at X_BA, the pose of A in the frame of B.

        Without `deviations`, faces are as they are nominally.
        """
        found = np.zeros(len(X_BA), dtype=bool)
        kernel.interfere(*self._sides(deviations), np.ascontiguousarray(X_BA), found)
        return found

    def ways_out(self, X_BA: Float[Array, "n 12"]) -> WayOut:
        """Return how bodies without deviations part at poses X_BA (n, 12) at which they interfere."""
        way = WayOut(*np.zeros((3, len(X_BA), 3)), np.zeros(len(X_BA)))
        kernel.ways_out(*self._nominal, np.ascontiguousarray(X_BA), sum(self.insets), *way)
        return way

    def measured(self, X_BA: Float[Array, "n 12"], deviations: Float[Array, "n contributor"]) -> Interference:
        """Return how deep bodies lie in each other at poses X_BA at which they interfere."""
        result = Interference(np.empty(len(X_BA)), np.empty((len(X_BA), 2), dtype=np.int64), np.empty((len(X_BA), 2, 3)))
        kernel.sound(*self._sides(deviations), np.ascontiguousarray(X_BA), *result)
        for solid, side, triangles in zip((self.A.solid, self.B.solid), self._nominal, result.triangles.T, strict=True):
            for row in np.flatnonzero(triangles < 0):
                is_edge = (solid.edges == side.edges[-1 - triangles[row]]).all(axis=1)
                triangles[row] = -1 - int(is_edge.argmax())
        return result._replace(depths=result.depths + sum(self.insets))


def _side(body: DeviatingSolid, vertices: np.ndarray, other: DeviatingSolid, vertices_of_other: np.ndarray) -> kernel.Side:
    """Return a body with shifted vertices (v, 3) as compiled passes take it, with what its other body decides."""
    solid, tree = body.solid, body.solid.tree
    ends = vertices[solid.edges]
    spare = _farthest(vertices_of_other - other.solid.vertices)
    distances = np.empty(len(ends))
    kernel.distances(
        ends.min(axis=1) - spare, ends.max(axis=1) + spare, other.solid.tree.boxes, other.solid.tree.next, distances
    )
    order = np.argsort(distances, kind="stable")
    corners = np.ascontiguousarray(vertices_of_other)
    squares, _, _ = igl.point_mesh_squared_distance(np.ascontiguousarray(vertices), corners, other.solid.faces)
    witnesses = np.array([rows[np.argmax(squares[rows])] for rows in solid.components])
    turns = igl.winding_number(corners, other.solid.faces, np.ascontiguousarray(vertices[witnesses]))
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    return kernel.Side(
        vertices=np.ascontiguousarray(vertices)[None],
        faces=solid.faces,
        edges=np.ascontiguousarray(solid.edges[order]),
        outward=np.ascontiguousarray(solid.outward[order]),
        distances=distances[order],
        triangles=tree.triangles,
        boxes=tree.boxes,
        next=tree.next,
        spare=_farthest(vertices - solid.vertices),
        bounds=np.where(CORNERS == 0, lower, upper),
        witnesses=witnesses,
        far=np.sqrt(squares[witnesses]),
        is_in=np.atleast_1d(turns) > 0.5,
    )


def _farthest(shifts: np.ndarray) -> float:
    """Return the length of the longest of some vectors (..., 3)."""
    return float(np.linalg.norm(shifts, axis=-1).max(initial=0))


def relative(poses: Float[Array, "n part 12"], first: int, second: int) -> Float[Array, "n 12"]:
    """Return the poses X_BA (n, 12) of a part in the frame of another one."""
    return pose.relative(poses[:, first], poses[:, second])
