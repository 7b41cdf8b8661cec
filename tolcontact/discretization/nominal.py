"""The nominal model: every declared thing with its numbers, in the nominal assembly frame W. Lengths in mm."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from tolcontact.arrays import Array, Int
from tolcontact.declaration import Assembly, Face, Measure, Part, Point
from tolcontact.discretization.fixed_contact import ContactPoints
from tolcontact.discretization.locators import Locators, NominalPart
from tolcontact.discretization.measured_geometry import NominalMeasurement
from tolcontact.discretization.weld_pairs import Weld
from tolcontact.features import Expansion, FaceDeviation, Features, Freedom, NominalFeature, NominalPattern
from tolcontact.features.freedoms import LOCATOR, VARIABLE
from tolcontact.geometry.face_pair import FacePair, body_face
from tolcontact.geometry.faces import Meshes, triangles

FITTED_ERRORS = 2.0  # coordinate errors: largest distance of triangles from the planes fitted to them, and from their inset


@dataclass(frozen=True, eq=False)
class Nominal:
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

    @property
    def input_count(self) -> int:
        """The number of inputs of a realization: its deviations, and the gaps that welds keep."""
        return len(self.contributors) + sum(len(weld.columns) for weld in self.welds)

    @cached_property
    def loads(self) -> Int[Array, "load 2"]:
        """The pair and the point of each load: of the reactions at the contact points of pairs with an elastic part."""
        points = [(k, point) for k, pair in enumerate(self.pairs) if pair.elastic for point in range(len(pair.P_m))]
        return np.array(points, dtype=int).reshape(-1, 2)

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
