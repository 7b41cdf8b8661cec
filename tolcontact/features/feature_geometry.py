"""Features as kinds of geometry: their coordinates, measured as displacements at their extremes. Part's own frame.

A plane has an offset at its centre and tilts at its edges, an axis has shifts at its centre and tilts at its ends, a centre has
shifts. All coordinates are in mm and do not depend on the origin.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tolcontact.geometry.analytic_surfaces import AnalyticSurface
from tolcontact.geometry.brep_face import FIT_TOLERANCE

Probes = tuple[np.ndarray, np.ndarray]  # places (point, 3) [mm] and unit vectors (point, entry, 3) along which to measure there
Coordinates = tuple[np.ndarray, tuple[str, ...], np.ndarray, np.ndarray, Probes]  # the fields of a FeatureGeometry


@dataclass(frozen=True, eq=False)
class FeatureGeometry:
    """The coordinates of a feature.

    centre   (3,) [mm] of the rotations of twists
    names    of the coordinates
    twists   (6, coordinate): the displacement (tau, rho) of the feature for a coordinate of 1 mm
    values   (coordinate, 6): the coordinates of a displacement (tau, rho)
    extremes places (point, 3) [mm] and unit vectors (point, entry, 3): corners of a plane, ends of an axis, a centre, vertices
             of a general surface, and the directions of measurement there
    """

    plural: ClassVar[str]

    centre: np.ndarray
    names: tuple[str, ...]
    twists: np.ndarray
    values: np.ndarray
    extremes: Probes

    @property
    def in_words(self) -> str:
        """The kind of feature, with its article."""
        return f"a {self.plural.removesuffix('s')}"

    @property
    def reach(self) -> float:
        """The largest distance [mm] of an extreme from the centre; the radius of a sphere."""
        return float(np.linalg.norm(self.extremes[0] - self.centre, axis=1).max())

    @property
    def surface_probes(self) -> Probes:
        """Places and directions for measuring the profile of the feature's surface."""
        return self.extremes

    def rows(self, probes: Probes) -> np.ndarray:
        """Return the measurements of probes for coordinates of 1 mm: (point, entry, coordinate)."""
        places, directions = probes
        moved = self.twists[:3].T + np.cross(self.twists[3:].T, (places - self.centre)[:, None])
        return np.einsum("pqk,pek->peq", moved, directions)

    def about(self, centre: np.ndarray) -> np.ndarray:
        """Return `values` (coordinate, 6) for displacements with rotations about another centre (3,)."""
        # x -> tau + rho x (x - centre) is x -> tau' + rho x (x - c), c = self.centre, with tau' = tau + rho x (c - centre).
        x, y, z = self.centre - centre
        shift = np.eye(6)
        shift[:3, 3:] = -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return self.values @ shift

    def end(self, number: int) -> np.ndarray:
        """Return an end (3,) [mm] of the axis, 0 or 1; the centre of a feature that has none."""
        return self.centre


@dataclass(frozen=True, eq=False)
class FeatureOfSize(FeatureGeometry):
    """A feature with a diameter or a distance.

    size      [mm] nominal
    is_inner  whether it is a gap in the material: a hole, a slot
    """

    size: float
    is_inner: bool

    def growth(self, face: int, moving: Sequence[bool]) -> tuple[np.ndarray, float]:
        """Return how a face moves (3,) and grows out of the material as the size grows by 1; `moving`: the faces that do."""
        return np.zeros(3), -0.5 if self.is_inner else 0.5

    def middle(self, face: int) -> np.ndarray:
        """Return the point (3,) [mm] about which a face tilts."""
        return self.centre


@dataclass(frozen=True, eq=False)
class PlaneFeature(FeatureGeometry):
    """A plane with an outward normal (3,)."""

    plural: ClassVar[str] = "planes"

    normal: np.ndarray

    @property
    def slopes(self) -> np.ndarray:
        """Rows (pair, 1, coordinate): half the height difference of two corners, for the pairs that can differ most.

        These are opposite corners of the outline, in the directions halfway between those across two neighbouring edges.
        """
        heights = self.rows(self.extremes)[:, 0]
        tilts = heights[:, 1:]  # the offset is the same everywhere
        outline = tilts[np.argsort(np.arctan2(*(tilts - tilts.mean(axis=0)).T))]
        edges = np.roll(outline, -1, axis=0) - outline
        across = np.sort(np.arctan2(edges[:, 0], -edges[:, 1]) % np.pi)  # opposite edges have the same direction across
        halfway = (across + np.roll(across, -1) + np.pi * (np.arange(len(across)) == len(across) - 1)) / 2
        extents = np.column_stack([np.cos(halfway), np.sin(halfway)]) @ tilts.T
        pairs = np.unique(np.column_stack([extents.argmax(axis=1), extents.argmin(axis=1)]), axis=0)
        return (heights[pairs[:, 0]] - heights[pairs[:, 1]])[:, None] / 2


