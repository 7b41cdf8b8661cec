"""Features: tolerances of a drawing become freedoms of faces.

.. include:: ../guide/features.md
"""

from tolcontact.features.datum_frames import DatumShift, datum_frame, datum_order
from tolcontact.features.feature_geometry import AxisFeature, FeatureGeometry, FeatureOfSize, PlaneFeature
from tolcontact.features.feature_recognition import feature_geometry
from tolcontact.features.form_field import FormField
from tolcontact.features.freedoms import Freedom
from tolcontact.features.nominal_feature import Expansion, FaceDeviation, NominalFeature, Placement
from tolcontact.features.nominal_features import Features
from tolcontact.features.nominal_pattern import Layer, NominalPattern, uncontrolled

__all__ = [
    "AxisFeature", "DatumShift", "Expansion", "FaceDeviation", "FeatureGeometry", "FeatureOfSize", "Features", "FormField",
    "Freedom", "Layer", "NominalFeature", "NominalPattern", "Placement", "PlaneFeature", "datum_frame", "datum_order",
    "feature_geometry", "uncontrolled",
]  # fmt: skip
