"""Arcs of round walls around their axis, and the tangent planes of hollow walls. Nominal assembly frame, mm."""

import math
from collections.abc import Sequence

import numpy as np

from tolcontact.geometry.analytic_surfaces import Cone, Cylinder, Plane, Sphere
from tolcontact.geometry.surface import Piece

TANGENTS = 5  # of a whole hollow wall, besides the nearest
MAX_FACET_ANGLE = math.radians(31.0)  # between neighbouring vertices of a round face: a wider gap is a gap of the face
MAX_MISSING_SHARE = 0.05  # of the area of a round face that its triangles leave out
CAP_SHARE = 0.9  # of the angle to the rim of a cap, at which its tangent planes are
RADIUS_TOLERANCE = 1e-6  # of a face's size


class NotRoundError(Exception):
    """Two faces do not touch as a ball or a shaft beside walls do."""


def arc(wall: Piece) -> tuple[np.ndarray, float]:
    """Return the unit vector (3,) from the axis to the middle of a round face, and half its arc's angle [rad], pi if whole.

    Raises NotRoundError if a part of the face is missing within the arc.
    """
    if isinstance(wall.surface, Sphere):
        return _cap(wall, wall.surface)
    vertices, axis = np.asarray(wall.face.mesh.vertices), wall.surface.axis
    across = vertices - wall.surface.origin
    across -= (across @ axis)[:, None] * axis
    across = across[np.linalg.norm(across, axis=1) > RADIUS_TOLERANCE * wall.face.mesh.scale]
    if isinstance(wall.surface, Plane) or not len(across):
        return np.linalg.svd(axis[None])[2][1], math.pi
    x = across[0] / np.linalg.norm(across[0])
    y = np.cross(axis, x)
    azimuths = np.sort(np.arctan2(across @ y, across @ x))
    gaps = np.diff(azimuths, append=azimuths[0] + 2 * math.pi)
    if (gaps > MAX_FACET_ANGLE).sum() > 1:
        raise NotRoundError
    widest = int(gaps.argmax())
    if gaps[widest] < MAX_FACET_ANGLE:
        middle, opening = x, math.pi
    else:
        opening = math.pi - float(gaps[widest]) / 2
        azimuth = float(azimuths[widest] + gaps[widest]) + opening
        middle = math.cos(azimuth) * x + math.sin(azimuth) * y
    _check_area(wall, opening)
    return middle, opening


def _check_area(wall: Piece, opening: float) -> None:
    """Raise NotRoundError if a cylinder or cone has less area than its whole arc from end to end of its axis."""
    along = (np.asarray(wall.face.mesh.vertices) - wall.surface.origin) @ wall.surface.axis
    if isinstance(wall.surface, Cylinder):
        expected = 2 * opening * wall.surface.radius * float(np.ptp(along))
    elif isinstance(wall.surface, Cone):
        slants = along / math.cos(wall.surface.angle)
        expected = opening * math.sin(wall.surface.angle) * abs(float(slants.max() ** 2 - slants.min() ** 2))
    else:
        return
    if wall.face.mesh.area < (1 - MAX_MISSING_SHARE) * expected:
        raise NotRoundError


def _cap(wall: Piece, sphere: Sphere) -> tuple[np.ndarray, float]:
    """Return the unit vector (3,) from the centre to the middle of a cap, and the angle [rad] to its rim; pi if whole."""
    mesh = wall.face.mesh
    outward = (np.asarray(mesh.vertices) - sphere.origin) / sphere.radius
    middle = (np.asarray(mesh.area_faces)[:, None] * (np.asarray(mesh.triangles_center) - sphere.origin)).sum(axis=0)
    if np.linalg.norm(middle) < MAX_MISSING_SHARE * mesh.area * sphere.radius:
        middle, opening = outward[0], math.pi
    else:
        middle /= np.linalg.norm(middle)
        opening = math.acos(min(max(float((outward @ middle).min()), -1.0), 1.0))
    if mesh.area < (1 - MAX_MISSING_SHARE) * 2 * math.pi * sphere.radius**2 * (1 - math.cos(opening)):
        raise NotRoundError
    return middle, opening


def tangent_directions(wall: Piece) -> Sequence[np.ndarray]:
    """Return unit vectors (3,) from the axis to the tangent planes that a hollow wall has besides the nearest.

    They are counted from a vertex, so they turn with the part.
    """
    x, opening = arc(wall)
    if isinstance(wall.surface, Sphere):
        y, z = _directions_across(wall, x)
        lean, azimuths = min(CAP_SHARE * opening, math.pi / 2), np.arange(TANGENTS - 1) * 2 * math.pi / (TANGENTS - 1)
        sideways = [math.cos(azimuth) * y + math.sin(azimuth) * z for azimuth in azimuths]
        directions = [x, *(math.cos(lean) * x + math.sin(lean) * across for across in sideways)]
        return [*directions, -x] if opening == math.pi else directions
    y = np.cross(wall.surface.axis, x)
    if opening == math.pi:
        azimuths = np.arange(TANGENTS) * 2 * math.pi / TANGENTS
    else:
        azimuths = np.linspace(-opening, opening, max(math.ceil(opening / math.pi * TANGENTS), 1) + 1)
    return [math.cos(azimuth) * x + math.sin(azimuth) * y for azimuth in azimuths]


def _directions_across(wall: Piece, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors across x (3,) and each other; the first points to the vertex farthest from the line along x."""
    across = np.asarray(wall.face.mesh.vertices) - wall.surface.origin
    across -= (across @ x)[:, None] * x
    y = across[np.linalg.norm(across, axis=1).argmax()]
    y /= np.linalg.norm(y)
    return y, np.cross(x, y)
