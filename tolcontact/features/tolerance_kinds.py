"""Tolerance kinds: the features that each kind of tolerance is for, its zone, and how a measured feature is judged by it.

A new kind is a class in `declaration/feature_tolerance.py` and a row of ZONES. A zone limits displacements of a feature; what
the datums of a tolerance leave free in it is found in `tolerance_layers`.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from tolcontact.declaration import feature_tolerance as tolerances
from tolcontact.declaration.feature_tolerance import GeometricTolerance
from tolcontact.errors import GeometryFault
from tolcontact.features.feature_geometry import (
    AxisFeature,
    ConeFeature,
    CylinderFeature,
    FeatureGeometry,
    GeneralFeature,
    PlaneFeature,
    Probes,
    SlabFeature,
    SphereFeature,
)

MIN_ACROSS = 0.999  # of a direction: the part of it that must lie across an axis


@dataclass(frozen=True, eq=False)
class Zone(ABC):
    """The zone of a tolerance of a feature. `primary` is the geometry of the first datum feature; None without datums.

    Raises GeometryFault if the feature cannot have a tolerance with these options.
    """

    tolerance: GeometricTolerance
    feature: FeatureGeometry
    primary: FeatureGeometry | None

    def __post_init__(self) -> None:
        if self.tolerance.zone or self.tolerance.along is not None or self.tolerance.projected is not None:
            raise GeometryFault(f"{self.tolerance.kind}: zone, along and projected are for axes; leave them out")

    @property
    @abstractmethod
    def rows(self) -> np.ndarray:
        """Rows (point, component, coordinate): inside, no vector `rows[point] @ coordinates` exceeds half the width."""

    @property
    def probes(self) -> Probes:
        """The places and directions in which the feature is measured."""
        return self.feature.extremes

    @abstractmethod
    def needed_width(self, residuals: np.ndarray) -> np.ndarray:
        """Return the width (n,) [mm] of the narrowest zone around what probes measured (n, point, entry) [mm]."""


class SurfaceZone(Zone):
    """A zone on both sides of the nominal surface, or around a centre: it limits location."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.tolerance.outside is not None and type(self.feature) is not PlaneFeature:
            raise GeometryFault(
                f"{self.tolerance.kind} is for planes, if it says how much of it is outside, and it is {self.feature.in_words}"
            )

    @property
    def rows(self) -> np.ndarray:
        return self.feature.rows(self.probes)

    @property
    def probes(self) -> Probes:
        return self.feature.surface_probes

    def needed_width(self, residuals: np.ndarray) -> np.ndarray:
        return 2 * np.max([np.linalg.norm(residuals[:, k], axis=1) for k in range(residuals.shape[1])], axis=0)


class SlopeZone(Zone):
    """A zone between two planes that may lie anywhere: it limits the tilts of a plane."""

    feature: PlaneFeature

    @property
    def rows(self) -> np.ndarray:
        return self.feature.slopes

    def needed_width(self, residuals: np.ndarray) -> np.ndarray:
        return np.ptp(residuals[..., 0], axis=1)


class AxisZone(Zone):
    """A round zone around the nominal axis, or a flat one beside it: it limits the location of an axis."""

    feature: AxisFeature

    def __post_init__(self) -> None:
        """Axes have all options."""

    @property
    def rows(self) -> np.ndarray:
        return self.feature.axis_rows(self._ends, self._across)

    @property
    def probes(self) -> Probes:
        places, directions = self.feature.extremes
        if self.tolerance.projected is None or not isinstance(self.primary, PlaneFeature):
            return places, directions
        outward = self.feature.axis * np.sign(self.primary.normal @ self.feature.axis)
        start = self.feature.centre + self.feature.half * outward
        return np.array([start, start + self.tolerance.projected * outward]), directions

    def needed_width(self, residuals: np.ndarray) -> np.ndarray:
        return 2 * np.max([self._lengths(residuals[:, k]) for k in range(residuals.shape[1])], axis=0)

    def _lengths(self, vectors: np.ndarray) -> np.ndarray:
        """Return the lengths (n,) [mm] of vectors (n, entry) across the axis; in a flat zone those across its planes."""
        if self.tolerance.zone == "flat" and self.tolerance.across is not None:
            return np.abs(vectors @ (self.feature.extremes[1][0] @ np.array(self.tolerance.across)))
        return np.linalg.norm(vectors, axis=1)

    @property
    def _across(self) -> np.ndarray | None:
        """The parts (2,) of the direction across a flat zone in the two directions across the axis; None of a round zone."""
        if self.tolerance.zone != "flat" or self.tolerance.across is None:
            return None
        parts = self.feature.twists[:3, :2].T @ np.array(self.tolerance.across)
        if np.linalg.norm(parts) < MIN_ACROSS:
            raise GeometryFault(
                f"{self.tolerance.kind}: along={self.tolerance.along!r} is not across its axis; give a direction that is"
            )
        return parts

    @property
    def _ends(self) -> np.ndarray:
        """The ends of the zone on the axis, in halves of the axis' length from its middle."""
        if self.tolerance.projected is None:
            return np.array([-1.0, 1.0])
        slope = float(self.primary.normal @ self.feature.axis) if isinstance(self.primary, PlaneFeature) else 0.0
        if abs(slope) < MIN_ACROSS:
            raise GeometryFault(
                f"{self.tolerance.kind}: a projected zone needs a plane across the axis as its primary datum, out of which it "
                "stands"
            )
        end = np.sign(slope)
        return np.array([end, end * (1 + self.tolerance.projected / self.feature.half)])


