"""Contact points of faces with form: their spacing, the faces that can have them, and the heights of form at any point."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.spatial import KDTree

from tolcontact.arrays import Array, Float, Int
from tolcontact.errors import GeometryFault
from tolcontact.features import FaceDeviation
from tolcontact.geometry.analytic_surfaces import Cylinder
from tolcontact.geometry.overlap import rim_points
from tolcontact.geometry.surface import Surface
from tolcontact.geometry.tolerances import PARALLEL, SAME_PLACE
from tolcontact.geometry.triangle_mesh import subdivided

FACING = -0.99999  # cosine of the angle between the normals of planes that face each other
MIN_RISE = 0.1  # per mm from the rim of facets that face a plane: steeper facets touch it only at that rim, at usual tilts
SPACING_SHARE = 1 / 5  # of the correlation length: the usual spacing
ALONG_SHARE = 1 / 3  # of the correlation length: the same along the axis of cylinders, whose lines are straight
MIN_AZIMUTHS = 48  # of a cylinder
END_SHARE = 1e-6  # of the length: how far inside their ends the outermost points of cylinders are
MAX_SPACING_SHARE = 1 / 2
WIDE_SPACING_SHARE = 2 / 5  # the usual spacing of many points: a spread leaves some points of the face further away
COVER_SHARE = 0.71  # of the spacing of a square grid: the distance from the centre of a square to the nearest point
SQUARE_SHARE = 1.25  # of the area of a grid square: the least area that a point of a spread covers
MIN_DISTANCE_SHARE = 1 / 4  # of the spacing: points of a rim that are nearer to others are left out
MARGIN_SHARE = 0.05  # of the range of heights at many points: how much higher others may be
EDGES = 8  # of the triangles whose corners are compared with contact points, in a correlation length


@dataclass(frozen=True, eq=False)
class PairForm:
    """Heights of the forms of a moving and a reference plane that face each other, for deviations (row, contributor)."""

    deviating: Sequence[FaceDeviation | None]
    deviations: Float[Array, "row contributor"]

    def take(self, rows: slice | np.ndarray) -> "PairForm":
        """Return the forms of some rows."""
        return PairForm(self.deviating, self.deviations[rows])

    def at(self, row: Int[Array, " k"], P_m: Float[Array, "k 3"], P_r: Float[Array, "k 3"]) -> Float[Array, " k"]:
        """Return the sum of both heights (k,) [mm] at points P_m, P_r (k, 3) of the nominal faces, each of its own row (k,)."""
        return np.add(*(self.at_face(k, row, places) for k, places in enumerate((P_m, P_r))))

    def at_face(self, k: int, row: Int[Array, " k"], places: Float[Array, "k 3"]) -> Float[Array, " k"]:
        """Return the heights (k,) [mm] of one face at points `places` (k, 3), each of its own row; face 0 is the moving one."""
        face = self.deviating[k]
        if face is None or face.form is None:
            return np.zeros(len(row))
        return face.form.sums(places, row, self.deviations[:, face.form_columns])

    def highest(self) -> Float[Array, "face row"]:
        """Return bounds [mm] of the heights of the moving and the reference face, from the heights at many points of each."""
        bounds = np.zeros((2, len(self.deviations)))
        for k, face in enumerate(self.deviating):
            if face is not None and face.form is not None:
                heights = self.deviations[:, face.form_columns] @ face.form.place_heights
                bounds[k] = heights.max(axis=1) + MARGIN_SHARE * np.ptp(heights, axis=1)
        return bounds


def form_lengths(deviating: Sequence[FaceDeviation | None]) -> list[float]:
    """Return the correlation lengths [mm] of the faces that have form."""
    return [min(face.form.scales) for face in deviating if face is not None and face.form is not None]


def form_spacing(lengths: Sequence[float]) -> float:
    """Return the usual largest distance [mm] from a point of a face to a contact point, for correlation lengths."""
    return COVER_SHARE * SPACING_SHARE * min(lengths)


def affordable_spacing(lengths: Sequence[float], area: float, count: int) -> float:
    """Return this distance for an area [mm2] and a limited number of points: larger, but small enough to resolve the form."""
    affordable = COVER_SHARE * (SQUARE_SHARE * area / count) ** 0.5
    return min(max(form_spacing(lengths), affordable), COVER_SHARE * WIDE_SPACING_SHARE * min(lengths))


def check_facing(moving: Surface, reference: Surface, deviating: Sequence[FaceDeviation | None]) -> None:
    """Raise GeometryFault for a plane with form and another plane that does not face it."""
    normals = [face.corner_normals[0, 0] for face in (moving, reference)]
    if moving.is_flat and reference.is_flat and normals[0] @ normals[1] > FACING:
        name = next(face.name for face in deviating if face is not None and face.form is not None)
        raise GeometryFault(
            f"the face of feature {name} has form, and its planes are not parallel; give its tolerance form=None, "
            "so that it keeps its shape"
        )


def facing_triangles(face: Surface, other: Surface, deviation: FaceDeviation | None) -> np.ndarray:
    """Return the indices (triangle,) of the triangles of a face that can touch another one, with its deviation.

    If the other face is a plane with form, these are the nearest facets that face it, provided that all other facets rise from
    the plane of these: facets that end at the rim, or are further away, do not touch before the rim does. Otherwise all
    triangles can touch it.
    """
    n, every = other.corner_normals[0, 0], np.arange(len(face.mesh.faces))
    is_facing = np.asarray(face.mesh.face_normals) @ n < FACING
    if deviation is None or deviation.form is None or not other.is_flat or is_facing.all() or not is_facing.any():
        return every
    heights = face.vertices @ n
    tops = heights[face.faces].max(axis=1)
    is_facing &= tops < tops[is_facing].min() + SAME_PLACE * face.mesh.scale
    part = face.part(np.flatnonzero(is_facing))
    level = part.vertices @ n
    neighbours = np.setdiff1d(face.faces, face.faces[is_facing])
    dropped = face.vertices[neighbours] - (heights[neighbours] - level.min())[:, None] * n
    distance = np.linalg.norm(part.nearest(dropped)[1] - dropped, axis=1)
    rises = heights[neighbours] - level.min() > np.maximum(MIN_RISE * distance, SAME_PLACE * face.mesh.scale)
    return np.flatnonzero(is_facing) if rises.all() else every


def coaxial_points(moving: Surface, reference: Surface, deviating: Sequence[FaceDeviation | None]) -> np.ndarray | None:
    """Return points (point, 3) [mm] of a cylinder inside or around a parallel one, with form; None for other faces.

    They form a grid of azimuths, from a vertex on, so that it rotates with the part, and of coordinates along the axis where
    both faces are.
    """
    shaft, bore = (face.surfaces[0] if len(face.surfaces) == 1 else None for face in (moving, reference))
    if not (isinstance(shaft, Cylinder) and isinstance(bore, Cylinder)):
        return None
    if np.linalg.norm(np.cross(shaft.axis, bore.axis)) > PARALLEL:
        return None
    lows, highs = zip(*(shaft.extent(face.vertices) for face in (moving, reference)), strict=True)
    start, end = max(lows), min(highs)
    if end <= start:
        return None
    lengths = [face.form.scales for face in deviating if face is not None and face.form is not None]
    across, along = (min(values) for values in zip(*lengths, strict=True))
    inset = END_SHARE * (end - start)
    heights = np.linspace(start + inset, end - inset, int(np.ceil((end - start) / (ALONG_SHARE * along))) + 1)
    count = max(int(np.ceil(2 * np.pi * shaft.radius / (SPACING_SHARE * across))), MIN_AZIMUTHS)
    u = shaft.around_axis(moving.vertices[:1])[1][0]
    outward = [np.cos(turn) * u + np.sin(turn) * np.cross(shaft.axis, u) for turn in np.arange(count) * 2 * np.pi / count]
    points = shaft.origin + heights[:, None, None] * shaft.axis + shaft.radius * np.array(outward)
    points = points.reshape(-1, 3)
    return points[moving.overhang(points) <= SAME_PLACE * moving.mesh.scale]


def check_resolved(points: np.ndarray, face: trimesh.Trimesh, lengths: Sequence[float]) -> None:
    """Raise GeometryFault if points (point, 3) of a face are too far apart for the form of a pair."""
    length = min(lengths)
    places = subdivided(face.vertices, face.faces, length / EDGES)[0]
    spacing = float(KDTree(points).query(places)[0].max()) / COVER_SHARE
    if spacing > MAX_SPACING_SHARE * length:
        raise GeometryFault(
            f"its contact points are {spacing:.3g} mm apart, and the form of its faces has a correlation length of "
            f"{length:.3g} mm; expected at most half of that; leave points and spacing out, or give spacing="
            f"{form_spacing(lengths):.2g}"
        )


def with_rims(P_m: np.ndarray, moving: Surface, reference: Surface, spacing: float, reach: float) -> np.ndarray:
    """Return points P_m (point, 3) of the moving plane, and others over the rim of the reference plane and along its own rim.

    Tilted faces touch along rims. Corners alone would do for flat ones.
    """
    over_reference, over_moving = rim_points(moving, reference, spacing, reach), rim_points(reference, moving, spacing, reach)
    along_own = moving.project(over_moving)[0] if len(over_moving) else over_moving
    for points in (over_reference, along_own):
        if len(points):
            P_m = np.concatenate([P_m, points[KDTree(P_m).query(points)[0] > MIN_DISTANCE_SHARE * spacing]])
    return P_m
