"""What a feature is, and how it can deviate: its coordinates, measured as displacements at its extremes. Part's own frame.

A plane has an offset in its middle and tilts at its edges, an axis shifts in its middle and tilts at its ends, a centre shifts.
So all of them are in mm, and do not depend on where the origin is.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Plane
from tolcontact.geometry.brep_face import FIT
from tolcontact.geometry.curvature import is_flat
from tolcontact.geometry.edges import smooth_pieces
from tolcontact.geometry.fault import GeometryFault
from tolcontact.geometry.fitting import nearest_surface
from tolcontact.geometry.surface import Surface

ALIKE = 1e-3  # of an area: rectangles of sizes nearer than that are alike
ALONG = 1e-6  # what a direction differs from an axis of the part by that is named after it
NOTICED = 1e-3  # of a displacement: how much of it a general surface must notice along its normals
EXTREMES = 4096  # displacements by which extremes of a general surface are found
ROUND = 32  # points around the end of a cone
OPPOSED = 1e-3  # rad: how far two planes may be from parallel
AXES = np.eye(3)
NONE = np.zeros(3)


@dataclass(frozen=True, eq=False)
class FeatureGeometry:
    """Kind and coordinates of a feature.

    kind     "plane", "cylinder", "cone", "sphere", "planes" (two opposed ones) or "general"
    centre   (3,) [mm] about which twists turn
    names    of the coordinates
    twists   (6, coordinate): the displacement (tau, rho) of the feature for a coordinate of 1 mm
    values   (coordinate, 6): the coordinates of a displacement (tau, rho)
    places   (point, 3) [mm] of its extremes: corners of a plane, ends of an axis, a centre, vertices of a general surface
    directions  (point, entry, 3): unit vectors along which it is measured there
    axis     (3,) normal of a plane, outward; direction of an axis
    half     [mm] half the length of an axis; else 0
    size     [mm] diameter or distance that it has nominally; else NaN
    normals  outward normals (3,) of its faces, if they are planes
    is_inner  whether its size is that of a gap in the material: a hole, a slot
    walls    places and directions along the normals of a cone's surface, by which its profile is measured
    nearest  of a general surface: the simple one that its vertices are least far off
    """

    kind: str
    centre: np.ndarray
    names: tuple[str, ...]
    twists: np.ndarray
    values: np.ndarray
    places: np.ndarray
    directions: np.ndarray
    axis: np.ndarray
    half: float
    size: float
    normals: tuple[np.ndarray, ...]
    is_inner: bool
    walls: tuple[np.ndarray, np.ndarray] | None = None
    nearest: AnalyticSurface | None = None

    @property
    def extremes(self) -> np.ndarray:
        """What is measured at its extremes, for coordinates of 1 mm: rows (point, entry, coordinate)."""
        return self.rows(self.places, self.directions)

    def rows(self, places: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """The same along `directions` (point, entry, 3) at `places` (point, 3)."""
        moved = self.twists[:3].T + np.cross(self.twists[3:].T, (places - self.centre)[:, None])
        return np.asarray(np.einsum("pqk,pek->peq", moved, directions))

    @property
    def said(self) -> str:
        """What it is, in words."""
        if self.nearest is not None:
            off = f"the nearest {self.nearest.kind} is off by up to {self.nearest.residual:.2g} mm, more than {FIT:g}"
            return f"a general surface ({off})"
        return "a pair of planes" if self.kind == "planes" else f"a {self.kind}"

    @property
    def reach(self) -> float:
        """How far [mm] its extremes are from its centre; of a sphere its radius."""
        return self.size / 2 if self.kind == "sphere" else float(np.linalg.norm(self.places - self.centre, axis=1).max())

    def about(self, centre: np.ndarray) -> np.ndarray:
        """`values` (coordinate, 6) of displacements that turn about another centre (3,)."""
        # x -> tau + rho x (x - centre) is x -> tau' + rho x (x - own centre), with tau' = tau + rho x (own centre - centre).
        shift = np.eye(6)
        shift[:3, 3:] = -_cross_matrix(self.centre - centre)
        return self.values @ shift

    @property
    def is_axis(self) -> bool:
        return self.kind in ("cylinder", "cone")

    @property
    def is_plane(self) -> bool:
        return self.kind in ("plane", "planes")

    def end(self, number: int) -> np.ndarray:
        """The end (3,) [mm] of its axis; of a sphere its centre."""
        return self.centre + (2 * number - 1) * self.half * self.axis


def feature_geometry(faces: Sequence[Surface]) -> FeatureGeometry:
    """What the faces of a feature are. Raises GeometryFault if one of them spans several surfaces, or two are not opposed."""
    surfaces = [_surface(face) for face in faces]
    if len(faces) == 2:
        return _planes(faces, surfaces)
    face, surface = faces[0], surfaces[0]
    if surface is None or surface.kind == "torus":
        return _general(face)
    if surface.kind == "plane":
        return _plane("plane", surface.origin, surface.axis, np.asarray(face.mesh.vertices), (surface.axis,), np.nan, False)
    if surface.kind == "sphere":
        is_inner = face.pieces[0].is_hollow
        names = tuple(f"shift {axis}" for axis in "xyz")
        T = np.vstack([AXES, np.zeros((3, 3))])
        return FeatureGeometry(
            "sphere", surface.origin, names, T, T.T, surface.origin[None], AXES[None], AXES[2], 0.0, 2 * surface.radius, (),
            is_inner,
        )  # fmt: skip
    return _axis(face, surface)


def _surface(face: Surface) -> AnalyticSurface | None:
    """The one surface that a face lies on; None of a general one."""
    if is_flat(face):
        corner = face.corner_normals.reshape(-1, 3).mean(axis=0)
        n = corner / np.linalg.norm(corner)
        stated = [surface for surface in face.surfaces if surface.kind == "plane"]
        if stated:
            n = stated[0].axis * np.sign(stated[0].axis @ n)
        height = float((np.asarray(face.mesh.vertices) @ n).mean()) if not stated else float(stated[0].origin @ n)
        return Plane(height * n, n)
    known = sorted({int(number) for number in face.surface_numbers})
    pieces = int(smooth_pieces(face.mesh, np.arange(len(face.mesh.faces))).max()) + 1
    if len(known) == 1 and known[0] >= 0:
        return face.surfaces[known[0]]
    kinds = [face.surfaces[number].kind if number >= 0 else "general" for number in known]
    if len(known) > 1 or pieces > 1:
        said = ", ".join(kinds) if len(known) > 1 else f"{pieces} faces with creases between them"
        raise GeometryFault(f"its face spans more than one surface ({said}); a feature is one of them, so choose one")
    return None


def _plane(
    kind: str,
    place: np.ndarray,
    n: np.ndarray,
    points: np.ndarray,
    normals: tuple[np.ndarray, ...],
    size: float,
    is_inner: bool,
) -> FeatureGeometry:
    """Of a plane with normal n, as large as `points` (point, 3) on it: tilts are at the edges of the least rectangle around."""
    u, v, names = _frame(n)
    corners = _hull(np.column_stack([points @ u, points @ v]))
    turn = _least_rectangle(corners)
    if turn:
        u, v = np.cos(turn) * u + np.sin(turn) * v, np.cos(turn) * v - np.sin(turn) * u
        names, corners = ("u", "v"), _turned(corners, turn)
    low, high = corners.min(axis=0), corners.max(axis=0)
    half, middle = (high - low) / 2, (high + low) / 2
    centre = middle[0] * u + middle[1] * v + float(place @ n) * n
    T = np.zeros((6, 3))
    T[:3, 0], T[3:, 1], T[3:, 2] = n, np.cross(u, n) / half[0], np.cross(v, n) / half[1]
    B = np.zeros((3, 6))
    B[0, :3], B[1, 3:], B[2, 3:] = n, np.cross(u, n) * half[0], np.cross(v, n) * half[1]
    places = centre + (corners - middle) @ np.array([u, v])
    directions = np.tile(n, (len(places), 1, 1))
    coordinates = ("offset", f"tilt {names[0]}", f"tilt {names[1]}")
    return FeatureGeometry(kind, centre, coordinates, T, B, places, directions, n, 0.0, size, normals, is_inner)


def _least_rectangle(corners: np.ndarray) -> float:
    """By which angle [rad] the least rectangle around an outline (corner, 2) is turned; 0 if that along axes is as small."""
    edges = np.roll(corners, -1, axis=0) - corners
    turns = np.unique(np.round(np.arctan2(edges[:, 1], edges[:, 0]) % (np.pi / 2), 9))
    areas = np.array([np.ptp(_turned(corners, turn), axis=0).prod() for turn in (0.0, *turns)])
    return 0.0 if areas[0] < areas.min() * (1 + ALIKE) else float(turns[areas[1:].argmin()])


def _turned(corners: np.ndarray, turn: float) -> np.ndarray:
    """Coordinates (corner, 2) along axes that are turned by an angle."""
    cos, sin = np.cos(turn), np.sin(turn)
    return np.asarray(corners @ np.array([[cos, -sin], [sin, cos]]))


def _planes(faces: Sequence[Surface], surfaces: Sequence[AnalyticSurface | None]) -> FeatureGeometry:
    first, second = surfaces
    if first is None or second is None or first.kind != "plane" or second.kind != "plane":
        kinds = " and ".join("a general face" if surface is None else f"a {surface.kind}" for surface in surfaces)
        raise GeometryFault(f"it has two faces, {kinds}; expected two planes that are opposed")
    if np.linalg.norm(first.axis + second.axis) > OPPOSED:
        raise GeometryFault("its two planes are not opposed; expected outward normals in opposite directions")
    n, points = first.axis, [np.asarray(face.mesh.vertices) for face in faces]
    heights = [float(each.mean(axis=0) @ n) for each in points]
    middle = sum(heights) / 2
    both = np.vstack([each - (each @ n - middle)[:, None] * n for each in points])
    distance = heights[0] - heights[1]  # positive: material is between the planes
    return _plane("planes", middle * n, n, both, (first.axis, second.axis), abs(distance), distance < 0)


def _axis(face: Surface, surface: AnalyticSurface) -> FeatureGeometry:
    """Of a cylinder or a cone."""
    a = surface.axis * np.sign(surface.axis[np.abs(surface.axis).argmax()])  # whichever way the file has it
    u, v, names = _frame(a)
    points = np.asarray(face.mesh.vertices)
    along = points @ a
    half, middle = float(np.ptp(along)) / 2, float(along.max() + along.min()) / 2
    centre = surface.origin + (middle - float(surface.origin @ a)) * a
    count = 5 if surface.kind == "cone" else 4
    T, B = np.zeros((6, count)), np.zeros((count, 6))
    for k, e in enumerate((u, v)):
        T[:3, k], B[k, :3] = e, e
        T[3:, 2 + k], B[2 + k, 3:] = np.cross(a, e) / half, np.cross(a, e) * half
    coordinates = [f"shift {names[0]}", f"shift {names[1]}", f"tilt {names[0]}", f"tilt {names[1]}"]
    if surface.kind == "cone":
        T[:3, 4], B[4, :3] = a, a
        coordinates.append("along")
    size = 2 * surface.radius if surface.kind == "cylinder" else np.nan
    ends = centre + half * np.array([[-1.0], [1.0]]) * a
    directions = np.array([[u, v]] * 2)
    is_inner = face.pieces[0].is_hollow
    walls = None
    if surface.kind == "cone":
        around = np.arange(ROUND) * 2 * np.pi / ROUND
        out = np.cos(around)[:, None] * u + np.sin(around)[:, None] * v
        reach = np.abs((ends - surface.origin) @ surface.axis)[:, None, None] * np.tan(surface.angle)
        places = (ends[:, None] + reach * out).reshape(-1, 3)
        normals = np.cos(surface.angle) * np.tile(out, (2, 1)) - np.sin(surface.angle) * surface.axis
        walls = (places, normals[:, None])
    return FeatureGeometry(surface.kind, centre, tuple(coordinates), T, B, ends, directions, a, half, size, (), is_inner, walls)


def axis_rows(places: np.ndarray, coordinates: int, across: np.ndarray | None = None) -> np.ndarray:
    """Rows (place, component, coordinate) of displacements of an axis at `places`, in halves of its length from its middle.

    In both directions across it, or in the one that has the components `across` (2,) in them.
    """
    rows = np.zeros((len(places), 2, coordinates))
    rows[:, 0, 0] = rows[:, 1, 1] = 1.0
    rows[:, 0, 2] = rows[:, 1, 3] = places
    return rows if across is None else np.einsum("c,pcq->pq", across, rows)[:, None]


def _general(face: Surface) -> FeatureGeometry:
    """Of a surface of no simple kind: the displacements that its own normals notice, from the plainest on."""
    mesh = face.mesh
    points, normals = np.asarray(mesh.vertices), np.asarray(mesh.vertex_normals)
    centre = np.asarray(mesh.area_faces @ mesh.triangles_center / mesh.area_faces.sum())
    reach = float(np.linalg.norm(points - centre, axis=1).max())
    every = np.hstack([normals, np.cross(points - centre, normals) / reach])  # of tau, and of rho * reach
    mean = mesh.area_faces @ mesh.face_normals
    first = mean / np.linalg.norm(mean) if np.linalg.norm(mean) > 1e-9 * mesh.area else AXES[2]
    u, v, _ = _frame(first)
    basis = [np.concatenate([e, NONE]) for e in (first, u, v)] + [np.concatenate([NONE, e]) for e in (u, v, first)]
    kept: list[np.ndarray] = []
    for start in basis:
        direction = start
        for other in kept:
            moved = every @ other
            direction = direction - (every @ direction @ moved) / (moved @ moved) * other
        if (most := np.abs(every @ direction).max()) > NOTICED:
            kept.append(direction / most)
    scaled = np.column_stack(kept)
    to_twist = np.diag([1.0] * 3 + [1 / reach] * 3)
    metric = every.T @ every
    values = np.linalg.solve(scaled.T @ metric @ scaled, scaled.T @ metric) @ np.linalg.inv(to_twist)
    names = tuple(f"freedom {k + 1}" for k in range(len(kept)))
    # Of many points those that stand out farthest for some displacement.
    ways = np.random.default_rng(0).normal(size=(len(kept), EXTREMES))
    outer = np.unique(np.abs(every @ scaled @ ways).argmax(axis=0))
    return FeatureGeometry(
        "general", centre, names, to_twist @ scaled, values, points[outer], normals[outer, None], first, 0.0, np.nan, (), False,
        nearest=nearest_surface(np.asarray(mesh.triangles)),
    )  # fmt: skip


def _frame(a: np.ndarray) -> tuple[np.ndarray, np.ndarray, tuple[str, str]]:
    """Two unit vectors across `a` (3,) and each other, and what they are called: axes of the part where they are that."""
    least = int(np.abs(a).argmin())
    along = int(np.abs(a).argmax())
    if abs(a[along]) > 1 - ALONG:
        first, second = (k for k in range(3) if k != along)
        u = AXES[first] - (AXES[first] @ a) * a
        u = u / np.linalg.norm(u)
        v = AXES[second] - (AXES[second] @ a) * a - (AXES[second] @ u) * u
        return u, v / np.linalg.norm(v), ("xyz"[first], "xyz"[second])
    u = AXES[least] - a[least] * a
    u = u / np.linalg.norm(u)
    v = np.cross(a, u)
    return u, v, ("xyz"[least] if abs(a[least]) < ALONG else "u", "v")


def _hull(points: np.ndarray) -> np.ndarray:
    """Corners (corner, 2) of the convex hull of points (point, 2)."""
    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError as error:
        raise GeometryFault("its face is so narrow that it has no area") from error


def _cross_matrix(v: np.ndarray) -> np.ndarray:
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
