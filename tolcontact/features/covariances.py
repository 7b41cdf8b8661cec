"""Covariances of the heights of two points of a face, by their distance in correlation lengths. The variance is 1.

With a number of lobes, heights vary around the axis of the face as a cosine, and by the distance along the axis.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy

from tolcontact.declaration.size import Form
from tolcontact.geometry.analytic_surfaces import AnalyticSurface


def squared_exponential(distance: np.ndarray) -> np.ndarray:
    """Return the covariance of very smooth fields."""
    return np.asarray(np.exp(-(distance**2) / 2))


def matern_5_2(distance: np.ndarray) -> np.ndarray:
    """Return the covariance of fields that are twice differentiable."""
    scaled = np.sqrt(5) * distance
    return np.asarray((1 + scaled + scaled**2 / 3) * np.exp(-scaled))


def matern_3_2(distance: np.ndarray) -> np.ndarray:
    """Return the covariance of fields that are once differentiable."""
    scaled = np.sqrt(3) * distance
    return np.asarray((1 + scaled) * np.exp(-scaled))


COVARIANCES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "squared exponential": squared_exponential,
    "matern 5/2": matern_5_2,
    "matern 3/2": matern_3_2,
}


class Lengths(NamedTuple):
    """The correlation lengths [mm] of a form: across the axis of its surface, and along it."""

    across: float
    along: float


def covariance(form: Form, lengths: Lengths, surface: AnalyticSurface, points: np.ndarray, stations: np.ndarray) -> np.ndarray:
    """Return the covariance (point, station) of points (point, 3) and stations (station, 3) [mm] of a surface."""
    decay = COVARIANCES[form.covariance]
    if form.lobes is None:
        stretch = (1 / lengths.along - 1 / lengths.across) * np.outer(surface.axis, surface.axis)
        scaled = [places / lengths.across + places @ stretch for places in (points, stations)]
        return decay(scipy.spatial.distance.cdist(*scaled))
    (arms, along), (station_arms, station_along) = (surface.around_axis(places)[1:] for places in (points, stations))
    cosines = np.einsum("pk,sk->ps", arms, station_arms)
    lobes = np.cos(form.lobes * np.arccos(cosines.clip(-1.0, 1.0)))
    return np.asarray(lobes * decay(np.abs(along[:, None] - station_along) / lengths.along))
