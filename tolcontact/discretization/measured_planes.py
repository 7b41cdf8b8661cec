"""Planes through a few measured points: the deviations of a feature's freedoms, with their standard uncertainties.

Heights h of the points over the nominal plane are fitted by least squares with its offset and its tilts, h = A q + e. The
residuals of n points have n - 3 degrees of freedom, and give the covariance s^2 (A^T A)^-1 of q: scatter of the machine, and
form that a few points cannot show. Three points leave no residuals.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from tolcontact.declaration import Assembly
from tolcontact.discretization.discretizing import discretize
from tolcontact.errors import OptionError, nearest_name
from tolcontact.features import FeatureOfSize, PlaneFeature

MIN_POINTS = 3
MAX_HEIGHT_SHARE = 0.02  # of a plane's reach: a point further away was not measured on it
MIN_SPREAD = 0.05  # of the half extent of a plane, root mean square: points along a line show no tilt across it


class MeasuredPlanes(NamedTuple):
    """The deviations of a plane of measured parts, as `population` takes them.

    values         arrays (part,) [mm] by the label of the contributor, such as "block.top.offset"
    uncertainties  their standard uncertainties (part,) [mm]; NaN for three points
    freedoms       (part,) degrees of freedom of the uncertainties: points less 3
    """

    values: dict[str, np.ndarray]
    uncertainties: dict[str, np.ndarray]
    freedoms: np.ndarray


def measured_planes(model: Assembly, feature: str, parts: Sequence[Any]) -> MeasuredPlanes:
    """Return the deviations of a plane of each measured part from 3 or more points on it; 4 or more give uncertainties.

    model    the assembly that declares the feature, with its tolerances
    feature  the plane, as "part.feature"
    parts    for each measured part its points (point, 3) [mm], in the frame of the part

    A plane without form is fitted by least squares; use tc.Form(measured=...) for scans of 24 points or more that show form.
    Deviations that no tolerance of the feature controls are left out, as the model does not vary these. Raises OptionError for
    a feature that is no plane, and for points that are too few, along a line, or not on the plane.

    `model.population(tc.io.measured_planes(model, "block.top", [np.loadtxt("part1.txt"), np.loadtxt("part2.txt")]).values)`
    """
    nominal = discretize(model, incomplete=True)
    patterns = {pattern.declared.label: pattern for pattern in nominal.patterns if not pattern.is_gauge}
    if feature not in patterns:
        listed = ", ".join(patterns) or "none"
        raise OptionError(
            f'measured_planes: "{feature}" is no feature{nearest_name(feature, patterns)}; features are: {listed}'
        )
    pattern = patterns[feature]
    geometry = pattern.geometries[0]
    if len(pattern.members) > 1 or not isinstance(geometry, PlaneFeature) or isinstance(geometry, FeatureOfSize):
        raise OptionError(f'measured_planes: "{feature}" is {geometry.in_words}; expected one plane')
    labels = [nominal.freedoms[column].label for layer in pattern.layers for column in layer.columns]
    if not labels:
        raise OptionError(
            f'measured_planes: no tolerance of "{feature}" controls its place; give it tc.Profile(...), for example'
        )
    to_freedoms = np.linalg.pinv(np.hstack([layer.added for layer in pattern.layers]))
    fits = [_fitted(geometry, points, f'part {k} of "{feature}"') for k, points in enumerate(parts, start=1)]
    values = np.array([to_freedoms @ coordinates for coordinates, *_ in fits])
    variances = np.array([np.diag(to_freedoms @ covariance @ to_freedoms.T) for _, covariance, _ in fits])
    return MeasuredPlanes(
        dict(zip(labels, values.T, strict=True)),
        dict(zip(labels, np.sqrt(variances).T, strict=True)),
        np.array([count for *_, count in fits]),
    )


def _fitted(geometry: PlaneFeature, points: Any, place: str) -> tuple[np.ndarray, np.ndarray, int]:
    """Return the coordinates (3,) of a plane through points, their covariance, and its degrees of freedom."""
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all() or len(points) < MIN_POINTS:
        shape = " x ".join(map(str, points.shape))
        raise OptionError(f"measured_planes: {place} has {shape} numbers; expected x, y, z of {MIN_POINTS} points or more")
    heights = (points - geometry.centre) @ geometry.normal
    furthest = int(np.abs(heights).argmax())
    if abs(heights[furthest]) > MAX_HEIGHT_SHARE * geometry.reach:
        raise OptionError(
            f"measured_planes: {place}: point {furthest + 1} is {abs(heights[furthest]):.3g} mm away from the plane; expected "
            "points on it, in mm in the frame of the part"
        )
    terms = geometry.rows((points, np.tile(geometry.normal, (len(points), 1, 1))))[:, 0]
    if np.linalg.svd(terms - terms.mean(axis=0), compute_uv=False)[1] < MIN_SPREAD * np.sqrt(len(points)):
        raise OptionError(
            f"measured_planes: {place}: its points lie along a line, which shows one tilt; spread them over the plane"
        )
    coordinates, *_ = np.linalg.lstsq(terms, heights)
    count, residuals = len(points) - MIN_POINTS, heights - terms @ coordinates
    variance = float(residuals @ residuals) / count if count else np.nan
    return coordinates, variance * np.linalg.inv(terms.T @ terms), count
