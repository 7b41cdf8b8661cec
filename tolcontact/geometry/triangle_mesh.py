"""Triangle meshes: edges and creases, subdivision, quadrature, boxes, search trees, and the rounding of stored coordinates."""

from collections.abc import Iterator

import igl
import numpy as np
import trimesh

from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.geometry.tolerances import ROUNDING

CREASE = np.cos(np.radians(30.0))  # facets that meet at a wider angle are two faces; else they approximate one curved face
SHARP_ANGLE = 1e-5  # rad: facets whose normals differ by less are one plane
MAX_ROUNDS = 30  # of subdivision; each halves the longest edges
SHIFT = 32  # bits of a vertex index in the key of an edge
BLOCK_PAIRS = 1_000_000
COORDINATE_SPACING = "coordinate_spacing"  # in the metadata of a mesh: (3,) [mm], of coordinates in its file; none if exact


def edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the three edges of each of `faces` (face, 3), one face after the other.

    The result is their ends (3 face, 2) in the sense of their triangle, the index of each edge (3 face,), and the number of
    triangles at each edge (edge,): one on the rim, two inside.
    """
    ends = np.asarray(faces, dtype=np.int64)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    key = ends.min(axis=1) * (int(ends.max(initial=0)) + 1) + ends.max(axis=1)
    _, edge, triangles = np.unique(key, return_inverse=True, return_counts=True)
    return ends, edge, triangles


def oriented(faces: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return `faces` (face, 3, ...) with the order of corners in which normals point outward at R (3, 3), which may mirror."""
    return faces[:, [0, 2, 1]] if np.linalg.det(R) < 0 else faces


def placed_mesh(vertices: np.ndarray, faces: np.ndarray, R: np.ndarray, t: np.ndarray) -> trimesh.Trimesh:
    """Return a mesh rotated or mirrored by R (3, 3), then translated by t (3,) [mm]."""
    return trimesh.Trimesh(np.asarray(vertices) @ R.T + t, oriented(np.asarray(faces), R), process=False)


def into_facets(ends: np.ndarray, normals: np.ndarray, centres: np.ndarray) -> np.ndarray:
    """Return unit vectors (edge, 2, 3) across edges with ends (edge, 2, 3), into the two facets that meet at each.

    normals, centres   (edge, 2, 3): the unit normal and a point of each facet
    """
    along = (ends[:, 1] - ends[:, 0]) / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None]
    into = np.cross(normals, along[:, None])
    return np.asarray(into * np.where((into * (centres - ends[:, :1])).sum(axis=2) < 0, -1.0, 1.0)[..., None])


def have_area(mesh: trimesh.Trimesh) -> Bool[Array, " face"]:
    """Return which triangles of a mesh have an area that exceeds its rounding, and so a normal."""
    corners = np.asarray(mesh.triangles)
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1, initial=0.0)
    return np.asarray(mesh.area_faces > ROUNDING * mesh.scale * longest / 2)


def on_rim(faces: np.ndarray) -> np.ndarray:
    """Return a mask (face, 3) of the edges of `faces` (face, 3) that belong to one triangle only."""
    _, edge, triangles = edges(faces)
    return (triangles[edge] == 1).reshape(-1, 3)


def rim(faces: np.ndarray) -> np.ndarray:
    """Return the ends (edge, 2) of the edges of the rim."""
    ends, edge, triangles = edges(faces)
    return ends[triangles[edge] == 1]


