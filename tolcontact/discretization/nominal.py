"""The nominal model: every declared thing with its numbers, in the nominal assembly frame W. Lengths in mm."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.spatial import KDTree

from tolcontact import poses as pose
from tolcontact.arrays import Array, Float
from tolcontact.declaration import Assembly, Face, Measure, Part, Point
from tolcontact.discretization.form_points import COVER_SHARE, form_lengths, form_spacing
from tolcontact.discretization.locators import Locators, NominalPart
from tolcontact.discretization.measured_geometry import NominalMeasurement
from tolcontact.discretization.offsets import Offsets, PairForm
from tolcontact.discretization.plane_minima import PlaneMinima
from tolcontact.discretization.point_weights import CountedRegion, counted_regions, point_weights
from tolcontact.discretization.round_points import RoundPoints
from tolcontact.discretization.weld import ElasticInputs, Weld
from tolcontact.features import Expansion, FaceDeviation, Features, Freedom, NominalFeature, NominalPattern
from tolcontact.features.freedoms import LOCATOR, VARIABLE
from tolcontact.features.zone_kernel import sum_modes
from tolcontact.geometry.face_pair import FacePair, body_face
from tolcontact.geometry.faces import Meshes, triangles
from tolcontact.geometry.overlap import points_on_rim
from tolcontact.geometry.surface import Surface

EVERY_POINT = slice(None)
RIM_REACH = 0.1  # of the size of the moving face: how far from it, nominally, rim points of the other face count
FITTED_ERRORS = 2.0  # coordinate errors: largest distance of triangles from the planes fitted to them, and from their inset
GAPS_TOGETHER = 1 << 20  # that are computed at once


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """Contact points of one pair, fixed for all realizations: P^m, P^r, n^r of the paper, each (point, 3).

    The one-sided locators of a part are also a pair of this kind, and so is each compliant two-sided locator. Their reference
    is the part that they are on, or None for the ground. They have no faces; their offsets are the deviations.

    moving_face, reference_face   in their nominal poses
    within      [mm] how far from each other opposite faces count in an objective
    coordinate_error   [mm] of both bodies, as their files store them: P_r lie below the reference face by it
    facets      [mm] largest distance between their triangles and the round faces that these approximate
    sampling_error   [mm] that bodies may penetrate undetected between points of curved faces; None for other points
    round       balls and shafts against walls, whose gaps are known at any pose; None if the contact points are fixed
    deviating   deviations of the moving and the reference face, if these belong to features; their heights at fixed points are
                among the offsets
    locators    (point,) indices of the one-sided locators
    stiffness   (point,) [N/mm] of springs, infinite for rigid one-sided locators; None for rigid faces
    pulls       (point,): whether the spring of a two-sided locator pulls at a point; None if none does
    holds, elastic   whether its point is a two-sided locator, which pushes and pulls; whether one of its parts is elastic
    """

    name: str
    moving: int
    reference: int | None
    P_m: np.ndarray
    P_r: np.ndarray
    n_r: np.ndarray
    offsets: Offsets
    reference_face: Surface | None = None
    moving_face: Surface | None = None
    within: float = np.inf
    coordinate_error: float = 0.0
    facets: float = 0.0
    sampling_error: float | None = None
    round: RoundPoints | None = None
    deviating: tuple[FaceDeviation | None, FaceDeviation | None] = (None, None)
    locators: np.ndarray | None = None
    stiffness: np.ndarray | None = None
    pulls: np.ndarray | None = None
    holds: bool = False
    elastic: bool = False

    @cached_property
    def facing(self) -> np.ndarray:
        """The decrease -n^m . n^r (point,) of gaps per unit height of the moving face."""
        if self.moving_face is None or self.round:
            return np.ones(len(self.P_m))
        triangle, nearest = self.moving_face.nearest(self.P_m)
        return -(self.moving_face.normals(triangle, nearest) * self.n_r).sum(axis=1)

    def heights(self, deviations: np.ndarray) -> np.ndarray:
        """Return the sum of the outward offsets of both faces (row,) [mm] for deviations (row, contributor), without form."""
        heights = np.zeros(len(deviations))
        for face in self.deviating:
            if face is not None and face.grows:
                heights += face.heights(deviations)
        return heights

    def counted(self, *, of_moving: bool) -> tuple[Float[Array, "point 3"], Float[Array, " point"]]:
        """Return the points whose displacement an objective counts on one side, and the radii [mm] of spheres around them.

        These are contact points, but the centres of round faces: a point on a round face would leave its part free to roll, so
        that it could move aside at no cost until it is clear. In a hollow wall the tangent planes have contact points on all
        sides, which is as good. An end of a shaft's axis has no radius, since the other end holds the shaft.
        """
        if self.round is None or not self.round.are_beside:
            return (self.P_m if of_moving else self.P_r), np.zeros(len(self.P_m))
        centres, radii = zip(*(point.curvature(of_moving=of_moving) for point in self.round), strict=True)
        is_end = self.round.points["axis"].any(axis=1) & (self.round.points["on_moving"] == of_moving)
        return np.array(centres), np.where(is_end, 0.0, radii)

    @property
    def has_form(self) -> bool:
        """Whether one of the faces has form."""
        return any(face is not None and face.form is not None for face in self.deviating)

    @property
    def form_spacing(self) -> float:
        """The usual spacing [mm] of contact points of faces with form."""
        return form_spacing(form_lengths(self.deviating))

    @cached_property
    def minima(self) -> PlaneMinima | None:
        """The gap between contact points of two rigid planes with form; None for other pairs."""
        if not self.has_form or self.moving_face is None or self.reference_face is None or self.is_springy:
            return None
        if not (self.moving_face.is_flat and self.reference_face.is_flat):
            return None
        distance = np.quantile(KDTree(self.P_m).query(self.P_m, k=2)[0][:, 1], 0.9) if len(self.P_m) > 1 else 0.0
        reach = max(self.form_spacing / COVER_SHARE, float(distance))
        return PlaneMinima.of((self.moving_face, self.reference_face), self.deviating, reach)

    @cached_property
    def reference_rim(self) -> np.ndarray:
        """Points (point, 3) [mm] along the rim of a reference face where faces with form may touch."""
        assert self.moving_face is not None and self.reference_face is not None
        points = points_on_rim(self.reference_face, self.form_spacing)
        distance = np.linalg.norm(self.moving_face.nearest(points)[1] - points, axis=1)
        return points[distance < RIM_REACH * self.moving_face.mesh.scale]

    def form(self, deviations: np.ndarray) -> PairForm:
        """Return the forms of both faces for deviations (row, contributor)."""
        return PairForm(self.deviating, deviations)

    def form_heights(self, deviations: np.ndarray, points: np.ndarray | slice = EVERY_POINT) -> np.ndarray:
        """Return the sums of both forms (row, point) [mm] at contact points, for deviations (row, contributor)."""
        heights = np.zeros((len(deviations), len(self.P_m[points])))
        for columns, modes in self._modes:
            sum_modes(np.ascontiguousarray(deviations[:, columns]), np.ascontiguousarray(modes[:, points]), heights)
        return heights

    @cached_property
    def _modes(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """The columns (mode,) of the forms of both faces, and their heights (mode, point) at the points per unit deviation."""
        sides = zip(self.deviating, (self.P_m, self.P_r), (self.facing, np.ones(len(self.P_m))), strict=True)
        return [
            (face.form_columns, np.ascontiguousarray((face.form.heights(P) * share[:, None]).T))
            for face, P, share in sides
            if face is not None and face.form is not None
        ]

    def nominal_gaps(self, X_RM: np.ndarray, points: np.ndarray | slice = EVERY_POINT) -> np.ndarray:
        """Return the gaps (row, point) [mm] of fixed contact points at X_RM (row, 12), without any deviation of the faces."""
        return np.asarray(((pose.apply(X_RM, self.P_m[points]) - self.P_r[points]) * self.n_r[points]).sum(axis=2))

    def least_gap(self, X_RM: np.ndarray, deviations: np.ndarray | None = None) -> np.ndarray:
        """Return the least gap (row,) [mm] of the points at X_RM (row, 12) for deviations (row, contributor) of the faces."""
        gaps, together = np.empty(len(X_RM)), max(1, GAPS_TOGETHER // max(len(self.P_m), 1))
        for k in range(0, len(X_RM), together):
            rows = slice(k, k + together)
            of_points = self.nominal_gaps(X_RM[rows])
            if deviations is not None and self.has_form:
                of_points -= self.form_heights(deviations[rows])
            gaps[rows] = of_points.min(axis=1)
        return gaps if deviations is None else gaps - self.heights(deviations)

    @cached_property
    def weights(self) -> Float[Array, " point"]:
        """The weights of the points (point,), by the areas that they represent; equal ones without sampled faces."""
        if self.moving_face is None or self.reference_face is None or self.round is not None:
            return np.ones(len(self.P_m))
        return point_weights(self.P_m, self.P_r, self.moving_face, self.reference_face)

    @cached_property
    def regions(self) -> tuple[CountedRegion | None, CountedRegion | None]:
        """The parts of the moving and of the reference face that an objective counts."""
        return counted_regions(self.moving_face, self.reference_face, self.within)

    @cached_property
    def bulge(self) -> float:
        """The largest height [mm] of round surfaces over the triangles that they were fitted to and replace."""
        pieces = [piece for face in (self.moving_face, self.reference_face) if face is not None for piece in face.pieces]
        return max((piece.face.chord_height for piece in pieces if piece.surface.is_fitted), default=0.0)

    @property
    def in_words(self) -> str:
        """The number and the kind of the points, and their accuracy."""
        text = f"{len(self.P_m)} contact points{', exact on round faces' if self.round else ''}"
        return text + (f"; triangles up to {self.bulge:.2g} mm inside" if self.bulge > 0 else "")

    @property
    def is_springy(self) -> bool:
        """Whether some of the points are compliant, by springs or by elastic parts."""
        return self.elastic or (self.stiffness is not None and bool(np.isfinite(self.stiffness).any()))

    @property
    def is_supports(self) -> bool:
        """Whether the points are locators."""
        return self.reference_face is None


@dataclass(frozen=True, eq=False)
class Nominal(ElasticInputs):
    """An assembly with numbers.

    measurements   of each measure; None if it measures points or an expression
    scenes         the models of the stations, which share the parts: each has its own measures; none without stations
    station        the name of the station, in the model of one
    welds          of elastic parts; their gaps are inputs of a realization after its deviations

    With stations a part has an entry among the `parts` in each station that holds it, station by station.
    """

    assembly: Assembly
    parts: tuple[NominalPart, ...]
    pairs: tuple[ContactPoints, ...]
    measures: tuple[Measure, ...]
    _features: Features
    measurements: tuple[NominalMeasurement | None, ...] = ()
    scenes: "tuple[Nominal, ...]" = ()
    station: str = ""
    welds: tuple[Weld, ...] = ()
    _face_pairs: dict[int, FacePair] = field(default_factory=dict, init=False)

    def face_pair(self, index: int) -> FacePair | None:
        """Return the faces of a pair with their bodies; None for one-sided locators, which have none."""
        pair = self.pairs[index]
        if pair.moving_face is None or pair.reference_face is None or pair.reference is None:
            return None
        if index not in self._face_pairs:
            self._face_pairs[index] = FacePair(
                body_face(pair.moving_face, self.parts[pair.moving].body, len(pair.P_m)),
                body_face(pair.reference_face, self.parts[pair.reference].body, len(pair.P_m)),
                FITTED_ERRORS * pair.coordinate_error,
            )
        return self._face_pairs[index]

    @cached_property
    def locators(self) -> Locators:
        """The locators of all parts, one part after the other: the first columns of deviations."""
        return Locators.joined(part.locators for part in self.parts)

    @property
    def features(self) -> tuple[NominalFeature, ...]:
        """The features of all parts, among them the members of patterns."""
        return tuple(self._features.features.values())

    @property
    def patterns(self) -> tuple[NominalPattern, ...]:
        """The features that are toleranced together, of all parts; a single feature is a pattern of one member."""
        return tuple(self._features.patterns)

    def datums(self, part: int) -> dict[str | None, tuple[NominalFeature, ...]]:
        """Return the datums of a part by their letters: several features or targets for a common datum."""
        return self._features.datums(part)

    @property
    def faces(self) -> tuple[FaceDeviation, ...]:
        """The deviating faces of features that belong to pairs and locators."""
        return self._features.faces

    @cached_property
    def freedoms(self) -> tuple[Freedom, ...]:
        """The freedoms of locators, features and variables, without spreads: column k of deviations belongs to freedom k."""
        locators = zip(self.locators.labels, self.locators.tolerances, strict=True)
        return (
            *(Freedom(label, LOCATOR, tolerance) for label, tolerance in locators),
            *self._features.freedoms,
            *(Freedom(cause.name, VARIABLE, cause.tolerance, units=cause.units) for cause in self.assembly.variables),
        )

    @cached_property
    def contributors(self) -> tuple[str, ...]:
        """The labels of the freedoms."""
        return tuple(freedom.label for freedom in self.freedoms)

    def columns(self, part: int) -> np.ndarray:
        """Return the columns of a part's locators."""
        start = sum(len(earlier.locators) for earlier in self.parts[:part])
        return np.arange(start, start + len(self.parts[part].locators))

    def part_index(self, part: Part, station: str = "") -> int:
        """Return the index of a part: in a station, or in the last one that holds it."""
        return self._indices[part, station or self.station]

    @cached_property
    def _indices(self) -> dict[tuple[Part, str], int]:
        last = {(entry.part, ""): index for index, entry in enumerate(self.parts)}
        return last | {(entry.part, entry.station): index for index, entry in enumerate(self.parts)}

    @cached_property
    def last_indices(self) -> np.ndarray:
        """The index (part,) of each part of the assembly in the last station that holds it."""
        return np.array([self._indices[part, ""] for part in self.assembly.parts], dtype=int)

    def number(self, index: int) -> int:
        """Return the index of a part of a station among the parts of the assembly."""
        return self.assembly.parts.index(self.parts[index].part)

    def may_differ(self, index: int) -> bool:
        """Return whether contact may move a part in its own station, or moved it in an earlier one that joined it."""
        part = self.parts[index]
        return bool(part.movers) or (bool(self.scenes) and part.station != self.scenes[0].station)

    @property
    def last_parts(self) -> tuple[NominalPart, ...]:
        """The parts of the assembly, each in the last station that holds it."""
        return tuple(self.parts[index] for index in self.last_indices)

    @property
    def lines(self) -> list[np.ndarray]:
        """The lines (line, 2, 3) [mm] that show each measurement; none for measures of points and expressions."""
        return [np.zeros((0, 2, 3)) if measurement is None else measurement.lines for measurement in self.measurements]

    @property
    def meshes(self) -> Meshes:
        """The mesh of each part, in its own frame."""
        return {part.part: part.mesh for part in self.parts}

    def triangles(self, face: Face) -> list[int]:
        """Return the indices of the triangles of a face in its part's mesh."""
        return [int(k) for k in triangles(face, self.meshes)]

    def deviation(self, face: Face) -> FaceDeviation | None:
        """Return how a face deviates; None if it neither belongs to a feature nor expands. Raises GeometryFault."""
        return self._features.deviation(face, self.meshes, self.parts[self.part_index(face.part)].placement)

    def position(self, point: Point) -> np.ndarray:
        """Return the nominal assembly coordinates (3,) [mm] of a declared point."""
        return self.parts[self.part_index(point.part)].placed(self._features.position(point))

    def face_at(self, point: Point) -> FaceDeviation | None:
        """Return how a declared point moves with the face of its feature, or the median of two, and expands; else None."""
        return self._features.of_point(point, self.parts[self.part_index(point.part)].placement)

    def expansion(self, index: int) -> Expansion | None:
        """Return the expansion of a part by temperatures; None if none expands it."""
        return self._features.expansion(self.parts[index].part)

    def outward(self, point: Point) -> np.ndarray:
        """Return the outward normal (3,) of the face at a point on a feature, in the nominal assembly frame."""
        part = self.parts[self.part_index(point.part)]
        if point.on is None or point.position is None:
            return np.zeros(3)
        surface = self._features.features[point.on].surfaces[0]  # features that grow in height have one face
        triangle, foot = surface.nearest(np.array([point.position]))
        return part.placement[0] @ surface.normals(triangle, foot)[0]
