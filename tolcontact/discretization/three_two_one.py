"""A 3-2-1 scheme on three faces becomes six locators."""

import numpy as np

from tolcontact.declaration import Face, Locator, ThreeTwoOne
from tolcontact.errors import GeometryFault
from tolcontact.geometry.faces import Meshes, patch

LABELS = ("A1", "A2", "A3", "B1", "B2", "C1")


def lay_out(scheme: ThreeTwoOne, meshes: Meshes) -> tuple[Locator, ...]:
    """The six locators of a 3-2-1 scheme, in the part's own frame; directions point into the part.

    Each face is taken as its bounding rectangle along the edges that it shares with the other two.
    Raises GeometryFault if the faces are not three independent ones, or the inset leaves no room.
    """
    corners, normals = zip(*(_frame(face, meshes) for face in scheme.faces), strict=True)
    outward = np.array(normals)
    if abs(np.linalg.det(outward)) < 0.1:
        raise GeometryFault(
            "the three faces of its 3-2-1 scheme are not independent; choose faces at wide angles to each other"
        )
    # Coordinates a, b, c along edge directions: dual to the normals, so that stepping along one stays on the other two.
    edges = -np.linalg.inv(outward).T
    edges /= np.linalg.norm(edges, axis=1, keepdims=True)
    a, b, c = edges
    primary, secondary, tertiary = corners
    near_c, far_c = _stations(primary, c, scheme.inset)
    near_b, far_b = _stations(primary, b, scheme.inset)
    side_near, side_far = _stations(secondary, c, scheme.inset)
    points = [
        _place(edges, outward, primary, 0, {1: near_b, 2: near_c}),
        _place(edges, outward, primary, 0, {1: near_b, 2: far_c}),
        _place(edges, outward, primary, 0, {1: far_b, 2: (near_c + far_c) / 2}),
        _place(edges, outward, secondary, 1, {0: _middle(secondary, a), 2: side_near}),
        _place(edges, outward, secondary, 1, {0: _middle(secondary, a), 2: side_far}),
        _place(edges, outward, tertiary, 2, {0: _middle(tertiary, a), 1: _middle(tertiary, b)}),
    ]
    directions = -outward[[0, 0, 0, 1, 1, 2]]
    return tuple(Locator(label, p, n) for label, p, n in zip(LABELS, points, directions, strict=True))


def _frame(face: Face, meshes: Meshes) -> tuple[np.ndarray, np.ndarray]:
    own = patch(face, meshes).mesh
    normal = own.area_faces @ own.face_normals
    return np.asarray(own.vertices), normal / np.linalg.norm(normal)


def _stations(points: np.ndarray, along: np.ndarray, inset: float) -> tuple[float, float]:
    reach = points @ along
    near, far = reach.min() + inset, reach.max() - inset
    if not near < far:
        raise GeometryFault(
            f"an inset of {inset:g} mm leaves no room on a face that is {reach.max() - reach.min():g} mm long; make it smaller"
        )
    return near, far


def _middle(points: np.ndarray, along: np.ndarray) -> float:
    reach = points @ along
    return float(reach.min() + reach.max()) / 2


def _place(edges: np.ndarray, outward: np.ndarray, points: np.ndarray, face: int, stations: dict[int, float]) -> np.ndarray:
    """The point on the plane of `face` whose coordinates along the given edges are `stations`."""
    rows = [outward[face], *(edges[axis] for axis in stations)]
    return np.linalg.solve(np.array(rows), np.array([float((points @ outward[face]).max()), *stations.values()]))