def distinct_triangles(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices (distinct,) of the distinct triangles in `faces` (face, 3), and the position of each face among them.

    Triangles are the same if they have the same corners in the same sense.
    """
    lowest = np.argmin(faces, axis=1)
    turned = np.take_along_axis(faces, (lowest[:, None] + np.arange(3)) % 3, axis=1)
    return trimesh.grouping.unique_rows(turned)


def smooth_pieces(mesh: trimesh.Trimesh, indices: np.ndarray) -> np.ndarray:
    """Return the smooth piece of each triangle in `indices` (face,), from 0: no two neighbours in a piece meet in a crease."""
    position = np.full(len(mesh.faces), -1)
    position[indices] = np.arange(len(indices))
    pairs = position[np.asarray(mesh.face_adjacency)].reshape(-1, 2)
    smooth = (pairs >= 0).all(axis=1) & (np.cos(np.asarray(mesh.face_adjacency_angles)) > CREASE)
    return np.asarray(trimesh.graph.connected_component_labels(pairs[smooth], node_count=len(indices)))


def subdivided(
    vertices: Float[Array, "v k"], faces: Int[Array, "f 3"], max_edge: float
) -> tuple[Float[Array, "w k"], Int[Array, "g 3"], Int[Array, " g"]]:
    """Return vertices (vertex, k), faces (face, 3) without edges longer than `max_edge`, and the original (face,) of each.

    The first three columns of the vertices are the coordinates that decide which edges are halved. A triangle is divided into
    two, three or four at the midpoints of its long edges. Of the two divisions into three, the one with the shorter diagonal is
    used. Each round only considers the triangles that the previous round divided.

    Raises ValueError if triangles have long edges after MAX_ROUNDS rounds.
    """
    vertices, faces = np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.int64)
    origin = np.arange(len(faces))
    done, origins = list[np.ndarray](), list[np.ndarray]()
    for _ in range(MAX_ROUNDS + 1):
        components = (column[faces] for column in vertices.T[:3])
        is_long = np.sqrt(sum((corners[:, [1, 2, 0]] - corners) ** 2 for corners in components)) > max_edge
        divides = is_long.any(axis=1)
        done.append(faces[~divides])
        origins.append(origin[~divides])
        if not divides.any():
            return vertices, np.concatenate(done), np.concatenate(origins)
        faces, origin, is_long = faces[divides], origin[divides], is_long[divides]
        starts, ends = faces[is_long], faces[:, [1, 2, 0]][is_long]
        keys, number = np.unique(np.maximum(starts, ends) << SHIFT | np.minimum(starts, ends), return_inverse=True)
        midpoints = np.zeros_like(faces)
        midpoints[is_long] = len(vertices) + number
        vertices = np.concatenate([vertices, (vertices[keys & (1 << SHIFT) - 1] + vertices[keys >> SHIFT]) / 2])
        faces, rows = _pieces(vertices, faces, midpoints, is_long)
        origin = origin[rows]
    raise ValueError(f"triangles have edges longer than {max_edge:g} after {MAX_ROUNDS} rounds of halving")


def _pieces(
    vertices: np.ndarray, faces: np.ndarray, midpoints: np.ndarray, is_long: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the pieces (piece, 3) of faces (face, 3), and the row (piece,) of each piece's face.

    midpoints   (face, 3) vertex indices of the midpoints of the edges marked in `is_long` (face, 3)
    """
    count = is_long.sum(axis=1)
    single, double, triple = (np.flatnonzero(count == k) for k in (1, 2, 3))
    # One long edge runs from a to b; two long edges run from a to b and from b to c.
    (a, b, c), (p, _, _) = _turned(faces[single], midpoints[single], is_long[single].argmax(axis=1))
    halves = np.stack([a, p, c, p, b, c], axis=1).reshape(-1, 3)
    (a, b, c), (p, q, _) = _turned(faces[double], midpoints[double], is_long[double].argmin(axis=1) + 1)
    from_a, from_c = (((vertices[i, :3] - vertices[j, :3]) ** 2).sum(axis=1) for i, j in ((a, q), (c, p)))
    is_from_a = from_a <= from_c
    tips = np.stack([p, b, q], axis=1)
    trunks = np.stack([a, p, np.where(is_from_a, q, c)], axis=1), np.stack([np.where(is_from_a, a, p), q, c], axis=1)
    (a, b, c), (p, q, r) = faces[triple].T, midpoints[triple].T
    quarters = np.stack([a, p, r, p, b, q, r, q, c, p, q, r], axis=1).reshape(-1, 3)
    rows = np.concatenate([single.repeat(2), np.tile(double, 3), triple.repeat(4)])
    return np.concatenate([halves, tips, *trunks, quarters]), rows


def _turned(faces: np.ndarray, midpoints: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners (3, face) of faces (face, 3) and the midpoints (3, face) of their edges, from corner `first` on."""
    order = (first[:, None] + np.arange(3)) % 3
    return np.take_along_axis(faces, order, axis=1).T, np.take_along_axis(midpoints, order, axis=1).T


def quadrature(mesh: trimesh.Trimesh, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points (point, 3) [mm] of a face about `step` [mm] apart, and the areas (point,) [mm^2] that they represent."""
    vertices, faces, _ = subdivided(mesh.vertices, mesh.faces, 2 * step)
    points, numbers = np.unique(np.round(vertices, 9), axis=0, return_inverse=True)
    faces = numbers.reshape(-1)[faces]
    areas = trimesh.triangles.area(points[faces])
    return points, np.bincount(faces.ravel(), np.repeat(areas / 3, 3), minlength=len(points))


def overlaps(
    lower: Float[Array, "n 3"], upper: Float[Array, "n 3"], low: Float[Array, "m 3"], high: Float[Array, "m 3"]
) -> Bool[Array, "n m"]:
    """Return whether (n, m) boxes from `lower` to `upper` overlap boxes from `low` to `high`."""
    mask = np.ones((len(lower), len(low)), dtype=bool)
    for axis in range(3):
        mask &= (lower[:, axis, None] <= high[:, axis]) & (upper[:, axis, None] >= low[:, axis])
    return mask


def blocks(count: int, width: int) -> Iterator[slice]:
    """Yield blocks of the rows of a table (count, width), each with a limited number of entries."""
    rows = max(BLOCK_PAIRS // max(width, 1), 1)
    for start in range(0, count if width else 0, rows):
        yield slice(start, min(start + rows, count))


def triangle_tree(vertices: np.ndarray, faces: np.ndarray) -> igl.AABB:
    """Return the search tree of triangles: vertices (vertex, 3) [mm] and faces (face, 3), both contiguous."""
    tree = igl.AABB()
    tree.init(vertices, faces)
    return tree


def coordinate_spacing(mesh: trimesh.Trimesh) -> np.ndarray:
    """Return the spacing (3,) [mm] of the coordinates that a mesh's file stores; zeros if it rounds none."""
    return np.asarray(mesh.metadata.get(COORDINATE_SPACING, np.zeros(3)))


def coordinate_error(mesh: trimesh.Trimesh) -> float:
    """Return the largest displacement [mm] of a point of a mesh caused by the rounding of coordinates in its file.

    The error of a vertex is e, with |e_i| at most half the spacing along axis i, so |e| is at most half the length of the
    spacing vector. A point of a triangle is a convex combination of its corners, and so is its error: within their triangles,
    planes have no larger errors than vertices. Two bodies that touch as drawn therefore penetrate each other, as stored, by no
    more than the sum of their errors, in any direction.
    """
    return float(np.linalg.norm(coordinate_spacing(mesh))) / 2
