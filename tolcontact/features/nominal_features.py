"""Features with numbers: which freedoms their tolerances control, and how their faces deviate with what varies."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from tolcontact.declaration import Face, Feature, GeometricTolerance, Part
from tolcontact.declaration.feature_tolerance import TRANSLATIONS
from tolcontact.features.datum_system import Datum, DatumFrame, datum_frame
from tolcontact.features.face_deviation import FaceDeviation
from tolcontact.features.feature_geometry import FeatureGeometry, feature_geometry
from tolcontact.features.zone_rows import zone_rows
from tolcontact.geometry.faces import Meshes, patch
from tolcontact.geometry.fault import GeometryFault
from tolcontact.geometry.regions import Region, region, share
from tolcontact.geometry.surface import Surface

Placement = tuple[np.ndarray, np.ndarray]  # R (3, 3) and t (3,) [mm] of a part in the nominal assembly
SAME = 1e-4  # smallest singular value of what is another direction: shapes of single precision are no better
SLIGHT = 1e-6  # of a face's area: less of it is none
ON = 1e-4  # of a face's size: how near a point on it is
SIZES = 1e-6  # of a size: what a shape's may differ from the one stated


@dataclass(frozen=True, eq=False)
class Layer:
    """What one tolerance controls of a feature, beside those that are contained in it.

    rows        (point, component, coordinate): its zone (see zone_rows)
    controlled  (coordinate, n): orthonormal directions that its datums lock, and
    added       (coordinate, k): those of them that no narrower tolerance has, and that its rule draws; each a contributor
    frame       of its datum system
    """

    tolerance: GeometricTolerance
    rows: np.ndarray
    controlled: np.ndarray
    added: np.ndarray
    frame: DatumFrame


@dataclass(frozen=True, eq=False)
class NominalFeature:
    """A feature in its part: its contributors are columns `first` on: the directions of its layers, then its size.

    labels       "part.feature.freedom" of its contributors
    coordinates  (coordinate, column): of the feature, for deviations of 1 of the columns of all features before, and its own
    surfaces     its faces, in the part's own frame, and
    regions      where they are on its mesh
    """

    feature: Feature
    part: int
    geometry: FeatureGeometry
    layers: tuple[Layer, ...]
    first: int
    labels: tuple[str, ...]
    coordinates: np.ndarray
    surfaces: tuple[Surface, ...]
    regions: tuple[Region, ...]

    @property
    def label(self) -> str:
        return f"{self.feature.part.name}.{self.feature.name}"

    @property
    def size_column(self) -> int | None:
        """The column of its size, if that is toleranced."""
        return self.first + len(self.labels) - 1 if self.feature.size else None

    def face_with(self, position: np.ndarray) -> int | None:
        """The number of the face that a point (3,) [mm] is on; None, which is the middle, if it is on neither of two."""
        if len(self.surfaces) == 1:
            return 0
        close = ON * max(surface.mesh.scale for surface in self.surfaces)
        away = [float(np.linalg.norm(surface.nearest(position[None])[1][0] - position)) for surface in self.surfaces]
        nearest = int(np.argmin(away))
        return nearest if away[nearest] <= close else None

    def deviation(self, number: int | None, placement: Placement) -> FaceDeviation:
        """How a face deviates in a part that is placed there; the middle, whose size does not count, if `number` is None."""
        geometry, size = self.geometry, self.feature.size
        twist, height = geometry.twists @ self.coordinates, np.zeros(self.coordinates.shape[1])
        if size is not None and number is not None:
            sign = -1.0 if geometry.is_inner else 1.0
            if geometry.kind == "planes":
                moves = _moving(self.feature)
                twist[:3, self.size_column] += sign * moves[number] / sum(moves) * geometry.normals[number]
            else:
                height[self.size_column] = sign / 2
        columns = np.flatnonzero(twist.any(axis=0) | (height != 0))
        R, t = placement
        turned = np.vstack([R @ twist[:3, columns], R @ twist[3:, columns]])
        return FaceDeviation(self.label, columns, R @ geometry.centre + t, turned, height[columns])


@dataclass(eq=False)
class Features:
    """The features of a model while it is discretized, and the faces that deviate with them."""

    first: int
    found: list[NominalFeature] = field(default_factory=list)
    _used_faces: dict[tuple[Feature, int | None], FaceDeviation] = field(default_factory=dict)

    @property
    def faces(self) -> tuple[FaceDeviation, ...]:
        """Those that pairs and locators are of."""
        return tuple(self._used_faces.values())

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(label for each in self.found for label in each.labels)

    def add(self, feature: Feature, part: int, meshes: Meshes) -> None:
        """The next feature, whose datums have been added before. Raises GeometryFault."""
        surfaces = tuple(patch(face, meshes) for face in feature.faces)
        regions = tuple(region(face, meshes) for face in feature.faces)
        self._check_shared(feature, regions, meshes)
        geometry = feature_geometry(surfaces)
        first = self.first + len(self.labels)
        layers = _layers(feature, geometry, {own.feature.datum: own for own in self.found if own.part == part}, first)
        names = [name for layer in layers for name in _names(geometry, layer.added)]
        if feature.size is not None:
            _check_size(feature, geometry)
            names.append("size")
        count = first + len(names)
        Q, column = np.zeros((len(geometry.names), count)), first
        for layer in layers:
            new = layer.added.shape[1]
            Q[:, column : column + new] = layer.added
            Q[:, :first] += layer.added @ layer.added.T @ geometry.values @ layer.frame.motion
            column += new
        labels = tuple(f"{feature.part.name}.{feature.name}.{name}" for name in names)
        self.found.append(NominalFeature(feature, part, geometry, layers, first, labels, Q, surfaces, regions))

    def _check_shared(self, feature: Feature, regions: Sequence[Region], meshes: Meshes) -> None:
        for other in (each for each in self.found if each.feature.part is feature.part):
            for own, moves in zip(regions, _moving(feature), strict=True):
                for theirs, moved in zip(other.regions, _moving(other.feature), strict=True):
                    if moves and moved and share(own, theirs, meshes[feature.part]) > SLIGHT:
                        raise GeometryFault(
                            f'it shares a face with feature "{other.feature.name}", so that would deviate twice; give all '
                            "tolerances of a face to one feature"
                        )

    def face_at(self, face: Face, meshes: Meshes, placement: Placement) -> FaceDeviation | None:
        """How a face deviates that all belongs to a feature; None if none of it does.

        Raises GeometryFault if some of it does.
        """
        deviating = [own for own in self.found if own.feature.part is face.part and own.labels]
        here = region(face, meshes) if deviating else None
        for own in deviating:
            for number, theirs in enumerate(own.regions):
                common = share(here, theirs, meshes[face.part]) if here else 0.0
                if common > 1 - SLIGHT and _moving(own.feature)[number]:
                    return self._used(own, number, placement)
                if SLIGHT < common <= 1 - SLIGHT:
                    raise GeometryFault(
                        f'its face on part "{face.part.name}" is partly that of feature "{own.feature.name}", which deviates '
                        "by itself; declare one pair (or scheme) for the feature, and another one for the rest"
                    )
        return None

    def held_at(self, feature: Feature, position: np.ndarray, placement: Placement) -> FaceDeviation | None:
        """How a feature deviates where a locator at a point (3,) [mm] of its part stands; None if it could not be made."""
        own = next((each for each in self.found if each.feature is feature), None)
        return None if own is None else self._used(own, own.face_with(position), placement)

    def _used(self, own: NominalFeature, number: int | None, placement: Placement) -> FaceDeviation:
        """The deviation of a face: the same object for all that it is of."""
        key = (own.feature, number)
        if key not in self._used_faces:
            self._used_faces[key] = own.deviation(number, placement)
        return self._used_faces[key]

    def of(self, feature: Feature) -> NominalFeature:
        """The numbers of a declared feature."""
        return next(own for own in self.found if own.feature is feature)


def _moving(feature: Feature) -> list[bool]:
    """Which faces of a feature deviate with it: one that only its partner's distance is measured from does not."""
    if feature.size is None or feature.size.moves == "both":
        return [True] * len(feature.faces)
    return [feature.size.moves == "first", feature.size.moves == "second"]


