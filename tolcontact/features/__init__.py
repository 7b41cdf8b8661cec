"""Features: the freedoms that their tolerances control, their datum systems and zones, and how their faces deviate."""

from tolcontact.features.feature_geometry import AxisFeature, FeatureOfSize, PlaneFeature
from tolcontact.features.nominal_features import FaceDeviation, Features, NominalFeature, datum_order
from tolcontact.features.tolerance_kinds import zone_of
from tolcontact.features.tolerance_layers import Layer

__all__ = [
    "AxisFeature",
    "FaceDeviation",
    "FeatureOfSize",
    "Features",
    "Layer",
    "NominalFeature",
    "PlaneFeature",
    "datum_order",
    "zone_of",
]
