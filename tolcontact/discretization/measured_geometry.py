"""Measured faces with numbers: walls, axes and directions, as measurements need them. Nominal assembly frame, mm."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tolcontact.declaration import Face
from tolcontact.discretization.round_points import RoundPoints
from tolcontact.errors import GeometryFault
from tolcontact.features import AxisFeature, FaceDeviation, FeatureGeometry, FeatureOfSize, PlaneFeature, feature_geometry
from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Plane
from tolcontact.geometry.nearest_elements import NearestElements
from tolcontact.geometry.surface import Surface


@dataclass(frozen=True, eq=False)
class MeasuredFace:
    """A face in its nominal place, with the number of its part and the deviation of its feature, if it has one."""

    face: Face
    part: int
    surface: Surface
    deviation: FaceDeviation | None

    def wall(self, near: np.ndarray) -> "Wall":
        """Return the whole surface of the face; without an analytic one, its tangent plane nearest to a point (3,)."""
        if self.surface.is_flat:
            return Wall(self.part, self.plane, 1.0, self.deviation)
        if piece := self.surface.only_piece:
            return Wall(self.part, piece.surface, -1.0 if piece.is_hollow else 1.0, self.deviation)
        feet, normals, _ = self.surface.project(near[None])
        return Wall(self.part, Plane(feet[0], normals[0]), 1.0, self.deviation)

    @cached_property
    def geometry(self) -> FeatureGeometry:
        """The kind of the face, with its numbers. Raises GeometryFault if it spans several surfaces."""
        return feature_geometry([self.surface])

    @property
    def plane(self) -> Plane:
        """The plane of a flat face, with its outward normal. Raises GeometryFault for other faces."""
        geometry = self.geometry
        if not isinstance(geometry, PlaneFeature):
            raise GeometryFault(f"its face {self.face} is {geometry.in_words}; expected a plane")
        return Plane(geometry.centre, geometry.normal)

    @property
    def axis(self) -> "Axis":
        """The axis of a cylinder or cone, or the centre of a sphere. Raises GeometryFault for other faces."""
        geometry = self.geometry
        if isinstance(geometry, AxisFeature):
            direction = geometry.axis
        elif isinstance(geometry, FeatureOfSize) and not isinstance(geometry, PlaneFeature):
            direction = np.zeros(3)
        else:
            raise GeometryFault(f"its face {self.face} is {geometry.in_words}, which has no axis; choose a cylinder or a cone")
        radius = geometry.size / 2 if isinstance(geometry, FeatureOfSize) else 0.0
        ends = np.array([geometry.end(0), geometry.end(1)])
        return Axis(self.part, ends, direction, radius, self.deviation)

    @property
    def direction(self) -> np.ndarray:
        """The normal of a plane, or the direction of an axis (3,). Raises GeometryFault for other faces."""
        geometry = self.geometry
        if isinstance(geometry, PlaneFeature):
            return geometry.normal
        if isinstance(geometry, AxisFeature):
            return geometry.axis
        raise GeometryFault(
            f"its face {self.face} is {geometry.in_words}, which has no direction; choose a plane or a cylinder"
        )


@dataclass(frozen=True, eq=False)
class MeasuredPoint:
    """A point (3,) [mm] of a part, and the deviation and the outward normal (3,) of the face that it is on, if any."""

    part: int
    position: np.ndarray
    deviation: FaceDeviation | None
    outward: np.ndarray


@dataclass(frozen=True, eq=False)
class Wall:
    """An analytic surface of a part; `side` is 1, or -1 if its free side is inside."""

    part: int
    surface: AnalyticSurface
    side: float
    deviation: FaceDeviation | None

    def foot(self, place: np.ndarray) -> np.ndarray:
        """Return the point of the surface (3,) nearest to a point (3,)."""
        return np.asarray(self.surface.project(place[None])[0])


@dataclass(frozen=True, eq=False)
class Axis:
    """An axis with its ends (2, 3) [mm] and its direction (3,), 0 for a centre, and the radius [mm] of its face."""

    part: int
    ends: np.ndarray
    direction: np.ndarray
    radius: float
    deviation: FaceDeviation | None

    @property
    def midpoint(self) -> np.ndarray:
        """The midpoint (3,) between the ends."""
        return np.asarray(self.ends.mean(axis=0))


@dataclass(frozen=True, eq=False)
class NominalMeasurement:
    """A measurement with numbers.

    lines   (line, 2, 3) [mm] the ends of the lines that show it
    """

    lines: np.ndarray


@dataclass(frozen=True, eq=False)
class LinearForm(NominalMeasurement):
    """A constant, and deviations times factors (link,), by their columns (link,)."""

    constant: float
    columns: np.ndarray
    factors: np.ndarray


@dataclass(frozen=True, eq=False)
class FaceMeasurement(NominalMeasurement):
    """A measurement between a moving and a reference face."""

    moving: MeasuredFace
    reference: MeasuredFace


@dataclass(frozen=True, eq=False)
class Crossing:
    """An edge (end, 3) [mm] of a moving face that crosses one of a reference face, seen along its outward normal.

    sense   1 or -1, so that sense times the cross product of the edges points outward from the reference face
    """

    moving: MeasuredFace
    reference: MeasuredFace
    edges: tuple[np.ndarray, np.ndarray]
    sense: float


@dataclass(frozen=True, eq=False)
class Heights(NominalMeasurement):
    """The least height of points over walls, and of edges over the edges that they cross."""

    points: Sequence[tuple[MeasuredPoint, Wall]]
    crossings: Sequence[Crossing] = ()


@dataclass(frozen=True, eq=False)
class FaceGap(NominalMeasurement):
    """The largest or the mean height of points of a face, each over its own wall; `weights` are shares of the area."""

    points: Sequence[tuple[MeasuredPoint, Wall]]
    weights: np.ndarray
    is_largest: bool


@dataclass(frozen=True, eq=False)
class Outline:
    """The rim of a plane face: its corners (corner, 3) [mm], and edges (edge, 2) as indices of corners."""

    vertices: np.ndarray
    edges: np.ndarray

    @classmethod
    def of(cls, surface: Surface) -> "Outline":
        """Return the rim of a face."""
        used, edges = np.unique(surface.rim, return_inverse=True)
        return cls(surface.vertices[used], edges.reshape(-1, 2))


@dataclass(frozen=True, eq=False)
class PlaneClearance(FaceMeasurement):
    """The least height between two planes where they overlap; `heights` applies at poses without an overlap."""

    planes: tuple[Plane, Plane]
    outlines: tuple[Outline, Outline]
    heights: Heights


@dataclass(frozen=True, eq=False)
class RoundClearance(FaceMeasurement):
    """The least gap between balls or shafts and walls."""

    points: RoundPoints


@dataclass(frozen=True, eq=False)
class MeshClearance(FaceMeasurement):
    """The least distance of two faces by their triangles. `box` (corner, 3) [mm] is around the moving one."""

    elements: NearestElements
    box: np.ndarray


@dataclass(frozen=True, eq=False)
class AxisPair(NominalMeasurement):
    """The distance between two axes; `across` and `along` (3,) as for an AxisDistance."""

    moving: Axis
    reference: Axis
    across: np.ndarray | None = None
    along: np.ndarray | None = None
    is_between_surfaces: bool = False


@dataclass(frozen=True, eq=False)
class DirectionPair(FaceMeasurement):
    """The angle between two directions (3,) of faces, about a direction (3,) or in space."""

    directions: tuple[np.ndarray, np.ndarray]
    about: np.ndarray | None


@dataclass(frozen=True, eq=False)
class Combined(NominalMeasurement):
    """A combination of a kind; operands are indices of measures, or measurements."""

    kind: str
    operands: Sequence[int | NominalMeasurement]
