"""How far round walls reach around their axis, and the tangent planes that hollow ones have. Assembly frame, mm."""

import math
from collections.abc import Sequence

import numpy as np

from tolcontact.geometry.surface import Piece

TANGENTS = 5  # of a whole hollow wall, besides the nearest
FACET = math.radians(31.0)  # no facet of a round face turns by more: a wider gap is one
MISSING = 0.05  # of its area: what triangles of a round face leave out at most
LEAN = 0.9  # of the way to the rim of a cap
SMALL = 1e-6  # of a face's size


class NotRoundError(Exception):
    """Two faces do not touch as a ball or a shaft beside walls do."""


def arc(wall: Piece) -> tuple[np.ndarray, float]:
    """The middle of a round face, seen from its axis (3,), and how far [rad] it reaches to either side of that; pi if whole.

    Raises NotRoundError if something is missing in between.
    """
    if wall.surface.kind == "sphere":
        return _cap(wall)
    vertices, axis = np.asarray(wall.face.mesh.vertices), wall.surface.axis
    across = vertices - wall.surface.origin
    across -= (across @ axis)[:, None] * axis
    across = across[np.linalg.norm(across, axis=1) > SMALL * wall.face.mesh.scale]
    if wall.surface.kind == "plane" or not len(across):
        return np.linalg.svd(axis[None])[2][1], math.pi
    x = across[0] / np.linalg.norm(across[0])
    y = np.cross(axis, x)
    azimuths = np.sort(np.arctan2(across @ y, across @ x))
    gaps = np.diff(azimuths, append=azimuths[0] + 2 * math.pi)
    if (gaps > FACET).sum() > 1:
        raise NotRoundError
    widest = int(gaps.argmax())
    if gaps[widest] < FACET:
        middle, opening = x, math.pi
    else:
        opening = math.pi - float(gaps[widest]) / 2
        turn = float(azimuths[widest] + gaps[widest]) + opening
        middle = math.cos(turn) * x + math.sin(turn) * y
    _check_area(wall, opening)
    return middle, opening


def _check_area(wall: Piece, opening: float) -> None:
    """Raise NotRoundError if a cylinder or cone has less area than from end to end of its axis and of its arc."""
    along = (np.asarray(wall.face.mesh.vertices) - wall.surface.origin) @ wall.surface.axis
    if wall.surface.kind == "cylinder":
        expected = 2 * opening * wall.surface.radius * float(np.ptp(along))
    elif wall.surface.kind == "cone":
        slants = along / math.cos(wall.surface.angle)
        expected = opening * math.sin(wall.surface.angle) * abs(float(slants.max() ** 2 - slants.min() ** 2))
    else:
        return
    if wall.face.mesh.area < (1 - MISSING) * expected:
        raise NotRoundError


def _cap(wall: Piece) -> tuple[np.ndarray, float]:
    mesh, sphere = wall.face.mesh, wall.surface
    outward = (np.asarray(mesh.vertices) - sphere.origin) / sphere.radius
    middle = (np.asarray(mesh.area_faces)[:, None] * (np.asarray(mesh.triangles_center) - sphere.origin)).sum(axis=0)
    if np.linalg.norm(middle) < MISSING * mesh.area * sphere.radius:
        middle, opening = outward[0], math.pi
    else:
        middle /= np.linalg.norm(middle)
        opening = math.acos(min(max(float((outward @ middle).min()), -1.0), 1.0))
    if mesh.area < (1 - MISSING) * 2 * math.pi * sphere.radius**2 * (1 - math.cos(opening)):
        raise NotRoundError
    return middle, opening


def directions(wall: Piece) -> Sequence[np.ndarray]:
    """Unit vectors (3,), from the axis, of tangent planes that a hollow wall has besides the nearest.

    They turn with the part, since they are counted from a vertex.
    """
    x, opening = arc(wall)
    if wall.surface.kind == "sphere":
        y, z = _beside(wall, x)
        lean, turns = min(LEAN * opening, math.pi / 2), np.arange(TANGENTS - 1) * 2 * math.pi / (TANGENTS - 1)
        aside = [math.cos(turn) * y + math.sin(turn) * z for turn in turns]
        found = [x, *(math.cos(lean) * x + math.sin(lean) * each for each in aside)]
        return [*found, -x] if opening == math.pi else found
    y = np.cross(wall.surface.axis, x)
    if opening == math.pi:
        azimuths = np.arange(TANGENTS) * 2 * math.pi / TANGENTS
    else:
        azimuths = np.linspace(-opening, opening, max(math.ceil(opening / math.pi * TANGENTS), 1) + 1)
    return [math.cos(azimuth) * x + math.sin(azimuth) * y for azimuth in azimuths]


def _beside(wall: Piece, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors across x (3,) and each other, by the vertex that is farthest from its line."""
    across = np.asarray(wall.face.mesh.vertices) - wall.surface.origin
    across -= (across @ x)[:, None] * x
    y = across[np.linalg.norm(across, axis=1).argmax()]
    y /= np.linalg.norm(y)
    return y, np.cross(x, y)
