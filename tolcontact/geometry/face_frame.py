"""The frame of a face. It rotates with the face, so that comparisons in it do not depend on the pose of the face."""

from typing import NamedTuple

import numpy as np
import trimesh

from tolcontact.geometry.triangle_mesh import rim, subdivided

TIE = 1e-6  # relative difference of lengths that are equal except for rounding
CELLS = 2.0**30  # in a length of about the face's size: coordinates are whole numbers of cells
OFF_POWER = 1.1  # keeps the sizes of usual faces off powers of 2, between which the size of cells doubles


class FaceFrame(NamedTuple):
    """A centre (3,) [mm], unit vectors (3, 3) in columns, and the size [mm] of the cells for rounding coordinates."""

    centre: np.ndarray
    axes: np.ndarray
    cell: float
    rounds: bool = True

    def coordinates(self, points: np.ndarray) -> np.ndarray:
        """Return the coordinates (point, 3) [cell] of points (point, 3) [mm], optionally rounded to hide earlier rounding."""
        coordinates = (points - self.centre) @ self.axes / self.cell
        return np.round(coordinates) if self.rounds else coordinates

    def subdivided(self, vertices: np.ndarray, faces: np.ndarray, max_edge: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return vertices (vertex, 3) [mm], faces (face, 3) with edges of at most `max_edge` [mm], and coordinates (vertex, 3).

        Only the coordinates [cell] decide which edges are halved.
        """
        rows = np.hstack([self.coordinates(vertices), vertices])
        rows, faces, _ = subdivided(rows, faces, max_edge / self.cell)
        return np.ascontiguousarray(rows[:, 3:]), faces, np.ascontiguousarray(rows[:, :3])


def face_frame(mesh: trimesh.Trimesh) -> FaceFrame:
    """Return the frame of the triangles of a face.

    Its origin is the centroid of the area. The first axis is along the longest edge of the rim, or of the triangles of a closed
    face; the second points towards the corner that is farthest from the first. Where several are equal, as on symmetric
    faces, the first in the order of the triangles is used.
    """
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    triangles = vertices[faces]
    areas = trimesh.triangles.area(triangles)
    centre = areas @ triangles.mean(axis=1) / areas.sum()
    ends = vertices[rim(faces)] if len(rim(faces)) else triangles[:, :2]
    u = _longest(ends[:, 1] - ends[:, 0])
    u /= np.linalg.norm(u)
    offsets = triangles.reshape(-1, 3) - centre
    v = _longest(offsets - (offsets @ u)[:, None] * u)
    v /= np.linalg.norm(v)
    size = 2.0 ** np.floor(np.log2(OFF_POWER * np.linalg.norm(offsets, axis=1).max()))
    return FaceFrame(centre, np.stack([u, v, np.cross(u, v)], axis=1), size / CELLS)


def _longest(vectors: np.ndarray) -> np.ndarray:
    """Return the first (3,) of the longest vectors (vector, 3)."""
    lengths = np.linalg.norm(vectors, axis=1)
    return np.array(vectors[np.argmax(lengths >= (1 - TIE) * lengths.max())])
