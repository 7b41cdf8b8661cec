"""Recognition of features: faces become a plane, a pair of planes, a cylinder, a cone, a sphere or a general surface."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from tolcontact.errors import GeometryFault
from tolcontact.features.feature_geometry import (
    ConeFeature,
    Coordinates,
    CylinderFeature,
    FeatureGeometry,
    GeneralFeature,
    PlaneFeature,
    SlabFeature,
    SphereFeature,
)
from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Cone, Cylinder, Plane, Sphere, are_opposed
from tolcontact.geometry.fitting import nearest_surface
from tolcontact.geometry.surface import Surface
from tolcontact.geometry.tolerances import SAME_DIRECTION
from tolcontact.geometry.triangle_mesh import smooth_pieces

AREA_TOLERANCE = 1e-3  # relative: a rotated rectangle must be smaller by this to be preferred to one along the part's axes
MIN_NORMAL_PART = 1e-3  # of a displacement: its part along the normals of a general surface, above which it is a freedom
EXTREME_TRIALS = 4096  # random displacements that determine the extremes of a general surface
CONE_PROBES = 32  # places around each end of a cone
AXES = np.eye(3)


def feature_geometry(faces: Sequence[Surface]) -> FeatureGeometry:
    """Return the geometry of a feature with one face or two.

    Raises GeometryFault if a face spans several surfaces, or if two faces are not opposed planes.
    """
    surfaces = [analytic_surface(face) for face in faces]
    if len(faces) == 2:
        return _slab(faces, surfaces)
    face, surface = faces[0], surfaces[0]
    match surface:
        case Plane():
            coordinates = _plane_coordinates(surface.origin, surface.axis, np.asarray(face.mesh.vertices))
            return PlaneFeature(*coordinates, normal=surface.axis)
        case Sphere():
            twists, extremes = np.vstack([AXES, np.zeros((3, 3))]), (surface.origin[None], AXES[None])
            coordinates = surface.origin, ("shift x", "shift y", "shift z"), twists, twists.T, extremes
            return SphereFeature(*coordinates, size=2 * surface.radius, is_inner=face.pieces[0].is_hollow)
        case Cylinder():
            coordinates, axis, half = _axis_coordinates(face, surface)
            is_inner = face.pieces[0].is_hollow
            return CylinderFeature(*coordinates, axis=axis, half=half, size=2 * surface.radius, is_inner=is_inner)
        case Cone():
            return _cone(face, surface)
        case _:
            return _general(face)


def analytic_surface(face: Surface) -> AnalyticSurface | None:
    """Return the one analytic surface of a face; None for a general one."""
    if face.is_flat:
        normal_sum = face.corner_normals.reshape(-1, 3).mean(axis=0)
        n = normal_sum / np.linalg.norm(normal_sum)
        stated = [surface for surface in face.surfaces if isinstance(surface, Plane)]
        if stated:
            n = stated[0].axis * np.sign(stated[0].axis @ n)
        height = float((np.asarray(face.mesh.vertices) @ n).mean()) if not stated else float(stated[0].origin @ n)
        return Plane(height * n, n)
    numbers = sorted({int(number) for number in face.surface_numbers})
    pieces = int(smooth_pieces(face.mesh, np.arange(len(face.mesh.faces))).max()) + 1
    if len(numbers) == 1 and numbers[0] >= 0:
        return face.surfaces[numbers[0]]
    if len(numbers) > 1 or pieces > 1:
        kinds = [face.surfaces[number].kind if number >= 0 else "general" for number in numbers]
        listing = ", ".join(kinds) if len(numbers) > 1 else f"{pieces} faces with creases between them"
        raise GeometryFault(
            f"its face spans more than one surface ({listing}); a feature is one of them: choose it, as with tc.select.Largest"
        )
    return None


def _slab(faces: Sequence[Surface], surfaces: Sequence[AnalyticSurface | None]) -> SlabFeature:
    first_plane, second_plane = surfaces
    if not (isinstance(first_plane, Plane) and isinstance(second_plane, Plane)):
        kinds = " and ".join("a general face" if surface is None else f"a {surface.kind}" for surface in surfaces)
        raise GeometryFault(f"it has two faces, {kinds}; expected two planes that are opposed")
    if not are_opposed(first_plane.axis, second_plane.axis):
        raise GeometryFault("its two planes are not opposed; expected outward normals in opposite directions")
    n, outlines = first_plane.axis, [np.asarray(face.mesh.vertices) for face in faces]
    heights = [float(points.mean(axis=0) @ n) for points in outlines]
    middle = sum(heights) / 2
    projections = np.vstack([points - (points @ n - middle)[:, None] * n for points in outlines])
    distance = heights[0] - heights[1]  # positive: material is between the planes
    coordinates, normals = _plane_coordinates(middle * n, n, projections), (n, second_plane.axis)
    return SlabFeature(*coordinates, normal=n, normals=normals, size=abs(distance), is_inner=distance < 0)


def _plane_coordinates(place: np.ndarray, n: np.ndarray, points: np.ndarray) -> Coordinates:
    """Return the coordinates of a plane with normal n through `place`, bounded by `points` (point, 3) on it.

    Tilts are measured at the edges of the smallest rectangle around the points.
    """
    u, v, names = _directions_across(n)
    projected = np.column_stack([points @ u, points @ v])
    try:
        corners = projected[ConvexHull(projected).vertices]
    except QhullError as error:
        raise GeometryFault("its face is so narrow that it has no area") from error
    angle = _rectangle_angle(corners)
    if angle:
        u, v = np.cos(angle) * u + np.sin(angle) * v, np.cos(angle) * v - np.sin(angle) * u
        names, corners = ("u", "v"), _turned(corners, angle)
    low, high = corners.min(axis=0), corners.max(axis=0)
    half, middle = (high - low) / 2, (high + low) / 2
    centre = middle[0] * u + middle[1] * v + float(place @ n) * n
    twists, values = np.zeros((6, 3)), np.zeros((3, 6))
    twists[:3, 0], twists[3:, 1], twists[3:, 2] = n, np.cross(u, n) / half[0], np.cross(v, n) / half[1]
    values[0, :3], values[1, 3:], values[2, 3:] = n, np.cross(u, n) * half[0], np.cross(v, n) * half[1]
    places = centre + (corners - middle) @ np.array([u, v])
    extremes = places, np.tile(n, (len(places), 1, 1))
    return centre, ("offset", f"tilt {names[0]}", f"tilt {names[1]}"), twists, values, extremes


def _rectangle_angle(corners: np.ndarray) -> float:
    """Return the angle [rad] of the smallest rectangle around an outline (corner, 2); 0 if one along the axes is as small."""
    edges = np.roll(corners, -1, axis=0) - corners
    angles = np.unique(np.round(np.arctan2(edges[:, 1], edges[:, 0]) % (np.pi / 2), 9))
    areas = np.array([np.ptp(_turned(corners, angle), axis=0).prod() for angle in (0.0, *angles)])
    return 0.0 if areas[0] < areas.min() * (1 + AREA_TOLERANCE) else float(angles[areas[1:].argmin()])


def _turned(corners: np.ndarray, angle: float) -> np.ndarray:
    """Return coordinates (corner, 2) along axes that are rotated by an angle [rad]."""
    cos, sin = np.cos(angle), np.sin(angle)
    return corners @ np.array([[cos, -sin], [sin, cos]])


def _cone(face: Surface, cone: Cone) -> ConeFeature:
    """Return a cone: an axis that also shifts along itself, and the normals of the wall around both ends."""
    (centre, names, twists, values, extremes), axis, half = _axis_coordinates(face, cone)
    along = np.concatenate([axis, np.zeros(3)])
    coordinates = centre, (*names, "along"), np.column_stack([twists, along]), np.vstack([values, along]), extremes
    ends, directions = extremes
    u, v = directions[0]
    azimuths = np.arange(CONE_PROBES) * 2 * np.pi / CONE_PROBES
    outward = np.cos(azimuths)[:, None] * u + np.sin(azimuths)[:, None] * v
    radii = np.abs((ends - cone.origin) @ cone.axis)[:, None, None] * np.tan(cone.angle)
    places = (ends[:, None] + radii * outward).reshape(-1, 3)
    normals = np.cos(cone.angle) * np.tile(outward, (2, 1)) - np.sin(cone.angle) * cone.axis
    return ConeFeature(*coordinates, axis=axis, half=half, walls=(places, normals[:, None]))


def _axis_coordinates(face: Surface, surface: Cylinder | Cone) -> tuple[Coordinates, np.ndarray, float]:
    """Return the coordinates of a cylinder or cone, its axis (3,), and half the length [mm] of its face.

    The coordinates are two shifts at the centre of the axis and two tilts at its ends.
    """
    axis = surface.axis * np.sign(surface.axis[np.abs(surface.axis).argmax()])  # the same, whichever way the file has it
    u, v, names = _directions_across(axis)
    along = np.asarray(face.mesh.vertices) @ axis
    half, middle = float(np.ptp(along)) / 2, float(along.max() + along.min()) / 2
    centre = surface.origin + (middle - float(surface.origin @ axis)) * axis
    twists, values = np.zeros((6, 4)), np.zeros((4, 6))
    for k, e in enumerate((u, v)):
        twists[:3, k], values[k, :3] = e, e
        twists[3:, 2 + k], values[2 + k, 3:] = np.cross(axis, e) / half, np.cross(axis, e) * half
    freedoms = f"shift {names[0]}", f"shift {names[1]}", f"tilt {names[0]}", f"tilt {names[1]}"
    extremes = centre + half * np.array([[-1.0], [1.0]]) * axis, np.array([[u, v]] * 2)
    return (centre, freedoms, twists, values, extremes), axis, half


def _general(face: Surface) -> GeneralFeature:
    """Return a general surface, whose coordinates are the displacements that move it along its own normals."""
    mesh = face.mesh
    points, normals = np.asarray(mesh.vertices), np.asarray(mesh.vertex_normals)
    centre = np.asarray(mesh.area_faces @ mesh.triangles_center / mesh.area_faces.sum())
    reach = float(np.linalg.norm(points - centre, axis=1).max())
    moved = np.hstack([normals, np.cross(points - centre, normals) / reach])  # along normals, for (tau, rho reach) of 1
    mean_normal = mesh.area_faces @ mesh.face_normals
    length = np.linalg.norm(mean_normal)
    freedoms = _normal_displacements(moved, mean_normal / length if length > 1e-9 * mesh.area else AXES[2])
    to_twist = np.diag([1.0] * 3 + [1 / reach] * 3)
    metric = moved.T @ moved
    values = np.linalg.solve(freedoms.T @ metric @ freedoms, freedoms.T @ metric) @ np.linalg.inv(to_twist)
    # The extremes are the vertices that move farthest in some combination of freedoms.
    combinations = np.random.default_rng(0).normal(size=(freedoms.shape[1], EXTREME_TRIALS))
    extremes = np.unique(np.abs(moved @ freedoms @ combinations).argmax(axis=0))
    names = tuple(f"freedom {k + 1}" for k in range(freedoms.shape[1]))
    coordinates = centre, names, to_twist @ freedoms, values, (points[extremes], normals[extremes, None])
    return GeneralFeature(*coordinates, nearest=nearest_surface(np.asarray(mesh.triangles)))


def _normal_displacements(moved: np.ndarray, mean_normal: np.ndarray) -> np.ndarray:
    """Return the rigid displacements (6, freedom) that move the surface along its normals, each independent of others.

    moved   (vertex, 6): motions of vertices along their normals for unit displacements. Two displacements are independent if
            these motions are orthogonal. Each freedom is scaled so that the largest motion is 1.

    They are made of displacements along and across the mean normal (3,), then of rotations about these.
    """
    u, v, _ = _directions_across(mean_normal)
    zero, freedoms = np.zeros(3), list[np.ndarray]()
    translations = [np.concatenate([e, zero]) for e in (mean_normal, u, v)]
    for displacement in (*translations, *(np.concatenate([zero, e]) for e in (u, v, mean_normal))):
        direction = displacement
        for freedom in freedoms:
            distances = moved @ freedom
            direction = direction - (moved @ direction @ distances) / (distances @ distances) * freedom
        if (largest := np.abs(moved @ direction).max()) > MIN_NORMAL_PART:
            freedoms.append(direction / largest)
    return np.column_stack(freedoms)


def _directions_across(a: np.ndarray) -> tuple[np.ndarray, np.ndarray, tuple[str, str]]:
    """Return two unit vectors normal to `a` (3,) and each other, with their names: axes of the part where they are parallel."""
    smallest, largest = int(np.abs(a).argmin()), int(np.abs(a).argmax())
    if abs(a[largest]) > 1 - SAME_DIRECTION:
        i, j = (k for k in range(3) if k != largest)
        u = AXES[i] - (AXES[i] @ a) * a
        u = u / np.linalg.norm(u)
        v = AXES[j] - (AXES[j] @ a) * a - (AXES[j] @ u) * u
        return u, v / np.linalg.norm(v), ("xyz"[i], "xyz"[j])
    u = AXES[smallest] - a[smallest] * a
    u = u / np.linalg.norm(u)
    v = np.cross(a, u)
    return u, v, ("xyz"[smallest] if abs(a[smallest]) < SAME_DIRECTION else "u", "v")