@dataclass(frozen=True, eq=False)
class SlabFeature(PlaneFeature, FeatureOfSize):
    """Two opposed planes, with their outward normals (3,): a thickness or a slot. Its middle has the coordinates of a plane."""

    plural: ClassVar[str] = "pairs of planes"

    normals: tuple[np.ndarray, np.ndarray]

    @property
    def in_words(self) -> str:
        return "a pair of planes"

    def growth(self, face: int, moving: Sequence[bool]) -> tuple[np.ndarray, float]:
        """Return how a face moves (3,) along its normal as the size grows by 1; it has no height of its own."""
        return self._outward(face) * moving[face] / sum(moving), 0.0

    def middle(self, face: int) -> np.ndarray:
        """Return the foot (3,) of the centre on the plane of a face: it would slide in its plane about others."""
        return self.centre + self._outward(face) * self.size / 2

    def _outward(self, face: int) -> np.ndarray:
        """Return the direction (3,) in which a face moves as the size grows."""
        return -self.normals[face] if self.is_inner else self.normals[face]


@dataclass(frozen=True, eq=False)
class AxisFeature(FeatureGeometry):
    """A feature with an axis: its direction (3,), and half its length [mm]. Coordinates: two shifts, then two tilts."""

    axis: np.ndarray
    half: float

    def end(self, number: int) -> np.ndarray:
        return self.centre + (2 * number - 1) * self.half * self.axis

    def axis_rows(self, places: np.ndarray, across: np.ndarray | None = None) -> np.ndarray:
        """Return rows (place, component, coordinate) of displacements of the axis at `places`.

        Places are in halves of the axis' length from its middle. The components are the two directions across the axis, or
        the one direction whose parts in these two are `across` (2,).
        """
        rows = np.zeros((len(places), 2, len(self.names)))
        rows[:, 0, 0] = rows[:, 1, 1] = 1.0
        rows[:, 0, 2] = rows[:, 1, 3] = places
        return rows if across is None else np.einsum("c,pcq->pq", across, rows)[:, None]


@dataclass(frozen=True, eq=False)
class CylinderFeature(AxisFeature, FeatureOfSize):
    """A cylinder."""

    plural: ClassVar[str] = "cylinders"


@dataclass(frozen=True, eq=False)
class ConeFeature(AxisFeature):
    """A cone, with places on its surface and the normals there. Its last coordinate is along the axis."""

    plural: ClassVar[str] = "cones"

    walls: Probes

    @property
    def surface_probes(self) -> Probes:
        return self.walls

    @property
    def apex(self) -> np.ndarray:
        """The apex (3,) [mm], where the axis meets the tangent planes of the wall."""
        place, normal = self.walls[0][0], self.walls[1][0, 0]
        return np.asarray(self.centre + ((place - self.centre) @ normal) / (self.axis @ normal) * self.axis)


@dataclass(frozen=True, eq=False)
class SphereFeature(FeatureOfSize):
    """A sphere, whose centre shifts."""

    plural: ClassVar[str] = "spheres"

    @property
    def reach(self) -> float:
        return self.size / 2


@dataclass(frozen=True, eq=False)
class GeneralFeature(FeatureGeometry):
    """A surface of no simple kind, and the simple surface that its vertices come nearest to."""

    plural: ClassVar[str] = "general surfaces"

    nearest: AnalyticSurface | None

    @property
    def in_words(self) -> str:
        if self.nearest is None:
            return "a general surface"
        deviation = f"is off by up to {self.nearest.residual:.2g} mm, more than {FIT_TOLERANCE:g}"
        return f"a general surface (the nearest {self.nearest.kind} {deviation})"
