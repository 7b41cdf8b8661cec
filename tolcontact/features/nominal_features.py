"""Features with numbers: their contributors, and how their faces deviate with everything that varies."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from tolcontact.declaration import Face, Feature, Part
from tolcontact.errors import GeometryFault
from tolcontact.features.feature_geometry import FeatureGeometry, FeatureOfSize
from tolcontact.features.feature_recognition import feature_geometry
from tolcontact.features.tolerance_layers import Datum, Layer, Lean, freedom_names, padded, tolerance_layers
from tolcontact.geometry.faces import FaceArea, Meshes, face_area, patch
from tolcontact.geometry.surface import Surface

Placement = tuple[np.ndarray, np.ndarray]  # R (3, 3) and t (3,) [mm] of a part in the nominal assembly
MIN_SHARE = 1e-6  # of a face's area: a smaller common part of two faces does not count
FACE_TOLERANCE = 1e-4  # of a face's size: the largest distance of a point on it
SIZE_TOLERANCE = 1e-6  # relative: largest difference between the size of a shape and the size in its tolerance


@dataclass(frozen=True, eq=False)
class FaceDeviation:
    """The deviation of a face: a small rigid displacement and a height, both linear in what varies. Nominal assembly frame.

    name      "part.feature"
    columns   (k,) of the deviations that displace the face
    centre    (3,) [mm]: a point p of the face goes to p + tau + rho x (p - centre)
    twist     (6, k): tau [mm] and rho [rad] for deviations of 1
    height    (k,) [mm]: how much the face then grows out of the material, everywhere
    """

    name: str
    columns: np.ndarray
    centre: np.ndarray
    twist: np.ndarray
    height: np.ndarray

    @property
    def grows(self) -> bool:
        """Whether the height varies."""
        return bool(self.height.any())

    def heights(self, deviations: np.ndarray) -> np.ndarray:
        """Return the heights (row,) [mm] for deviations (row, column), summed up in a fixed order."""
        heights = np.zeros(len(deviations))
        for column, factor in zip(self.columns, self.height, strict=True):
            heights += factor * deviations[:, column]
        return heights

    def outward(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return how far `points` (point, 3) of the face move along `normals` (point, 3) for deviations of 1: (point, k)."""
        turned = np.cross(points - self.centre, normals)
        return np.hstack([normals, turned]) @ self.twist + self.height


@dataclass(frozen=True, eq=False)
class NominalFeature:
    """A feature in its part. Its contributors are the directions that its layers add, shifts of datums that lean, its size.

    first_column of its contributors
    labels       "part.feature.freedom" of its contributors
    coordinates  (coordinate, column): of the feature, for deviations of 1 of its own columns and all columns before
    leans        by their columns: planes that lean against other datums of its tolerances
    surfaces     its faces, in the part's own frame
    areas        its faces on the part's mesh
    """

    feature: Feature
    part: int
    geometry: FeatureGeometry
    layers: tuple[Layer, ...]
    first_column: int
    labels: tuple[str, ...]
    coordinates: np.ndarray
    leans: Mapping[int, Lean]
    surfaces: tuple[Surface, ...]
    areas: tuple[FaceArea, ...]

    @property
    def label(self) -> str:
        return f"{self.feature.part.name}.{self.feature.name}"

    @property
    def size_column(self) -> int | None:
        """The column of its size; None if its size is not toleranced."""
        return self.first_column + len(self.labels) - 1 if self.feature.size else None

    def face_with(self, position: np.ndarray) -> int | None:
        """Return the number of the face that a point (3,) [mm] is on; None, for the middle, if it is on neither of two."""
        if len(self.surfaces) == 1:
            return 0
        tolerance = FACE_TOLERANCE * max(surface.mesh.scale for surface in self.surfaces)
        distances = [float(np.linalg.norm(surface.nearest(position[None])[1][0] - position)) for surface in self.surfaces]
        nearest = int(np.argmin(distances))
        return nearest if distances[nearest] <= tolerance else None

    def deviation(self, number: int | None, placement: Placement) -> FaceDeviation:
        """Return how a face deviates in a part at `placement`; with `number` None the middle, which no size moves."""
        geometry, size_column = self.geometry, self.size_column
        twist, height = geometry.twists @ self.coordinates, np.zeros(self.coordinates.shape[1])
        if size_column is not None and number is not None and isinstance(geometry, FeatureOfSize):
            motion, height[size_column] = geometry.growth(number, _moving_faces(self.feature))
            twist[:3, size_column] += motion
        columns = np.flatnonzero(twist.any(axis=0) | (height != 0))
        R, t = placement
        turned = np.vstack([R @ twist[:3, columns], R @ twist[3:, columns]])
        return FaceDeviation(self.label, columns, R @ geometry.centre + t, turned, height[columns])


