"""Contact points on a surface: spread evenly, by count or by spacing, or the vertices of the mesh (paper, 2.2).

The frame of a face rotates with the face, so that comparisons in it do not depend on the pose of the face.
"""

from typing import NamedTuple

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from tolcontact.geometry.tolerances import SAME_DIRECTION
from tolcontact.geometry.triangle_mesh import rim, subdivided

TIE = 1e-6  # relative difference of lengths that are equal except for rounding
CELLS = 2.0**30  # in a length of about the face's size: coordinates are whole numbers of cells
OFF_POWER = 1.1  # keeps the sizes of usual faces off powers of 2, between which the size of cells doubles
CANDIDATES_PER_SPACING = 2.0
MAX_CANDIDATES_PER_POINT = 50  # above this, candidates are thinned out
BLOCK_CANDIDATES = 512
CORNER_ANGLE = np.radians(30.0)


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


PART_FRAME = FaceFrame(np.zeros(3), np.eye(3), 1.0, rounds=False)


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


def spread(surface: trimesh.Trimesh, count: int | None, spacing: float | None) -> np.ndarray:
    """Return points (point, 3) [mm] on `surface`, each as far as possible from the previous points.

    There are `count` points, or enough points that none of the surface is further than `spacing` [mm] from one. They start with
    the corners of the rim, where contact occurs first, and continue in farthest-point order over a fine subdivision of the
    triangles. On a flat face distances are compared in its own frame, so that a rotated face keeps its points. On a curved face
    equal distances differ by rounding: points in straight rows would let a shaft roll between them.
    """
    step = spacing if spacing is not None else float(np.sqrt(surface.area / count))  # type: ignore[operator]
    is_flat = np.ptp(np.asarray(surface.face_normals), axis=0).max() < SAME_DIRECTION
    frame = face_frame(surface) if is_flat else PART_FRAME
    vertices, faces, candidates = frame.subdivided(surface.vertices, surface.faces, step / CANDIDATES_PER_SPACING)
    if len(candidates) > MAX_CANDIDATES_PER_POINT * max(surface.area / step**2, 1):
        thinned = _thinned(candidates, faces, step / (2 * CANDIDATES_PER_SPACING) / frame.cell)
        vertices, candidates = vertices[thinned], candidates[thinned]
    coordinates = frame.coordinates(surface.vertices)
    corners = np.flatnonzero(_are_corners(coordinates, np.asarray(surface.faces)))
    corners = corners[_separated(coordinates[corners], step / CANDIDATES_PER_SPACING / frame.cell)]
    if not len(corners) or (count is not None and len(corners) > count):
        centre = (candidates.min(axis=0) + candidates.max(axis=0)) / 2
        numbers = [int(np.argmax(((candidates - centre) ** 2).sum(axis=1)))]
    else:
        vertices, candidates = np.vstack([surface.vertices[corners], vertices]), np.vstack([coordinates[corners], candidates])
        numbers = list(range(len(corners)))
    numbers = _farthest(candidates, numbers, count, None if spacing is None else spacing / frame.cell)
    return np.asarray(vertices)[numbers]


def _farthest(candidates: np.ndarray, numbers: list[int], count: int | None, spacing: float | None) -> list[int]:
    """Return the indices of candidates (candidate, 3), `numbers` first, each as far as possible from the previous ones."""
    numbers = list(numbers)
    distance2 = np.min([((candidates - candidates[number]) ** 2).sum(axis=1) for number in numbers], axis=0)
    tree = cKDTree(candidates)
    # The farthest candidate is the maximum over the blocks' farthest candidates: a new point changes few blocks.
    blocks = np.full((-(-len(candidates) // BLOCK_CANDIDATES), BLOCK_CANDIDATES), -1.0)
    distances = blocks.reshape(-1)[: len(candidates)]
    distances[:] = distance2
    largest = blocks.max(axis=1)
    while True:
        block = int(np.argmax(largest))
        farthest = BLOCK_CANDIDATES * block + int(np.argmax(blocks[block]))
        if (len(numbers) == count) if spacing is None else (distances[farthest] <= spacing**2):
            return numbers
        numbers.append(farthest)
        # No candidate is further from the points than this one, so it changes nothing beyond that distance.
        reach = np.sqrt(distances[farthest]) * (1 + 1e-9)
        neighbours = np.asarray(tree.query_ball_point(candidates[farthest], reach, return_sorted=False))
        distance2 = ((candidates[neighbours] - candidates[farthest]) ** 2).sum(axis=1)
        distances[neighbours] = np.minimum(distances[neighbours], distance2)
        changed = np.flatnonzero(np.bincount(neighbours // BLOCK_CANDIDATES, minlength=len(blocks)))
        largest[changed] = blocks[changed].max(axis=1)


def _thinned(points: np.ndarray, faces: np.ndarray, cell: float) -> np.ndarray:
    """Return the index of one of the points (point, 3) in each cube of side `cell`, if possible a point on the rim."""
    inner = np.ones(len(points), dtype=bool)
    inner[rim(faces).ravel()] = False
    order = np.argsort(inner, kind="stable")
    unique, _ = trimesh.grouping.unique_rows(np.floor(points[order] / cell).astype(np.int64))
    return np.asarray(order[np.sort(unique)])


def _separated(points: np.ndarray, min_distance: float) -> list[int]:
    """Return the indices of points (point, 3) at least `min_distance` from earlier ones: corners of a jagged rim are merged."""
    separated: list[int] = []
    for number, point in enumerate(points):
        if all(((point - points[earlier]) ** 2).sum() >= min_distance**2 for earlier in separated):
            separated.append(number)
    return separated


def _are_corners(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return a mask (vertex,) of the vertices (vertex, 3) [cell] at which a rim turns by more than CORNER_ANGLE."""
    start, end = rim(faces).T
    along = vertices[end] - vertices[start]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1)  # edges shorter than a cell have no direction
    # Where the rim is straight, the unit vectors to both neighbours cancel.
    turn, rims = np.zeros_like(vertices), np.zeros(len(vertices))
    np.add.at(turn, start, along)
    np.add.at(turn, end, -along)
    np.add.at(rims, np.concatenate([start, end]), 1)
    return np.asarray((rims == 2) & (np.linalg.norm(turn, axis=1) > 2 * np.sin(CORNER_ANGLE / 2)))


def unique_points(points: np.ndarray) -> np.ndarray:
    """Return points (point, 3), each once, sorted by their coordinates. NumPy's `unique` takes several times as long."""
    points = points[np.lexsort(points.T[::-1])]
    is_new = np.append(True, (points[1:] != points[:-1]).any(axis=1))[: len(points)]
    return np.asarray(points[is_new])
