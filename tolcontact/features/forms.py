"""Forms that are drawn: tolerances of form alone, the features that have a form field for them, and what it is measured from.

A new form is a row of DRAWN, and its associated feature.
"""

from collections.abc import Mapping, Sequence

from tolcontact.declaration import (
    Cylindricity,
    Feature,
    Flatness,
    GeometricTolerance,
    LineProfile,
    Pattern,
    Profile,
    Roundness,
    Straightness,
)
from tolcontact.declaration.feature_tolerance import ToleranceKind
from tolcontact.declaration.toleranced import Toleranced
from tolcontact.errors import GeometryFault
from tolcontact.features.associated_features import (
    AssociatedCircles,
    AssociatedFeature,
    AssociatedLines,
    AssociatedSurface,
)
from tolcontact.features.feature_geometry import (
    ConeFeature,
    CylinderFeature,
    FeatureGeometry,
    PlaneFeature,
    SphereFeature,
)
from tolcontact.features.feature_recognition import analytic_surface
from tolcontact.features.form_field import FormField, form_field
from tolcontact.features.measured_field import measured_field
from tolcontact.geometry.surface import Surface

Associated = Mapping[type[FeatureGeometry], type[AssociatedFeature]]
WITH_AXIS = (CylinderFeature, ConeFeature)
WHOLE: Associated = dict.fromkeys((PlaneFeature, *WITH_AXIS, SphereFeature), AssociatedSurface)

DRAWN: dict[ToleranceKind, Associated] = {
    Flatness: {PlaneFeature: AssociatedSurface},
    Cylindricity: {CylinderFeature: AssociatedSurface},
    Roundness: dict.fromkeys(WITH_AXIS, AssociatedCircles),
    Straightness: dict.fromkeys(WITH_AXIS, AssociatedLines),
    Profile: WHOLE,
    LineProfile: WHOLE,
}


# Of every feature that may have it. A roundness may be of part of a circle, a straightness of an axis.
DRAWN_ALWAYS = (Flatness, Cylindricity)


def is_drawn(kind: ToleranceKind, per: object) -> bool:
    """Return whether the form that a kind of tolerance limits, of any surface or `per` a length, can surely be drawn."""
    return kind in DRAWN_ALWAYS and per is None


def form_fields(
    declared: Feature | Pattern, members: Mapping[Feature, tuple[FeatureGeometry, Sequence[Surface]]]
) -> tuple[GeometricTolerance | None, dict[Feature, FormField]]:
    """Return the tolerance by which the form of members is drawn, and the form field of each; None, and none, without it."""
    form, fields = None, dict[Feature, FormField]()
    for member, (geometry, (surface, *_)) in members.items():
        form = _drawn_form(declared, geometry)
        field = None if form is None else _drawn_field(form, geometry, surface)
        if field is not None:
            fields[member] = field
    return form, fields


def _drawn_form(declared: Toleranced, geometry: FeatureGeometry) -> GeometricTolerance | None:
    """Return the tolerance by which the form of a feature is drawn, the narrowest one; None if it keeps its shape.

    Raises GeometryFault for a tolerance of form that cannot be drawn.
    """
    tolerances = [
        tolerance for tolerance in declared.geometric
        if tolerance.form is not None
        # Without datums, a profile of a pattern limits its members to each other.
        and (tolerance.is_form or (tolerance.limits_form_alone and isinstance(declared, Feature)))
    ]  # fmt: skip
    for tolerance in tolerances:
        if tolerance.per is not None or type(geometry) not in DRAWN.get(tolerance.of, {}):
            unit = " per unit" if tolerance.per is not None else ""
            raise GeometryFault(
                f"the form of {tolerance.kind}{unit} of {geometry.in_words} cannot be drawn; give the {tolerance.kind} "
                "form=None, and the feature keeps its shape"
            )
        if tolerance.form is not None and tolerance.form.lobes is not None and type(geometry) not in WITH_AXIS:
            raise GeometryFault(
                f"{tolerance.kind}: lobes are for cylinders and cones, and it is {geometry.in_words}; leave them out"
            )
    return min(tolerances, key=lambda tolerance: tolerance.width, default=None)


def _drawn_field(tolerance: GeometricTolerance, geometry: FeatureGeometry, face: Surface) -> FormField | None:
    """Return the form field of a face by a tolerance; None for a tolerance without form. Raises GeometryFault."""
    surface = analytic_surface(face)
    if tolerance.form is None or surface is None:
        return None
    associated = DRAWN[tolerance.of][type(geometry)].of(surface, face)
    if tolerance.form.measured is not None:
        return measured_field(tolerance.form, tolerance.form.measured, face, associated)
    return form_field(tolerance.form, face, associated)
