"""Tolerance kinds: the features that each kind of tolerance is for, and its zone.

A new kind is a row in `declaration/feature_tolerance.py` and a row of ZONES. A zone limits displacements of a feature; what
the datums of a tolerance leave free in it is found in `tolerance_layers`.

A zone is a function of the tolerance, the feature, and the geometry of the first datum feature (None without datums). It
returns rows (point, component, coordinate): inside the zone, no vector `rows[point] @ coordinates` exceeds half the width. It
raises GeometryFault if the feature cannot have a tolerance with these options.
"""

from collections.abc import Callable, Mapping

import numpy as np

from tolcontact.declaration import feature_tolerance as tolerances
from tolcontact.declaration.feature_tolerance import GeometricTolerance, ToleranceKind
from tolcontact.errors import GeometryFault
from tolcontact.features.feature_geometry import (
    AxisFeature,
    ConeFeature,
    CylinderFeature,
    FeatureGeometry,
    GeneralFeature,
    PlaneFeature,
    SlabFeature,
    SphereFeature,
)

MIN_ACROSS = 0.999  # of a direction: the part of it that must lie across an axis
Zone = Callable[[GeometricTolerance, FeatureGeometry, FeatureGeometry | None], np.ndarray]


def surface_zone(tolerance: GeometricTolerance, feature: FeatureGeometry, primary: FeatureGeometry | None) -> np.ndarray:
    """Return the rows of a zone on both sides of the nominal surface, or around a centre: it limits location."""
    _refuse_axis_options(tolerance)
    if tolerance.outside is not None and type(feature) is not PlaneFeature:
        raise GeometryFault(
            f"{tolerance.kind} is for planes, if it says how much of it is outside, and it is {feature.in_words}"
        )
    return feature.rows(feature.surface_probes)


def slope_zone(tolerance: GeometricTolerance, feature: FeatureGeometry, primary: FeatureGeometry | None) -> np.ndarray:
    """Return the rows of a zone between two planes that may lie anywhere: it limits the tilts of a plane."""
    _refuse_axis_options(tolerance)
    assert isinstance(feature, PlaneFeature)
    return feature.slopes


def axis_zone(tolerance: GeometricTolerance, feature: FeatureGeometry, primary: FeatureGeometry | None) -> np.ndarray:
    """Return the rows of a round zone around the nominal axis, or of a flat one: it limits the location of an axis."""
    assert isinstance(feature, AxisFeature)
    return feature.axis_rows(_zone_ends(tolerance, feature, primary), _across(tolerance, feature))


def flat_axis_zone(tolerance: GeometricTolerance, feature: FeatureGeometry, primary: FeatureGeometry | None) -> np.ndarray:
    """Return the rows of a zone of an axis that has to be flat."""
    if tolerance.zone != "flat":
        raise GeometryFault(f'{tolerance.kind} of an axis needs zone="flat", and along= across the planes of the zone')
    return axis_zone(tolerance, feature, primary)


def direction_zone(tolerance: GeometricTolerance, feature: FeatureGeometry, primary: FeatureGeometry | None) -> np.ndarray:
    """Return the rows of a zone as for the location of an axis that may lie anywhere: it limits the tilts of the axis."""
    assert isinstance(feature, AxisFeature)
    ends = _zone_ends(tolerance, feature, primary)
    length = (ends[1] - ends[0]) / 2  # of the zone, in lengths of the axis
    rows = feature.axis_rows(np.array([abs(length)]), _across(tolerance, feature))
    rows[..., :2] = 0
    return rows


def form_zone(tolerance: GeometricTolerance, feature: FeatureGeometry, primary: FeatureGeometry | None) -> np.ndarray:
    """Return no rows: a zone that may lie anywhere and has the nominal shape limits form, and no displacement."""
    _refuse_axis_options(tolerance)
    return np.zeros((0, 1, len(feature.names)))


def _refuse_axis_options(tolerance: GeometricTolerance) -> None:
    if tolerance.zone or tolerance.along is not None or tolerance.projected is not None:
        raise GeometryFault(f"{tolerance.kind}: zone, along and projected are for axes; leave them out")


