"""The form field of measured faces: their mean, and the principal components of what they deviate from it.

Heights of the points of each part over the nominal surface are interpolated at stations all over the face, and between these
by a covariance, so that the field is known at any place like any other. Coefficients vary as the measured faces do.
"""

from dataclasses import replace

import numpy as np
import scipy

from tolcontact.declaration.form import Form
from tolcontact.errors import GeometryFault
from tolcontact.features.associated_features import AssociatedFeature
from tolcontact.features.covariances import Lengths, covariance
from tolcontact.features.form_field import FormField, associated_covariance, beside_displacements
from tolcontact.features.least_zone import least_widths
from tolcontact.geometry.measured_points import measured_points
from tolcontact.geometry.spreading import spread
from tolcontact.geometry.surface import Surface

COVARIANCE = "matern 5/2"  # by which heights between stations follow from theirs
STATIONS = 160
NEIGHBOURS = 24  # points that a height between them follows from
LENGTH_FACTOR = 3.0  # times the distance of stations
MAX_HEIGHT_SHARE = 0.02  # of a face's size: a point farther from its surface was not measured on it
MIN_DISTANCE = 1e-6  # of a point from a station, relative to the farthest: nearer ones count alike
MIN_VARIANCE = 1e-8  # of the largest: a component with less is rounding


def measured_field(form: Form, pattern: str, face: Surface, associated: AssociatedFeature) -> FormField:
    """Return the form field of faces whose points are in files, in the frame of their part. Raises GeometryFault."""
    form = replace(form, covariance=COVARIANCE)
    stations = associated.surface.project(spread(face.mesh, STATIONS, None))
    length = LENGTH_FACTOR * float(np.sqrt(face.mesh.area / len(stations)))
    lengths, clouds = Lengths(length, length), measured_points(pattern)
    places, areas = associated.places(face, lengths)
    heights = np.column_stack([_heights_at(stations, cloud, str(path), face, associated) for path, cloud in clouds.items()])
    weights = np.linalg.solve(covariance(form, lengths, associated.surface, stations, stations), heights)
    functions = associated_covariance(form, lengths, associated, places, stations) @ weights  # (place, part)
    shares = areas / areas.sum()
    remainder, removed = beside_displacements(functions, associated, places, shares)
    mean, count = remainder.mean(axis=1), remainder.shape[1]
    _, spreads, directions = np.linalg.svd((remainder - mean[:, None]) / np.sqrt(count - 1), full_matrices=False)
    kept = min(form.modes, int((spreads**2 > MIN_VARIANCE * spreads[0] ** 2).sum()))
    # Of the parts: their mean, then components that have the length 1, as the spreads have the unit.
    mixes = np.column_stack([np.full(count, 1 / count), (directions[:kept] / spreads[:kept, None]).T / np.sqrt(count - 1)])
    mixes[:, 1:] -= mixes[:, 1:].mean(axis=0)
    size = max(float(np.linalg.norm(mean)), 1e-300)
    mixes[:, 0] /= size
    field = FormField(
        form=form,
        associated=associated,
        lengths=lengths,
        places=places,
        stations=stations,
        weights=weights @ mixes,
        removed=removed @ mixes,
        left_out=float((spreads[kept:] ** 2).sum() / (spreads**2).sum()),
        spreads=np.array([0.0, *spreads[:kept]]),
        means=np.array([size, *[0.0] * kept]),
        scans={},
    )
    widths = least_widths(field.zone, (remainder / np.sqrt(shares)[:, None]).T)
    return replace(field, scans={str(path): float(width) for path, width in zip(clouds, widths, strict=True)})


def _heights_at(stations: np.ndarray, cloud: np.ndarray, name: str, face: Surface, associated: AssociatedFeature) -> np.ndarray:
    """Return the heights (station,) [mm] of a measured part at stations (station, 3), from its points (point, 3)."""
    outward = -1.0 if any(piece.is_hollow for piece in face.pieces) else 1.0
    heights = outward * associated.surface.distance(cloud)[0]
    farthest = int(np.abs(heights).argmax())
    if abs(heights[farthest]) > MAX_HEIGHT_SHARE * face.mesh.scale:
        raise GeometryFault(
            f'"{name}": point {farthest + 1} is {abs(heights[farthest]):.3g} mm away from the face; expected points of the '
            "face, in mm in the frame of the part"
        )
    if len(cloud) < NEIGHBOURS:
        raise GeometryFault(f'"{name}" has {len(cloud)} points; expected at least {NEIGHBOURS}, all over the face')
    feet = associated.surface.project(cloud)
    distances, _ = scipy.spatial.KDTree(feet).query(stations)
    if distances.max() > face.mesh.scale / 4:
        raise GeometryFault(
            f'"{name}" has no points within {distances.max():.3g} mm of a place of the face; expected points all over it'
        )
    return _interpolated(feet, heights, stations, associated.surface.distance(stations)[1])


def _interpolated(feet: np.ndarray, heights: np.ndarray, stations: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return heights (station,) between those of feet (point, 3): paraboloids through the nearest, weighed by distance."""
    distances, numbers = scipy.spatial.KDTree(feet).query(stations, NEIGHBOURS)
    u = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    arms = (feet[numbers] - stations[:, None]) / distances.max(axis=1)[:, None, None]
    x, y = (np.einsum("spk,sk->sp", arms, direction) for direction in (u, np.cross(normals, u)))
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=2)
    roots = 1 / np.maximum(np.hypot(x, y), MIN_DISTANCE)[..., None]
    solutions = np.linalg.pinv(roots * terms, rcond=1e-6) @ (roots * heights[numbers][..., None])
    return np.asarray(solutions[:, 0, 0])
