"""Features: tolerances of a drawing become freedoms of faces.

.. include:: ../guide/features.md
"""

from tolcontact.features.datum_planes import TangentPlane
from tolcontact.features.face_deviation import FaceDeviation
from tolcontact.features.feature_geometry import AxisFeature, FeatureGeometry, FeatureOfSize, PlaneFeature
from tolcontact.features.feature_recognition import feature_geometry
from tolcontact.features.form_field import FormField
from tolcontact.features.nominal_features import Features, NominalFeature, NominalPattern, Placement
from tolcontact.features.tolerance_layers import Datum, Layer, datum_order

__all__ = [
    "AxisFeature", "Datum", "FaceDeviation", "FeatureGeometry", "FeatureOfSize", "Features", "FormField", "Layer",
    "NominalFeature", "NominalPattern", "Placement", "PlaneFeature", "TangentPlane", "datum_order", "feature_geometry",
]  # fmt: skip