def _across(tolerance: GeometricTolerance, feature: AxisFeature) -> np.ndarray | None:
    """Return the components (2,) of the direction across a flat zone in the two directions across the axis.

    A round zone has none.
    """
    if tolerance.zone != "flat" or tolerance.across is None:
        return None
    components = feature.twists[:3, :2].T @ np.array(tolerance.across)
    if np.linalg.norm(components) < MIN_ACROSS:
        raise GeometryFault(f"{tolerance.kind}: along={tolerance.along!r} is not across its axis; give a direction that is")
    return components


def _zone_ends(tolerance: GeometricTolerance, feature: AxisFeature, primary: FeatureGeometry | None) -> np.ndarray:
    """Return the ends (2,) of the zone on the axis, in halves of the axis' length from its middle."""
    if tolerance.projected is None:
        return np.array([-1.0, 1.0])
    slope = float(primary.normal @ feature.axis) if isinstance(primary, PlaneFeature) else 0.0
    if abs(slope) < MIN_ACROSS:
        raise GeometryFault(
            f"{tolerance.kind}: a projected zone needs a plane across the axis as its primary datum, out of which it stands"
        )
    end = np.sign(slope)
    return np.array([end, end * (1 + tolerance.projected / feature.half)])


Zones = Mapping[type[FeatureGeometry], Zone]
ROUND = (CylinderFeature, ConeFeature)
FLAT = (PlaneFeature, SlabFeature)
LOCATION: Zones = dict.fromkeys((*FLAT, SphereFeature), surface_zone) | dict.fromkeys(ROUND, axis_zone)
ORIENTATION: Zones = dict.fromkeys(FLAT, slope_zone) | dict.fromkeys(ROUND, direction_zone)
RUNOUT: Zones = dict.fromkeys(FLAT, slope_zone) | dict.fromkeys(ROUND, axis_zone)
PROFILE: Zones = dict.fromkeys((*FLAT, *ROUND, SphereFeature, GeneralFeature), surface_zone)

ZONES: dict[ToleranceKind, Zones] = {
    tolerances.Position: LOCATION,
    tolerances.Coaxiality: dict.fromkeys(ROUND, axis_zone) | {SphereFeature: surface_zone},
    tolerances.Symmetry: {SlabFeature: surface_zone} | dict.fromkeys(ROUND, flat_axis_zone),
    tolerances.Profile: PROFILE,
    tolerances.LineProfile: PROFILE,
    tolerances.Parallelism: ORIENTATION,
    tolerances.Perpendicularity: ORIENTATION,
    tolerances.Angularity: ORIENTATION,
    tolerances.CircularRunout: RUNOUT,
    tolerances.TotalRunout: RUNOUT,
    tolerances.Straightness: dict.fromkeys((*FLAT, *ROUND), form_zone),
    tolerances.Flatness: dict.fromkeys(FLAT, form_zone),
    tolerances.Roundness: dict.fromkeys((*ROUND, SphereFeature), form_zone),
    tolerances.Cylindricity: {CylinderFeature: form_zone},
}


def zone_rows(tolerance: GeometricTolerance, feature: FeatureGeometry, primary: FeatureGeometry | None) -> np.ndarray:
    """Return the rows of the zone of a tolerance. Raises GeometryFault if the feature cannot have the tolerance."""
    zones = ZONES[tolerance.of]
    if type(feature) not in zones:
        *plurals, last = (kind.plural for kind in zones)
        kinds = f"{', '.join(plurals)} and {last}" if plurals else last
        advice = "; use tc.Profile" if isinstance(feature, GeneralFeature) else ""
        raise GeometryFault(f"{tolerance.kind} is for {kinds}, and it is {feature.in_words}{advice}")
    if tolerance.tangent and type(feature) is not PlaneFeature:
        raise GeometryFault(f"{tolerance.kind}: tangent is for planes, and it is {feature.in_words}; leave it out")
    return zones[type(feature)](tolerance, feature, primary)
