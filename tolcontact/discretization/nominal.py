"""The nominal model: every declared thing with its numbers, in the nominal assembly frame W. Lengths in mm."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import trimesh

from tolcontact.declaration import Assembly, Face, Locator, Measure, Part, Point, ThreeTwoOne
from tolcontact.discretization.locators import Locators
from tolcontact.discretization.offsets import Offsets
from tolcontact.discretization.round_points import RoundPoints
from tolcontact.features import FaceDeviation, Features, NominalFeature
from tolcontact.geometry.curvature import chord_height
from tolcontact.geometry.face_pair import FacePair, side
from tolcontact.geometry.faces import triangles
from tolcontact.geometry.surface import Surface


@dataclass(frozen=True, eq=False)
class NominalPart:
    """A part in its nominal place.

    vertices, faces      its surface (vertex, 3) [mm], (face, 3), fine enough to show displacement fields
    locators             those that hold it, as `scheme` declares them; none if it is fixed
    parent               index of the part that it is located on; None for the ground
    """

    name: str
    part: Part
    placement: tuple[np.ndarray, np.ndarray]
    mesh: trimesh.Trimesh
    vertices: np.ndarray
    faces: np.ndarray
    locators: Locators
    scheme: ThreeTwoOne | tuple[Locator, ...] | None
    parent: int | None
    free: bool

    @cached_property
    def body(self) -> trimesh.Trimesh:
        """Its mesh in its nominal place."""
        return trimesh.Trimesh(self.placed(np.asarray(self.mesh.vertices)), self.mesh.faces, process=False)

    def placed(self, p: np.ndarray) -> np.ndarray:
        """Own coordinates (..., 3) to nominal assembly coordinates (..., 3) [mm]."""
        R_WP, t_WP = self.placement
        return np.asarray(p @ R_WP.T + t_WP)


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """Contact points of one pair, fixed for all realizations: P^m, P^r, n^r of the paper, each (point, 3).

    One-sided locators are contact points, too: of their part against what it is located on, a part or (None) the ground.
    Their `offsets` are the locators' deviations. They have no faces; of a pair of faces `surface` is the reference face in
    its nominal place, and `own` the moving one.
    `facets` [mm] is how far their triangles may lie off the round faces that they approximate. Where `round` says
    that a ball or a shaft touches walls, gaps are not those of fixed points: they follow from it at any pose.
    `deviating` is what the moving and the reference face deviate by, if they are of features; heights of fixed points are
    among the offsets. `locators` (point,) are the numbers of those that the points are, if they are supports.
    """

    name: str
    moving: int
    reference: int | None
    P_m: np.ndarray
    P_r: np.ndarray
    n_r: np.ndarray
    offsets: Offsets
    surface: Surface | None = None
    own: Surface | None = None
    facets: float = 0.0
    round: RoundPoints | None = None
    deviating: tuple[FaceDeviation | None, FaceDeviation | None] = (None, None)
    locators: np.ndarray | None = None

    @cached_property
    def facing(self) -> np.ndarray:
        """-n^m . n^r (point,): the share of the moving face's height by which it comes nearer there."""
        if self.own is None or self.round:
            return np.ones(len(self.P_m))
        triangle, nearest = self.own.nearest(self.P_m)
        return np.asarray(-(self.own.normals(triangle, nearest) * self.n_r).sum(axis=1))

    def heights(self, deviations: np.ndarray) -> np.ndarray:
        """How much farther out its two faces lie together (row,) [mm], for deviations (row, contributor)."""
        found = np.zeros(len(deviations))
        for face in self.deviating:
            if face is not None and face.grows:
                found += face.heights(deviations)
        return found

    @cached_property
    def bulge(self) -> float:
        """How far [mm] round surfaces that were fitted to triangles, and count instead, stand out of these."""
        faces = [face for face in (self.own, self.surface) if face is not None]
        pieces = [piece.face for face in faces for piece in face.pieces if piece.surface.is_fitted]
        return max(map(chord_height, pieces), default=0.0)

    @property
    def in_words(self) -> str:
        """How many points they are, of what, and what they rely on."""
        said = f"{len(self.P_m)} contact points{', exact on round faces' if self.round else ''}"
        return said + (f"; triangles up to {self.bulge:.2g} mm inside" if self.bulge > 0 else "")

    @property
    def is_supports(self) -> bool:
        """Whether they are one-sided locators."""
        return self.surface is None


@dataclass(frozen=True, eq=False)
class Nominal:
    """An assembly with numbers: what everything downstream is built from."""

    assembly: Assembly
    parts: tuple[NominalPart, ...]
    pairs: tuple[ContactPoints, ...]
    measures: tuple[Measure, ...]
    _features: Features
    _face_pairs: dict[int, FacePair] = field(default_factory=dict, init=False)

    def face_pair(self, index: int) -> FacePair | None:
        """The faces of a pair as they are; None for one-sided locators, which have none."""
        pair = self.pairs[index]
        if pair.own is None or pair.surface is None or pair.reference is None:
            return None
        if index not in self._face_pairs:
            self._face_pairs[index] = FacePair(
                side(pair.own, self.parts[pair.moving].body, len(pair.P_m)),
                side(pair.surface, self.parts[pair.reference].body, len(pair.P_m)),
            )
        return self._face_pairs[index]

    @cached_property
    def locators(self) -> Locators:
        """Those of all parts, one part after the other: the first columns of deviations."""
        return Locators.joined(part.locators for part in self.parts)

    @property
    def features(self) -> tuple[NominalFeature, ...]:
        """Those of all parts."""
        return tuple(self._features.features)

    @property
    def faces(self) -> tuple[FaceDeviation, ...]:
        """The faces of features that pairs and locators are of."""
        return self._features.faces

    @cached_property
    def contributors(self) -> tuple[str, ...]:
        """Labels of all that varies, the columns of deviations: locators, freedoms of features, and variables."""
        return (*self.locators.labels, *self._features.labels, *(each.name for each in self.assembly.variables))

    def columns(self, part: int) -> np.ndarray:
        """Which of them belong to a part."""
        first = sum(len(own.locators) for own in self.parts[:part])
        return np.arange(first, first + len(self.parts[part].locators))

    def part_index(self, part: Part) -> int:
        return self.assembly.parts.index(part)

    def triangles(self, face: Face) -> list[int]:
        """Indices of the triangles, in their part's mesh, of which a face consists or is cut."""
        return [int(k) for k in triangles(face, {part.part: part.mesh for part in self.parts})]

    def position(self, point: Point) -> np.ndarray:
        """Nominal assembly coordinates (3,) [mm] of a declared point."""
        own = (
            point.position
            if point.end is None or point.on is None
            else self._features.nominal(point.on).geometry.end(point.end)
        )
        return self.parts[self.part_index(point.part)].placed(np.array(own))

    def face_at(self, point: Point) -> FaceDeviation | None:
        """What a declared point moves with beside its part: the face of its feature that it is on, or the middle of two."""
        if point.on is None:
            return None
        own = self._features.nominal(point.on)
        number = None if point.position is None else own.face_with(np.array(point.position))
        return own.deviation(number, self.parts[own.part].placement)

    def outward(self, point: Point) -> np.ndarray:
        """Outward normal (3,), in the nominal assembly frame, of the face at a point on a feature."""
        part = self.parts[self.part_index(point.part)]
        if point.on is None or point.position is None:
            return np.zeros(3)
        surface = self._features.nominal(point.on).surfaces[0]  # what grows in height has one face
        triangle, foot = surface.nearest(np.array([point.position]))
        return np.asarray(part.placement[0] @ surface.normals(triangle, foot)[0])
