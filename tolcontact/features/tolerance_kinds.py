"""Tolerance kinds: the features that each kind of tolerance is for, its zone, and the form that it draws.

A new kind is a row in `declaration/feature_tolerance.py` and a row of ZONES. A zone limits displacements of a feature; the
datums of a tolerance leave some of these free (see nominal_pattern).

A zone is a function of the tolerance, the feature, and the geometry of the first datum feature (None without datums). It
returns rows (point, component, coordinate): inside the zone, no vector `rows[point] @ coordinates` exceeds half the width. It
raises GeometryFault if the feature cannot have a tolerance with these options.
"""

from collections.abc import Callable, Mapping

import numpy as np

from tolcontact.declaration import feature_tolerance as declared
from tolcontact.declaration.feature_tolerance import GeometricTolerance, ToleranceKind
from tolcontact.declaration.toleranced import Toleranced
from tolcontact.errors import GeometryFault
from tolcontact.features.associated_features import AssociatedCircles, AssociatedLines, AssociatedSurface
from tolcontact.features.feature_geometry import (
    AxisFeature,
    ConeFeature,
    CylinderFeature,
    FeatureGeometry,
    GeneralFeature,
    PlaneFeature,
    SlabFeature,
    SphereFeature,
)  # fmt: skip
from tolcontact.features.feature_recognition import analytic_surface
from tolcontact.features.form_field import FormField, form_field
from tolcontact.features.measured_field import measured_field
from tolcontact.geometry.surface import Surface

MIN_ACROSS = 0.999  # of a direction: the part of it that must lie across an axis
Zone = Callable[[GeometricTolerance, FeatureGeometry, FeatureGeometry | None], np.ndarray]


def surface_zone(tolerance: GeometricTolerance, feature: FeatureGeometry, primary: FeatureGeometry | None) -> np.ndarray:
    """Return the rows of a zone on both sides of the nominal surface, or around a centre: it limits location."""
    if tolerance.outside is not None and type(feature) is not PlaneFeature:
        raise GeometryFault(
            f"{tolerance.kind} is for planes, if it says how much of it is outside, and it is {feature.in_words}"
        )
    return feature.rows(feature.surface_probes)


def slope_zone(tolerance: GeometricTolerance, feature: FeatureGeometry, primary: FeatureGeometry | None) -> np.ndarray:
    """Return the rows of a zone between two planes that may lie anywhere: it limits the tilts of a plane."""
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
    return np.zeros((0, 1, len(feature.names)))


def _across(tolerance: GeometricTolerance, feature: AxisFeature) -> np.ndarray | None:
    """Return the components (2,) of the direction across a flat zone in the two directions across the axis; else None."""
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


ROUND = (CylinderFeature, ConeFeature)
FLAT = (PlaneFeature, SlabFeature)
Zones = Mapping[type[FeatureGeometry], Zone]  # of the kinds of features that may have a tolerance
LOCATION: Zones = dict.fromkeys((*FLAT, SphereFeature), surface_zone) | dict.fromkeys(ROUND, axis_zone)
ORIENTATION: Zones = dict.fromkeys(FLAT, slope_zone) | dict.fromkeys(ROUND, direction_zone)
RUNOUT: Zones = dict.fromkeys(FLAT, slope_zone) | dict.fromkeys(ROUND, axis_zone)
PROFILE: Zones = dict.fromkeys((*FLAT, *ROUND, SphereFeature, GeneralFeature), surface_zone)

