"""The faces of a 3-2-1 scheme, and points on their material for its locators."""

from dataclasses import dataclass

import numpy as np

from tolcontact.declaration import Face
from tolcontact.errors import GeometryFault
from tolcontact.features import Placement
from tolcontact.geometry.analytic_surfaces import axes_across
from tolcontact.geometry.faces import Meshes, patch
from tolcontact.geometry.tolerances import SAME_PLACE
from tolcontact.geometry.triangle_mesh import rim

CLOSE = 1e-3  # of a face's size: points that are closer to the material are on it
DIVISIONS = 37  # candidates along each side of the bounding rectangle
ROUNDS = 8  # of moves of each point
TIE = 1e-9  # of the widest support
MAX_PAIRS = 1 << 21  # of points and triangles that are compared at once


@dataclass(frozen=True, eq=False)
class LocatingFace:
    """A face seen along its outward normal.

    name      of the face
    vertices  (vertex, 3) [mm]
    faces     (triangle, 3) vertex indices
    outward   (3,): the mean outward normal
    """

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    outward: np.ndarray

    @classmethod
    def of(cls, face: Face, meshes: Meshes, placement: Placement | None = None) -> "LocatingFace":
        """Return a face in its part's own frame, or with a placement of the part."""
        mesh = patch(face, meshes).mesh
        vertices, normal = np.asarray(mesh.vertices), mesh.area_faces @ mesh.face_normals
        outward = normal / np.linalg.norm(normal)
        if placement is not None:
            R, t = placement
            vertices, outward = vertices @ R.T + t, R @ outward
        return cls(str(face), vertices, np.asarray(mesh.faces), outward)

    @property
    def axes(self) -> np.ndarray:
        """Two unit vectors (2, 3) perpendicular to the outward normal."""
        return axes_across(self.outward)

    @property
    def size(self) -> float:
        """The diagonal of the bounding box [mm]."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    def on_material(self, points: np.ndarray, inset: float, along: np.ndarray | None) -> np.ndarray:
        """Return points (k, 3) [mm] of the bounding rectangle on the material of the face.

        A point that has material below it moves along the outward normal alone. Any other moves to where the support is
        widest, at least `inset` from all edges: three points span the largest triangle, two have the largest distance `along`
        an edge (3,), one stays as close as possible, which also decides between supports of equal width. Raises GeometryFault
        if there is no such point.
        """
        heights = self._heights(points @ self.axes.T, CLOSE * self.size)
        outside = np.flatnonzero(np.isnan(heights))
        places = points
        if len(outside):
            candidates = self._candidates(inset)
            if not len(candidates):
                raise GeometryFault(
                    f"{len(outside)} of {len(points)} points of its 3-2-1 scheme lie beside the material of face {self.name}, "
                    f"and no place on the face is {inset:g} mm from its edges; make the inset smaller, or state the locators"
                )
            places = self._spread(points, outside, candidates, along)
            heights[outside] = self._heights(places[outside] @ self.axes.T, CLOSE * self.size)
        lifts = heights - places @ self.outward
        lifts[np.abs(lifts) <= CLOSE * self.size] = 0.0
        return np.asarray(places + lifts[:, None] * self.outward)

    def _spread(self, points: np.ndarray, outside: np.ndarray, candidates: np.ndarray, along: np.ndarray | None) -> np.ndarray:
        """Return points (k, 3); those outside the material move to candidates (n, 3) of the widest support, one at a time."""
        places = points.copy()
        for _ in range(ROUNDS):
            before = places.copy()
            for number in outside:
                supports = np.repeat(places[None], len(candidates), axis=0)
                supports[:, number] = candidates
                widths = self._width(supports, along)
                widest = candidates[widths >= (1 - TIE) * widths.max()]
                places[number] = widest[np.linalg.norm(widest - points[number], axis=1).argmin()]
            if np.array_equal(places, before):
                break
        return places

    def _width(self, support: np.ndarray, along: np.ndarray | None) -> np.ndarray:
        """Return the widths (n,) of supports (n, k, 3): twice the area of a triangle, a length, or 0 for one point."""
        if along is not None:
            return np.asarray(np.abs((support[:, 1] - support[:, 0]) @ along))
        if support.shape[1] == 1:
            return np.zeros(len(support))
        sides = support[:, 1:] - support[:, :1]
        return np.asarray(np.abs(np.cross(sides[:, 0], sides[:, 1]) @ self.outward))

    def _heights(self, places: np.ndarray, margin: float) -> np.ndarray:
        """Return the heights (n,) [mm] of the outermost material at places (n, 2) on the axes; NaN outside the material."""
        corners, levels = (self.vertices @ self.axes.T)[self.faces], (self.vertices @ self.outward)[self.faces]
        sides = np.roll(corners, -1, axis=1) - corners
        area = sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]
        regular = np.abs(area) > (SAME_PLACE * self.size) ** 2
        corners, levels, sides, area = corners[regular], levels[regular], sides[regular], area[regular]
        heights = np.full(len(places), np.nan)
        lengths = np.linalg.norm(sides, axis=2)
        for rows in np.array_split(np.arange(len(places)), len(places) * len(corners) // MAX_PAIRS + 1):
            offsets = places[rows, None, None] - corners  # (row, triangle, corner, 2)
            inward = (sides[..., 0] * offsets[..., 1] - sides[..., 1] * offsets[..., 0]) * np.sign(area)[:, None]
            weights = np.clip(np.roll(inward, -1, axis=2) / np.abs(area)[:, None], 0, 1)
            values = (weights * levels).sum(axis=2) / weights.sum(axis=2)
            values[(inward < -margin * lengths).any(axis=2)] = -np.inf
            highest = values.max(axis=1)
            heights[rows] = np.where(np.isfinite(highest), highest, np.nan)
        return heights

    def _candidates(self, inset: float) -> np.ndarray:
        """Return places (n, 3) [mm] on the material at least `inset` from all edges: vertices, and a lattice."""
        flat = self.vertices @ self.axes.T
        lower, upper = flat.min(axis=0) + inset, flat.max(axis=0) - inset
        lattice = np.stack(np.meshgrid(*np.linspace(lower, upper, DIVISIONS).T), axis=-1).reshape(-1, 2)
        places = np.concatenate([flat, lattice])
        heights = self._heights(places, SAME_PLACE * self.size)
        places, heights = places[~np.isnan(heights)], heights[~np.isnan(heights)]
        distant = self._distances_from_edges(places) >= inset - SAME_PLACE * self.size
        return places[distant] @ self.axes + heights[distant, None] * self.outward

    def _distances_from_edges(self, places: np.ndarray) -> np.ndarray:
        """Return the distances (n,) [mm] of places (n, 2) from the edges of the face."""
        cells = np.round(self.vertices / (SAME_PLACE * self.size))
        _, vertex, merged = np.unique(cells, axis=0, return_index=True, return_inverse=True)
        ends = (self.vertices @ self.axes.T)[vertex[rim(merged.ravel()[self.faces])]]
        distances = np.full(len(places), np.inf)
        for start, end in ends:
            side = end - start
            share = np.clip((places - start) @ side / max(float(side @ side), 1e-300), 0, 1)
            distances = np.minimum(distances, np.linalg.norm(places - start - share[:, None] * side, axis=1))
        return distances
