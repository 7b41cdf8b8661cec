"""Thermal expansion: all of a part moves away from the origin of its frame, in proportion, so that its sizes grow, too."""

from dataclasses import dataclass, replace

import numpy as np

from tolcontact.errors import GeometryFault
from tolcontact.features.feature_geometry import ConeFeature, FeatureGeometry, FeatureOfSize, GeneralFeature
from tolcontact.features.nominal_feature import FaceDeviation, Placement


@dataclass(frozen=True, eq=False)
class Expansion:
    """The expansion of a part by temperatures: a point p of its frame goes to (1 + strain) p.

    columns       (cause,) of the temperatures among the deviations
    coefficients  (cause,) strain per unit of each temperature
    """

    columns: np.ndarray
    coefficients: np.ndarray

    def of_face(
        self, name: str, deviation: FaceDeviation | None, geometry: FeatureGeometry, placement: Placement
    ) -> FaceDeviation:
        """Return the deviation of a face that expands, in addition to the `deviation` of its feature.

        A plane, cylinder, cone or sphere keeps its kind: it moves, and grows in height if it has a radius. Its rim follows its
        centre alone. Raises GeometryFault for a general surface.
        """
        if isinstance(geometry, GeneralFeature):
            raise GeometryFault(f"it is {geometry.in_words}, whose expansion is not known; choose planes and round faces")
        fixed_point = geometry.apex if isinstance(geometry, ConeFeature) else geometry.centre
        height = geometry.growth(0, (True,))[1] * geometry.size if isinstance(geometry, FeatureOfSize) else 0.0
        return self._added(name, deviation, fixed_point, height, placement)

    def of_point(self, name: str, deviation: FaceDeviation | None, position: np.ndarray, placement: Placement) -> FaceDeviation:
        """Return the deviation of a point (3,) [mm] of the part that expands, in addition to the `deviation` of its feature."""
        return self._added(name, deviation, position, 0.0, placement)

    def _added(
        self, name: str, deviation: FaceDeviation | None, position: np.ndarray, height: float, placement: Placement
    ) -> FaceDeviation:
        R, t = placement
        if deviation is None:
            deviation = FaceDeviation(name, np.zeros(0, dtype=int), R @ position + t, np.zeros((6, 0)), np.zeros(0))
        motion = np.outer(np.concatenate([R @ position, np.zeros(3)]), self.coefficients)
        return replace(
            deviation,
            columns=np.concatenate([deviation.columns, self.columns]),
            twist=np.hstack([deviation.twist, motion]),
            height=np.concatenate([deviation.height, height * self.coefficients]),
        )
