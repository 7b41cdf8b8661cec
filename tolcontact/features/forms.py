"""Forms that are drawn: tolerances of form alone, and the kinds of features that have a form field for them.

A new form is a row of DRAWN, and its field.
"""

from tolcontact.declaration import Feature, Flatness, GeometricTolerance, LineProfile, Profile
from tolcontact.declaration.toleranced import Toleranced
from tolcontact.errors import GeometryFault
from tolcontact.features.feature_geometry import FeatureGeometry, PlaneFeature

DRAWN: dict[type[GeometricTolerance], type[FeatureGeometry]] = {
    Flatness: PlaneFeature, Profile: PlaneFeature, LineProfile: PlaneFeature,
}  # fmt: skip


def is_drawn(kind: type[GeometricTolerance], per: object) -> bool:
    """Return whether the form that a kind of tolerance limits, of whole surfaces or `per` a length, can be drawn."""
    return kind in DRAWN and per is None


def drawn_form(declared: Toleranced, geometry: FeatureGeometry) -> GeometricTolerance | None:
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
        if not is_drawn(type(tolerance), tolerance.per) or DRAWN[type(tolerance)] is not type(geometry):
            unit = " per unit" if tolerance.per is not None else ""
            raise GeometryFault(
                f"the form of {tolerance.kind}{unit} of {geometry.in_words} cannot be drawn, only that of a whole plane; "
                f"give the {tolerance.kind} form=None, and the feature keeps its shape"
            )
    return min(tolerances, key=lambda tolerance: tolerance.width, default=None)