def _check_size(feature: Feature, geometry: FeatureGeometry) -> None:
    size = feature.size
    if size is None or not np.isfinite(geometry.size):
        raise GeometryFault(f"a size is for cylinders, spheres and two opposed planes, and it is {geometry.said}")
    if abs(geometry.size - size.nominal) > SIZES * geometry.size:
        raise GeometryFault(
            f"its size is {geometry.size:.9g} mm as shaped, and {size.nominal:g} mm in its tolerance; state the size of the "
            "shape, with the limits about it"
        )


def _layers(
    feature: Feature, geometry: FeatureGeometry, datums: Mapping[str | None, NominalFeature], columns: int
) -> tuple[Layer, ...]:
    """What each tolerance controls, from the one that controls least on."""
    found = []
    for tolerance in feature.geometric:
        system = [
            [Datum(datums[letter].geometry, _padded(datums[letter].coordinates, columns)) for letter in place]
            for place in tolerance.system
        ]
        rows = zone_rows(tolerance, geometry, system[0][0].geometry if system else None)
        frame = datum_frame(system, geometry.centre, geometry.reach, columns)
        controlled = _controlled(rows, geometry, frame) if system else np.zeros((len(geometry.names), 0))
        if len(rows) and system and not controlled.shape[1]:
            raise GeometryFault(
                f"{tolerance.kind}: the datum system {tolerance.datums} does not lock any of what is toleranced; "
                "add the datum that does"
            )
        found.append((tolerance, rows, controlled, frame))
    found.sort(key=lambda each: (each[2].shape[1], each[0].width))
    layers: list[Layer] = []
    before = np.zeros((len(geometry.names), 0))
    for tolerance, rows, controlled, frame in found:
        for inner in layers:
            contains = inner.controlled.shape[1] and _rest(inner.controlled, controlled).shape[1] == 0
            if contains and tolerance.width < inner.tolerance.width and not (tolerance.material or inner.tolerance.material):
                raise GeometryFault(
                    f"{tolerance.kind} {tolerance.width:g} is narrower than {inner.tolerance.kind} {inner.tolerance.width:g}, "
                    "which it contains; expected orientation within location"
                )
        added = _named(_rest(controlled, before), geometry)
        if tolerance.rule in TRANSLATIONS:
            added = _translating(tolerance, geometry, added)
        if controlled.shape[1] and not added.shape[1]:
            raise GeometryFault(
                f"{tolerance.kind} {tolerance.width:g} controls nothing that others do not; leave one of them out"
            )
        before = np.hstack([before, added])
        layers.append(Layer(tolerance, rows, controlled, added, frame))
    return tuple(layers)


