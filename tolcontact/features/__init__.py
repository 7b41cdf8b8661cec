"""Features: the freedoms that their tolerances control, their datum systems and zones, and how their faces deviate."""

from tolcontact.features.face_deviation import FaceDeviation
from tolcontact.features.nominal_features import Layer, NominalFeature

__all__ = ["FaceDeviation", "Layer", "NominalFeature"]