class FlatAxisZone(AxisZone):
    """A zone of an axis that has to be flat."""

    def __post_init__(self) -> None:
        if self.tolerance.zone != "flat":
            raise GeometryFault(f'{self.tolerance.kind} of an axis needs zone="flat", and along= across the planes of the zone')


class DirectionZone(AxisZone):
    """A zone as for the location of an axis that may lie anywhere: it limits the tilts of the axis."""

    @property
    def rows(self) -> np.ndarray:
        length = (self._ends[1] - self._ends[0]) / 2  # of the zone, in lengths of the axis
        rows = self.feature.axis_rows(np.array([abs(length)]), self._across)
        rows[..., :2] = 0
        return rows

    def needed_width(self, residuals: np.ndarray) -> np.ndarray:
        return self._lengths(residuals[:, 1] - residuals[:, 0])


class FormZone(Zone):
    """A zone that may lie anywhere and has the nominal shape: it limits form, and no displacement."""

    @property
    def rows(self) -> np.ndarray:
        return np.zeros((0, 1, len(self.feature.names)))

    def needed_width(self, residuals: np.ndarray) -> np.ndarray:
        return np.zeros(len(residuals))


Zones = Mapping[type[FeatureGeometry], type[Zone]]
ROUND = (CylinderFeature, ConeFeature)
FLAT = (PlaneFeature, SlabFeature)
LOCATION: Zones = dict.fromkeys((*FLAT, SphereFeature), SurfaceZone) | dict.fromkeys(ROUND, AxisZone)
ORIENTATION: Zones = dict.fromkeys(FLAT, SlopeZone) | dict.fromkeys(ROUND, DirectionZone)
RUNOUT: Zones = dict.fromkeys(FLAT, SlopeZone) | dict.fromkeys(ROUND, AxisZone)
PROFILE: Zones = dict.fromkeys((*FLAT, *ROUND, SphereFeature, GeneralFeature), SurfaceZone)

ZONES: dict[type[GeometricTolerance], Zones] = {
    tolerances.Position: LOCATION,
    tolerances.Coaxiality: dict.fromkeys(ROUND, AxisZone) | {SphereFeature: SurfaceZone},
    tolerances.Symmetry: {SlabFeature: SurfaceZone} | dict.fromkeys(ROUND, FlatAxisZone),
    tolerances.Profile: PROFILE,
    tolerances.LineProfile: PROFILE,
    tolerances.Parallelism: ORIENTATION,
    tolerances.Perpendicularity: ORIENTATION,
    tolerances.Angularity: ORIENTATION,
    tolerances.CircularRunout: RUNOUT,
    tolerances.TotalRunout: RUNOUT,
    tolerances.Straightness: dict.fromkeys((*FLAT, *ROUND), FormZone),
    tolerances.Flatness: dict.fromkeys(FLAT, FormZone),
    tolerances.Roundness: dict.fromkeys((*ROUND, SphereFeature), FormZone),
    tolerances.Cylindricity: {CylinderFeature: FormZone},
}


def zone_of(tolerance: GeometricTolerance, feature: FeatureGeometry, primary: FeatureGeometry | None) -> Zone:
    """Return the zone of a tolerance of a feature. Raises GeometryFault if the feature cannot have the tolerance."""
    zones = ZONES[type(tolerance)]
    if type(feature) not in zones:
        *plurals, last = (kind.plural for kind in zones)
        kinds = f"{', '.join(plurals)} and {last}" if plurals else last
        advice = "; use tc.Profile" if isinstance(feature, GeneralFeature) else ""
        raise GeometryFault(f"{tolerance.kind} is for {kinds}, and it is {feature.in_words}{advice}")
    if tolerance.tangent and type(feature) is not PlaneFeature:
        raise GeometryFault(f"{tolerance.kind}: tangent is for planes, and it is {feature.in_words}; leave it out")
    return zones[type(feature)](tolerance, feature, primary)