def _translating(tolerance: GeometricTolerance, geometry: FeatureGeometry, added: np.ndarray) -> np.ndarray:
    """Those of the added directions (coordinate, n) that do not turn the feature."""
    turned = geometry.twists[3:] @ added * geometry.reach
    _, S, Vt = np.linalg.svd(turned)
    kept = added @ Vt[int((S > SAME).sum()) :].T
    if not kept.shape[1]:
        raise GeometryFault(f'{tolerance.kind}: the rule "{tolerance.rule}" leaves nothing, as its datums lock tilts alone')
    return _named(kept, geometry)


def _controlled(rows: np.ndarray, geometry: FeatureGeometry, frame: DatumFrame) -> np.ndarray:
    """Directions (coordinate, n) that the zone limits, and that no motion which the datums leave open changes."""
    limited = _span(rows.reshape(-1, rows.shape[-1]).T)
    return _rest(limited, _span(limited @ limited.T @ geometry.values @ frame.free))


def _span(vectors: np.ndarray) -> np.ndarray:
    """An orthonormal basis (row, n) of columns (row, m)."""
    if not vectors.size:
        return np.zeros((len(vectors), 0))
    U, S, _ = np.linalg.svd(vectors, full_matrices=False)
    return np.asarray(U[:, SAME * max(1.0, S.max(initial=0.0)) < S])


def _rest(vectors: np.ndarray, other: np.ndarray) -> np.ndarray:
    """What of the span of orthonormal columns is across the span of others."""
    return _span(vectors - other @ (other.T @ vectors))


def _named(directions: np.ndarray, geometry: FeatureGeometry) -> np.ndarray:
    """Directions along coordinates, if they span those."""
    projector = directions @ directions.T
    whole = np.flatnonzero(np.diag(projector) > 1 - 1e-6)
    return np.eye(len(geometry.names))[:, whole] if len(whole) == directions.shape[1] else directions


def _names(geometry: FeatureGeometry, added: np.ndarray) -> list[str]:
    """What the directions are called: as the coordinates that they are along."""
    largest = np.abs(added).argmax(axis=0)
    along = np.abs(added).max(axis=0, initial=0) > 1 - 1e-6
    return [
        geometry.names[k] if is_one else f"mixed {number + 1}"
        for number, (k, is_one) in enumerate(zip(largest, along, strict=True))
    ]


def _padded(coordinates: np.ndarray, columns: int) -> np.ndarray:
    found = np.zeros((len(coordinates), columns))
    found[:, : coordinates.shape[1]] = coordinates
    return found


def in_order(part: Part) -> tuple[list[Feature], list[Feature]]:
    """The features of a part, each after the datums that its tolerances refer to; and those that refer to each other."""
    left, done, ordered = list(part.features), set[str](), list[Feature]()
    while left:
        ready = [each for each in left if _letters(each) <= done]
        if not ready:
            return ordered, left
        ordered += ready
        done |= {each.datum for each in ready if each.datum}
        left = [each for each in left if each not in ready]
    return ordered, []


def _letters(feature: Feature) -> set[str]:
    return {letter for each in feature.geometric for place in each.system for letter in place}
