"""The penetration depth of the faces of a contact pair, including between contact points.

A plane with form deviation bounds its body over the nominal plane up to the rim, and no further: each of its points is
displaced along the normal of the plane. Adjacent faces keep their nominal positions, and end where they meet the displaced rim
along that normal. The penetration of the other body is therefore its depth behind the displaced plane, including at the rim.
The form deviation of a plane counts along its own normal, never along the normals of other faces.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import igl
import numpy as np
import trimesh

from tolcontact import poses as pose
from tolcontact.geometry.body_overlap import SolidBody
from tolcontact.geometry.spreading import unique_points
from tolcontact.geometry.surface import Surface
from tolcontact.geometry.triangle_mesh import rim, subdivided
from tolcontact.vocabulary import ROUNDED

MIN_POINTS = 2000  # of a face, in addition to the corners of its triangles
DENSITY = 4  # ratio of contact-point spacing to the spacing of these points
MAX_POINTS = 20_000
MAX_HALVED = 20  # times the desired number of points: if halving long triangles gives more, points are sampled at random
POSES_PER_BLOCK = 16
MORE_POINTS = 8  # growth factor per round of the number of points checked in each row
MIN_MEAN = 0.5  # length of the mean normal: 1 for a plane, 0 for a closed body
THINNED = 32  # every 32nd point is enough to detect nearly every penetration


@dataclass(frozen=True, eq=False)
class BodyFace:
    """A face in its nominal pose, and its body.

    points   (point, 3) [mm], spread over the whole face, including its corners
    normals  (point, 3): outward normals there
    plane    normal and height of the bounding plane of a flat face; None if the face is not flat
    """

    face: Surface
    body: SolidBody
    points: np.ndarray
    normals: np.ndarray
    plane: tuple[np.ndarray, float] | None

    def raise_to_depths(self, largest: np.ndarray, row: np.ndarray, points: np.ndarray) -> None:
        """Raise depths `largest` (row,) [mm] to the depths of `points` (point, 3) [mm] that belong to rows `row` (point,).

        The depth of a point behind the face and inside the body is its distance to the face; elsewhere it is 0. If the body is
        not closed, everything behind the face counts as inside.
        """
        lower, upper = self.body.mesh.bounds
        inside = np.flatnonzero(((points >= lower) & (points <= upper)).all(axis=1))
        row, points = row[inside], points[inside]
        depth, behind = np.zeros(len(points)), self._is_behind(points)
        if behind.any():
            depth[behind] = self.face.depth(points[behind])
        if not self.body.is_closed:
            np.maximum.at(largest, row, depth)
            return
        is_certain = depth <= max(self._bulge, ROUNDED)  # points that only touch count as inside
        np.maximum.at(largest, row[is_certain], depth[is_certain])
        # The deepest points of a row come first: usually one of them is in the body, and the others need no check.
        order = np.lexsort((-depth, row))
        count = 1
        while (order := order[depth[order] > largest[row[order]]]).size:
            starts = np.flatnonzero(np.diff(row[order], prepend=-1))
            is_next = np.arange(len(order)) - np.repeat(starts, np.diff(starts, append=len(order))) < count
            chosen = order[is_next]
            turns = igl.winding_number(self.body.vertices, self.body.faces, np.ascontiguousarray(points[chosen]))
            hits = chosen[turns > 0.5]
            np.maximum.at(largest, row[hits], depth[hits])
            order, count = order[~is_next], MORE_POINTS * count

    def behind(
        self, motion: np.ndarray, other: "BodyFace", outward: np.ndarray, raised: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return rows and indices of the points of another face that may lie behind this one after its motion.

        Behind a flat face these are the points more than ROUNDED behind its plane, which are few where faces touch. If all
        triangles of the face approximate analytic surfaces, they are the points behind any of these surfaces; otherwise all.

        motion    (row, 12)
        outward   (row,) [mm]: outward offset of the points from their face, or a bound of it
        raised    (row,) [mm]: outward offset of this face from its nominal position, or a bound of it
        """
        if self.plane is None:
            return self._behind_round(motion, other, np.abs(outward) + np.abs(raised))
        n, height = self.plane
        turned = n @ pose.rotation(motion)
        level = turned @ other.points.T + (pose.translation(motion) @ n - height - raised)[:, None]
        if outward.any():
            level += outward[:, None] * (turned @ other.normals.T)
        row, point = np.nonzero(level < -ROUNDED)
        return row, point

    def _behind_round(self, motion: np.ndarray, other: "BodyFace", outward: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return rows and indices as `behind` does, for a face that is not flat."""
        if len(self.face.unknown.mesh.faces):
            row, point = np.indices((len(motion), len(other.points)))
            return row.ravel(), point.ravel()
        R, t = pose.rotation(motion), pose.translation(motion)
        is_near = np.zeros((len(motion), len(other.points)), dtype=bool)
        for surface, is_hollow, _ in self.face.pieces:
            along, *across = np.linalg.svd(surface.axis[None])[2]
            axes = np.array([*across, along if along @ surface.axis > 0 else -along])
            coordinates = (axes @ R) @ other.points.T + ((t - surface.origin) @ axes.T)[..., None]
            level = surface.height_beside_axis(np.hypot(coordinates[:, 0], coordinates[:, 1]), coordinates[:, 2])
            is_near |= (-level if is_hollow else level) < outward[:, None]
        row, point = np.nonzero(is_near)
        return row, point

    def projections(self, points: np.ndarray, turns: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the projections (k, 3) [mm] of points (k, 3) at which this face's form deviation counts, and inward normals.

        turns     (k, 3, 3): rotations of the other face
        normals   (k, 3) of the other face before its rotation; rotated, they are the inward normals of a face that is not flat
        """
        if self.plane is None:
            return points, np.einsum("kij,kj->ki", turns, normals)
        n, height = self.plane
        return points - (points @ n - height)[:, None] * n, np.broadcast_to(-n, points.shape)

    def _is_behind(self, points: np.ndarray) -> np.ndarray:
        """Return a mask (point,) of the points (point, 3) [mm] that may lie behind this face."""
        if not self.face.pieces or len(self.face.unknown.mesh.faces):
            return np.ones(len(points), dtype=bool)
        return np.any(
            [surface.distance(points)[0] * (-1 if hollow else 1) < 0 for surface, hollow, _ in self.face.pieces], axis=0
        )

    @cached_property
    def _bulge(self) -> float:
        """The largest distance [mm] of analytic surfaces from the body's flat triangles."""
        return max((piece.face.chord_height for piece in self.face.pieces), default=0.0)


class PairForm(Protocol):
    """The form deviations of both faces of a pair."""

    def take(self, rows: slice | np.ndarray) -> "PairForm":
        """Return the form deviations of some rows."""

    def at_face(self, k: int, row: np.ndarray, places: np.ndarray) -> np.ndarray:
        """Return the form deviation (k,) [mm] of one face at `places` (k, 3), each in its own row; face 0 is the moving one."""

    def highest(self) -> np.ndarray:
        """Return upper bounds (face, row) [mm] of the form deviations of both faces."""


@dataclass(frozen=True, eq=False)
class FacePair:
    """The faces of a pair, for checks at any pose. Depths up to `rounding` [mm], the coordinate error of files, are ignored."""

    moving: BodyFace
    reference: BodyFace
    rounding: float = 0.0

    def penetrate(self, X_RM: np.ndarray, heights: np.ndarray, form: PairForm | None = None) -> np.ndarray:
        """Return whether (row,) either face penetrates the other body at X_RM (row, 12); `heights` and `form` as in `depth`."""
        hits = np.zeros(len(X_RM), dtype=bool)
        for every in (THINNED, 1):
            rows = np.flatnonzero(~hits)
            row_form = None if form is None else form.take(rows)
            hits[rows] = self.depth(X_RM[rows], heights[rows], row_form, every=every) > 0
        return hits

    def depth(self, X_RM: np.ndarray, heights: np.ndarray, form: PairForm | None = None, *, every: int = 1) -> np.ndarray:
        """Return the largest depth (row,) [mm] of either face in the other's body at X_RM (row, 12).

        `heights` (row,) [mm] is the sum of the outward offsets of both faces; each face counts it in full. With a `form`, the
        local form deviations of both faces are added. Of the points that may lie inside, one in `every` is checked.
        """
        largest = np.zeros(len(X_RM))
        highest = np.zeros((2, len(X_RM))) if form is None else form.highest()
        sides = self.moving, self.reference
        for start in range(0, len(X_RM), POSES_PER_BLOCK):
            rows = slice(start, start + POSES_PER_BLOCK)
            X = X_RM[rows]
            for k, (side, body, motion) in enumerate(zip(sides, sides[::-1], (X, pose.inverse(X)), strict=True)):
                row, point = (
                    numbers[::every]
                    for numbers in body.behind(motion, side, heights[rows] + highest[k, rows], highest[1 - k, rows])
                )
                if row.size:
                    points, outward = side.points[point], heights[rows][row]
                    if form is not None:
                        row_form = form.take(rows)
                        outward = outward + row_form.at_face(k, row, points)
                    displaced = _moved(motion, row, points + outward[:, None] * side.normals[point])
                    if form is not None:
                        projections, towards = body.projections(
                            _moved(motion, row, points), pose.rotation(motion)[row], side.normals[point]
                        )
                        displaced += row_form.at_face(1 - k, row, projections)[:, None] * towards
                    body.raise_to_depths(largest[rows], row, displaced)
        return np.maximum(largest - self.rounding, 0) if self.rounding else largest


def _moved(motion: np.ndarray, row: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points (k, 3), each moved by the motion (row, 12) of its row (k,)."""
    return np.asarray(np.einsum("kij,kj->ki", pose.rotation(motion)[row], points) + pose.translation(motion)[row])


def body_face(face: Surface, body: trimesh.Trimesh, contacts: int) -> BodyFace:
    """Return a face and its body, for a pair with `contacts` contact points."""
    count = min(max(MIN_POINTS, contacts * DENSITY**2), MAX_POINTS)
    step = float(np.sqrt(face.mesh.area / count))
    points = unique_points(_spread(face.mesh, step, count))
    if len(points) > MAX_POINTS:
        points = points[np.random.default_rng(0).choice(len(points), MAX_POINTS, replace=False)]
    plane = _plane_of(face)
    if plane is not None:
        return BodyFace(face, SolidBody(body), points, np.broadcast_to(plane[0], points.shape), plane)
    projections, normals, _ = face.project(points)
    return BodyFace(face, SolidBody(body), projections if face.surfaces else points, normals, None)


def _plane_of(face: Surface) -> tuple[np.ndarray, float] | None:
    normals = face.corner_normals.reshape(-1, 3)
    n = normals.mean(axis=0)
    length = np.linalg.norm(n)
    if length < MIN_MEAN:
        return None
    n /= length
    return (n, float((face.mesh.vertices @ n).max())) if (normals @ n).min() > 1 - 1e-12 else None


def _spread(mesh: trimesh.Trimesh, step: float, count: int) -> np.ndarray:
    """Return points (point, 3) of a face about `step` [mm] apart, including its rim and vertices.

    Where halving the edges of long slivers would give too many points, `count` random points inside are used, with a fixed
    seed.
    """
    vertices, corners = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    if (4.0 ** np.ceil(np.log2(np.maximum(longest / step, 1)))).sum() <= MAX_HALVED * count:
        return subdivided(vertices, mesh.faces, step)[0]
    inside, _ = trimesh.sample.sample_surface(mesh, count, seed=0)
    return np.concatenate([vertices, inside, _along(vertices[rim(mesh.faces)], step)])


def _along(edges: np.ndarray, step: float) -> np.ndarray:
    """Return points (point, 3) at most a `step` [mm] apart on edges (edge, end, 3), including their ends."""
    vectors = edges[:, 1] - edges[:, 0]
    parts = np.ceil(np.linalg.norm(vectors, axis=1) / step).astype(int)
    edge = np.repeat(np.arange(len(edges)), parts)
    share = (np.arange(len(edge)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[edge]
    return np.concatenate([edges[edge, 0] + share[:, None] * vectors[edge], edges[:, 1]])
