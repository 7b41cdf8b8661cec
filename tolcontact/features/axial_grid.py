"""Places on a face of a cylinder or cone: a grid of heights along its axis and azimuths."""

from typing import NamedTuple

import numpy as np

from tolcontact.features.covariances import Lengths
from tolcontact.geometry.analytic_surfaces import AnalyticSurface
from tolcontact.geometry.surface import Surface

PLACE_SPACING = 1 / 4  # of the correlation length
MIN_AZIMUTHS, MAX_AZIMUTHS = 48, 144  # of a circle
MIN_HEIGHTS, MAX_HEIGHTS = 9, 25
MAX_FACET_ANGLE = np.radians(46.0)  # between neighbouring vertices: a wider gap is a gap of the face
PLACE_TOLERANCE = 1e-4  # of a face's size: the distance of a place on it, beside that of triangles from their surface


class AxialGrid(NamedTuple):
    """A grid on a face.

    places    (height, azimuth, 3) [mm]
    areas     (height, azimuth) that they stand for, relative
    is_on     (height, azimuth): whether the face is there
    is_whole  whether the face goes all the way around at some height
    """

    places: np.ndarray
    areas: np.ndarray
    is_on: np.ndarray
    is_whole: bool

    @classmethod
    def of(cls, surface: AnalyticSurface, ends: tuple[float, float], face: Surface, lengths: Lengths) -> "AxialGrid":
        """Return the grid of a face between places `ends` [mm] on the axis of its surface, for a form with these lengths."""
        start, end = ends
        heights = np.linspace(
            start, end, int(np.clip((end - start) / (PLACE_SPACING * lengths.along), MIN_HEIGHTS, MAX_HEIGHTS))
        )
        radii = heights * np.tan(surface.angle) if surface.angle else np.full(len(heights), surface.radius)
        spacing = PLACE_SPACING * lengths.across / radii.max()
        azimuths, shares, u = _azimuths(surface, face, spacing)
        outward = np.cos(azimuths)[:, None] * u + np.sin(azimuths)[:, None] * np.cross(surface.axis, u)
        places = surface.origin + heights[:, None, None] * surface.axis + radii[:, None, None] * outward
        nearest = face.nearest(places.reshape(-1, 3))[1].reshape(places.shape)
        is_on = np.linalg.norm(nearest - places, axis=2) <= PLACE_TOLERANCE * face.mesh.scale + face.bulge
        is_whole = bool(np.ptp(azimuths) > 2 * np.pi - MAX_FACET_ANGLE and is_on.all(axis=1).any())
        return cls(places, radii[:, None] * np.outer(_trapezoid(heights), shares), is_on, is_whole)


def _azimuths(surface: AnalyticSurface, face: Surface, spacing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return azimuths (azimuth,) [rad] of a face, about `spacing` apart, their shares, and the unit vector (3,) at 0."""
    axis, arms = surface.axis, np.asarray(face.mesh.vertices) - surface.origin
    arms = arms - (arms @ axis)[:, None] * axis
    arms = arms[np.linalg.norm(arms, axis=1) > PLACE_TOLERANCE * face.mesh.scale]
    u = arms[0] / np.linalg.norm(arms[0])
    angles = np.sort(np.arctan2(arms @ np.cross(axis, u), arms @ u))
    gaps = np.diff(angles, append=angles[0] + 2 * np.pi)
    widest = int(gaps.argmax())
    extent = 2 * np.pi - (gaps[widest] if gaps[widest] > MAX_FACET_ANGLE else 0.0)
    count = int(np.ceil(extent / (2 * np.pi) * np.clip(2 * np.pi / spacing, MIN_AZIMUTHS, MAX_AZIMUTHS)))
    if extent == 2 * np.pi:
        return np.arange(count) * extent / count, np.ones(count), u
    azimuths = angles[widest] + gaps[widest] + np.linspace(0.0, extent, max(count, MIN_HEIGHTS))
    return azimuths, _trapezoid(azimuths), u


def _trapezoid(values: np.ndarray) -> np.ndarray:
    """Return the weights of even values in a sum by the trapezoidal rule."""
    weights = np.full(len(values), values[1] - values[0])
    weights[[0, -1]] /= 2
    return weights