@dataclass(eq=False)
class Features:
    """The features of a model while it is discretized, and the faces that deviate with them.

    first_column  of the contributors of features
    """

    first_column: int
    features: list[NominalFeature] = field(default_factory=list)
    _used_faces: dict[tuple[Feature, int | None], FaceDeviation] = field(default_factory=dict)

    @property
    def faces(self) -> tuple[FaceDeviation, ...]:
        """The faces of features that belong to pairs and locators."""
        return tuple(self._used_faces.values())

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(label for feature in self.features for label in feature.labels)

    def add(self, feature: Feature, part: int, meshes: Meshes) -> None:
        """Add a feature whose datums have been added before. Raises GeometryFault."""
        surfaces = tuple(patch(face, meshes) for face in feature.faces)
        areas = tuple(face_area(face, meshes) for face in feature.faces)
        self._check_disjoint(feature, areas, meshes)
        geometry = feature_geometry(surfaces)
        start = self.first_column + len(self.labels)
        datums = {
            datum.feature.datum: Datum(datum.feature, datum.geometry, padded(datum.coordinates, start))
            for datum in self.features
            if datum.part == part
        }
        layers = tolerance_layers(feature, geometry, datums, start)
        names = [name for layer in layers for name in freedom_names(geometry, layer.added)]
        column, leans = start, dict[int, Lean]()
        for layer in layers:
            first = start + len(names)
            leans |= {first + k: lean.at_column(start, first) for k, lean in enumerate(layer.frame.leans)}
            names += [f"datum {lean.datum} of {layer.tolerance.datums}" for lean in layer.frame.leans]
        shift = min(leans, default=0)
        if feature.size is not None:
            _check_size(feature, geometry)
            names.append("size")
        coordinates = np.zeros((len(geometry.names), start + len(names)))
        for layer in layers:
            followed = layer.followed(geometry)
            count, shifts = layer.added.shape[1], len(layer.frame.leans)
            coordinates[:, column : column + count] = layer.added
            coordinates[:, :start] += followed[:, :start]
            coordinates[:, shift : shift + shifts] = followed[:, start:]
            column, shift = column + count, shift + shifts
        labels = tuple(f"{feature.part.name}.{feature.name}.{name}" for name in names)
        self.features.append(
            NominalFeature(feature, part, geometry, layers, start, labels, coordinates, leans, surfaces, areas)
        )

    def _check_disjoint(self, feature: Feature, areas: Sequence[FaceArea], meshes: Meshes) -> None:
        """Raise GeometryFault if a face that deviates with the feature also deviates with a feature added before."""
        mesh = meshes[feature.part]
        for earlier in (earlier for earlier in self.features if earlier.feature.part is feature.part):
            for face, moves in zip(areas, _moving_faces(feature), strict=True):
                for earlier_face, earlier_moves in zip(earlier.areas, _moving_faces(earlier.feature), strict=True):
                    if moves and earlier_moves and face.share(earlier_face, mesh) > MIN_SHARE:
                        raise GeometryFault(
                            f'it shares a face with feature "{earlier.feature.name}", so that would deviate twice; give all '
                            "tolerances of a face to one feature"
                        )

    def face_at(self, face: Face, meshes: Meshes, placement: Placement) -> FaceDeviation | None:
        """Return how a face deviates; None if no part of it belongs to a feature.

        Raises GeometryFault if a part of it belongs to a feature, and the rest does not.
        """
        candidates = [feature for feature in self.features if feature.feature.part is face.part and feature.labels]
        area = face_area(face, meshes) if candidates else None
        for feature in candidates:
            for number, feature_area in enumerate(feature.areas):
                common = area.share(feature_area, meshes[face.part]) if area else 0.0
                if common > 1 - MIN_SHARE and _moving_faces(feature.feature)[number]:
                    return self._used(feature, number, placement)
                if MIN_SHARE < common <= 1 - MIN_SHARE:
                    raise GeometryFault(
                        f'its face on part "{face.part.name}" is partly that of feature "{feature.feature.name}", which '
                        "deviates by itself; declare one pair (or scheme) for the feature, and another one for the rest"
                    )
        return None

    def face_of(self, feature: Feature, position: np.ndarray, placement: Placement) -> FaceDeviation | None:
        """Return how a feature deviates at a locator's point (3,) [mm] of its part; None if it could not be added."""
        nominal = next((nominal for nominal in self.features if nominal.feature is feature), None)
        return None if nominal is None else self._used(nominal, nominal.face_with(position), placement)

    def _used(self, nominal: NominalFeature, number: int | None, placement: Placement) -> FaceDeviation:
        """Return the deviation of a face: the same object for all that uses it."""
        key = (nominal.feature, number)
        if key not in self._used_faces:
            self._used_faces[key] = nominal.deviation(number, placement)
        return self._used_faces[key]

    def nominal(self, feature: Feature) -> NominalFeature:
        """Return a declared feature with its numbers."""
        return next(nominal for nominal in self.features if nominal.feature is feature)


def _moving_faces(feature: Feature) -> list[bool]:
    """Return which faces of a feature deviate with it: a face from which a size is only measured does not."""
    if feature.size is None or feature.size.moves == "both":
        return [True] * len(feature.faces)
    return [feature.size.moves == "first", feature.size.moves == "second"]


def _check_size(feature: Feature, geometry: FeatureGeometry) -> None:
    size = feature.size
    if size is None or not isinstance(geometry, FeatureOfSize):
        raise GeometryFault(f"a size is for cylinders, spheres and two opposed planes, and it is {geometry.in_words}")
    if abs(geometry.size - size.nominal) > SIZE_TOLERANCE * geometry.size:
        raise GeometryFault(
            f"its size is {geometry.size:.9g} mm as shaped, and {size.nominal:g} mm in its tolerance; state the size of the "
            "shape, with the limits about it"
        )


def datum_order(part: Part) -> tuple[list[Feature], list[Feature]]:
    """Return the features of a part, each after its datums, and the features whose datums refer to each other in a circle."""
    remaining, letters, ordered = list(part.features), set[str](), list[Feature]()
    while remaining:
        ready = [feature for feature in remaining if _letters(feature) <= letters]
        if not ready:
            return ordered, remaining
        ordered += ready
        letters |= {feature.datum for feature in ready if feature.datum}
        remaining = [feature for feature in remaining if feature not in ready]
    return ordered, []


def _letters(feature: Feature) -> set[str]:
    return {letter for tolerance in feature.geometric for compartment in tolerance.system for letter in compartment}