ZONES: dict[ToleranceKind, Zones] = {
    declared.Position: LOCATION,
    declared.Coaxiality: dict.fromkeys(ROUND, axis_zone) | {SphereFeature: surface_zone},
    declared.Symmetry: {SlabFeature: surface_zone} | dict.fromkeys(ROUND, flat_axis_zone),
    declared.Profile: PROFILE,
    declared.LineProfile: PROFILE,
    declared.Parallelism: ORIENTATION,
    declared.Perpendicularity: ORIENTATION,
    declared.Angularity: ORIENTATION,
    declared.CircularRunout: RUNOUT,
    declared.TotalRunout: RUNOUT,
    declared.Straightness: dict.fromkeys((*FLAT, *ROUND), form_zone),
    declared.Flatness: dict.fromkeys(FLAT, form_zone),
    declared.Roundness: dict.fromkeys((*ROUND, SphereFeature), form_zone),
    declared.Cylindricity: {CylinderFeature: form_zone},
}
PROFILE_FORMS = dict.fromkeys((PlaneFeature, *ROUND, SphereFeature), AssociatedSurface)
# What form deviations are measured from, for the kinds of features whose form a tolerance draws.
FORMS: dict[ToleranceKind, Mapping[type[FeatureGeometry], type[AssociatedSurface]]] = {
    declared.Profile: PROFILE_FORMS,
    declared.LineProfile: PROFILE_FORMS,
    declared.Straightness: dict.fromkeys(ROUND, AssociatedLines),
    declared.Flatness: {PlaneFeature: AssociatedSurface},
    declared.Roundness: dict.fromkeys(ROUND, AssociatedCircles),
    declared.Cylindricity: {CylinderFeature: AssociatedSurface},
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
    zone = zones[type(feature)]
    if zone in (surface_zone, slope_zone, form_zone) and (
        tolerance.zone or tolerance.along is not None or tolerance.projected is not None
    ):
        raise GeometryFault(f"{tolerance.kind}: zone, along and projected are for axes; leave them out")
    return zone(tolerance, feature, primary)


def includes_form(tolerance: GeometricTolerance, feature: FeatureGeometry) -> bool:
    """Return whether a zone contains the surface with its form: not the axis or the tangent plane alone."""
    return not tolerance.tangent and (isinstance(feature, PlaneFeature) or tolerance.of.limits_wall)


def floats(tolerance: GeometricTolerance, feature: FeatureGeometry, rows: np.ndarray) -> bool:
    """Return whether a zone with these rows may lie anywhere along the normals of the surface, a round one with any radius."""
    if isinstance(feature, PlaneFeature):
        return not rows[..., 0].any()  # it limits tilts alone, and not the offset, the first coordinate of a plane
    return tolerance.of.has_any_size


def is_drawn(kind: ToleranceKind, per: object) -> bool:
    """Return whether the form that a kind of tolerance limits, of any surface or `per` a length, can surely be drawn.

    A roundness may limit part of a circle, a straightness an axis: what is drawn of these are circles and lines.
    """
    return per is None and all(associated.is_whole for associated in FORMS[kind].values())


def form_tolerance(toleranced: Toleranced, feature: FeatureGeometry) -> GeometricTolerance | None:
    """Return the tolerance that draws the form of a feature, the narrowest one; None if it keeps its shape.

    Raises GeometryFault for a tolerance of form that cannot be drawn.
    """
    tolerances = [
        tolerance for tolerance in toleranced.geometric
        if tolerance.form is not None
        # Without datums, a profile with combined zones limits the members of a pattern to each other.
        and (tolerance.is_form or (tolerance.limits_form_alone and not toleranced.combines(tolerance)))
    ]  # fmt: skip
    for tolerance in tolerances:
        unit = "" if tolerance.per is None else " per unit"
        if unit or type(feature) not in FORMS[tolerance.of]:
            raise GeometryFault(
                f"the form of {tolerance.kind}{unit} of {feature.in_words} cannot be drawn; give the {tolerance.kind} "
                "form=None, and the feature keeps its shape"
            )
        if tolerance.form is not None and tolerance.form.lobes is not None and type(feature) not in ROUND:
            raise GeometryFault(
                f"{tolerance.kind}: lobes are for cylinders and cones, and it is {feature.in_words}; leave them out"
            )
    return min(tolerances, key=lambda tolerance: tolerance.width, default=None)


def form_field_of(tolerance: GeometricTolerance, feature: FeatureGeometry, face: Surface) -> FormField:
    """Return the form field of a face by the tolerance that draws its form (see form_tolerance). Raises GeometryFault."""
    form, surface = tolerance.form, analytic_surface(face)
    assert form is not None and surface is not None
    associated = FORMS[tolerance.of][type(feature)].of(surface, face)
    return form_field(form, face, associated) if form.measured is None else measured_field(form, face, associated)
