"""The zone of a tolerance as rows: a feature is inside if none of their lengths, at its coordinates, exceeds half the width."""

import numpy as np

from tolcontact.declaration import GeometricTolerance
from tolcontact.declaration.feature_tolerance import ORIENTATIONS
from tolcontact.features.feature_geometry import FeatureGeometry, axis_rows
from tolcontact.geometry.fault import GeometryFault

RUNOUTS = ("circular run-out", "total run-out")
ACROSS = 0.999  # of a direction: how much of it must lie across an axis


def zone_rows(tolerance: GeometricTolerance, feature: FeatureGeometry, primary: FeatureGeometry | None) -> np.ndarray:
    """Rows (point, component, coordinate); none of a tolerance of form. `primary` is the first datum feature.

    Raises GeometryFault if features of that kind cannot have the tolerance.
    """
    kind, count = tolerance.kind, len(feature.names)
    _check_kind(tolerance, feature)
    if kind == "flatness":
        return np.zeros((0, 1, count))
    if kind == "profile" and feature.walls is not None:
        return feature.rows(*feature.walls)
    if kind == "profile" or not (feature.is_axis or kind in ORIENTATIONS or kind in RUNOUTS):
        return feature.extremes
    if feature.is_plane:
        return _halved_differences(feature)
    if kind in ORIENTATIONS:
        return _at(tolerance, feature, np.array([1.0]), tilt_only=True)
    return _at(tolerance, feature, _places(tolerance, feature, primary))


def _check_kind(tolerance: GeometricTolerance, feature: FeatureGeometry) -> None:
    kind = tolerance.kind
    if not feature.is_axis and (tolerance.zone or tolerance.along is not None or tolerance.projected is not None):
        raise GeometryFault(f"{kind}: zone, along and projected are for axes; leave them out")
    if kind == "flatness":
        _need(tolerance, feature, feature.is_plane, "planes")
    elif kind in ORIENTATIONS or kind in RUNOUTS:
        _need(tolerance, feature, feature.is_plane or feature.is_axis, "planes, cylinders and cones")
    elif kind == "coaxiality":
        _need(tolerance, feature, feature.is_axis or feature.kind == "sphere", "cylinders, cones and spheres")
    elif kind == "symmetry":
        between = feature.kind == "planes" or (feature.is_axis and tolerance.zone == "flat")
        _need(tolerance, feature, between, 'two opposed planes, or axes with zone="flat"')
    elif kind == "profile" and tolerance.outside is not None:
        _need(tolerance, feature, feature.kind == "plane", "planes, if it says how much of it is outside")
    elif kind == "position" and feature.kind == "general":
        raise GeometryFault(f"position needs a plane, cylinder, cone or sphere, and it is {feature.said}; use tc.Profile")


def _need(tolerance: GeometricTolerance, feature: FeatureGeometry, has_it: bool, wanted: str) -> None:
    if not has_it:
        raise GeometryFault(f"{tolerance.kind} is for {wanted}, and it is {feature.said}")


def _halved_differences(feature: FeatureGeometry) -> np.ndarray:
    """Of a plane: half of what one of its extremes stands higher than another; of those two that can be farthest apart.

    These are opposite corners of its outline, in a direction between two of those across its edges.
    """
    rows = feature.extremes[:, 0]
    tilts = rows[:, 1:]  # the offset is the same everywhere
    around = tilts[np.argsort(np.arctan2(*(tilts - tilts.mean(axis=0)).T))]
    edges = np.roll(around, -1, axis=0) - around
    across = np.sort(np.arctan2(edges[:, 0], -edges[:, 1]) % np.pi)  # opposite edges look the same way
    between = (across + np.roll(across, -1) + np.pi * (np.arange(len(across)) == len(across) - 1)) / 2
    heights = np.column_stack([np.cos(between), np.sin(between)]) @ tilts.T
    pairs = np.unique(np.column_stack([heights.argmax(axis=1), heights.argmin(axis=1)]), axis=0)
    return np.asarray((rows[pairs[:, 0]] - rows[pairs[:, 1]])[:, None] / 2)


def _at(tolerance: GeometricTolerance, feature: FeatureGeometry, places: np.ndarray, *, tilt_only: bool = False) -> np.ndarray:
    """Of an axis, at some places: in a round zone, or between planes."""
    across = None
    if tolerance.zone == "flat" and tolerance.across is not None:
        across = feature.twists[:3, :2].T @ np.array(tolerance.across)
        if np.linalg.norm(across) < ACROSS:
            raise GeometryFault(f"{tolerance.kind}: along={tolerance.along!r} is not across its axis; give a direction that is")
    rows = axis_rows(places, len(feature.names), across)
    if tilt_only:
        rows[..., :2] = 0
    return rows


def _places(tolerance: GeometricTolerance, feature: FeatureGeometry, primary: FeatureGeometry | None) -> np.ndarray:
    """Where on the axis the zone is, in halves of its length from its middle."""
    if tolerance.projected is None:
        return np.array([-1.0, 1.0])
    slope = 0.0 if primary is None or not primary.is_plane else float(primary.axis @ feature.axis)
    if abs(slope) < ACROSS:
        raise GeometryFault(
            f"{tolerance.kind}: a projected zone needs a plane across the axis as its primary datum, out of which it stands"
        )
    end = np.sign(slope)
    return np.array([end, end * (1 + tolerance.projected / feature.half)])
