"""Features with numbers: their contributors, and how their faces deviate with everything that varies."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tolcontact.declaration import DatumTargets, Face, Feature, GeometricTolerance, Pattern
from tolcontact.errors import GeometryFault
from tolcontact.features.datum_planes import Lean, TangentPlane
from tolcontact.features.face_deviation import FaceDeviation
from tolcontact.features.feature_geometry import FeatureGeometry, FeatureOfSize, TargetPoint
from tolcontact.features.feature_recognition import feature_geometry
from tolcontact.features.form_field import FormField
from tolcontact.features.forms import form_fields
from tolcontact.features.pattern_geometry import MIXED, RELATIVE, SIZE_TOLERANCE, PatternGeometry, check_alike
from tolcontact.features.tolerance_layers import Datum, Layer, padded, tolerance_layers
from tolcontact.geometry.faces import FaceArea, Meshes, face_area, patch
from tolcontact.geometry.surface import Surface

Placement = tuple[np.ndarray, np.ndarray]  # R (3, 3) and t (3,) [mm] of a part in the nominal assembly
MIN_SHARE = 1e-6  # of a face's area: a smaller common part of two faces does not count
FACE_TOLERANCE = 1e-4  # of a face's size: the largest distance of a point on it


@dataclass(frozen=True, eq=False)
class NominalFeature:
    """A feature in its part, by itself or as a member of a pattern.

    coordinates  (coordinate, column): of the feature, for deviations of 1 of the columns of its pattern and all columns before
    size_column  the column of its size; None if its size is not toleranced
    form         of its face; None if the feature keeps its shape
    form_columns the columns of the coefficients of the form
    surfaces     its faces, in the part's own frame
    areas        its faces on the part's mesh
    """

    feature: Feature
    part: int
    geometry: FeatureGeometry
    coordinates: np.ndarray
    size_column: int | None
    surfaces: tuple[Surface, ...]
    areas: tuple[FaceArea, ...]
    form: FormField | None = None
    form_columns: range = range(0)

    @property
    def label(self) -> str:
        return f"{self.feature.part.name}.{self.feature.name}"

    @property
    def varies(self) -> bool:
        """Whether the feature deviates at all."""
        return self.size_column is not None or self.form is not None or bool(self.coordinates.any())

    def face_with(self, position: np.ndarray) -> int | None:
        """Return the number of the face that a point (3,) [mm] is on; None, for the middle, if it is on neither of two."""
        if len(self.surfaces) == 1:
            return 0
        tolerance = FACE_TOLERANCE * max(surface.mesh.scale for surface in self.surfaces)
        distances = [float(np.linalg.norm(surface.nearest(position[None])[1][0] - position)) for surface in self.surfaces]
        nearest = int(np.argmin(distances))
        return nearest if distances[nearest] <= tolerance else None

    def target(self, position: np.ndarray) -> Datum:
        """Return the datum that touches the feature at a point (3,) [mm]. Raises GeometryFault for a point beside it."""
        number = self.face_with(position)
        surface = self.surfaces[number or 0]
        triangle, foot = surface.nearest(position[None])
        if number is None or np.linalg.norm(foot[0] - position) > FACE_TOLERANCE * surface.mesh.scale:
            raise GeometryFault(f'its target at {_in_words(position)} is not on feature "{self.feature.name}"; move it there')
        normal = surface.normals(triangle, foot)[0]
        deviation = self.deviation(number, (np.eye(3), np.zeros(3)))
        coordinates = np.zeros((1, self.coordinates.shape[1]))
        coordinates[:, deviation.columns] = deviation.outward(position[None], normal[None])
        return Datum(self.feature, TargetPoint.at(position, normal), coordinates)

    def deviation(self, number: int | None, placement: Placement) -> FaceDeviation:
        """Return how a face deviates in a part at `placement`; with `number` None the middle, which no size moves."""
        geometry, size_column = self.geometry, self.size_column
        twist, height = geometry.twists @ self.coordinates, np.zeros(self.coordinates.shape[1])
        if size_column is not None and number is not None and isinstance(geometry, FeatureOfSize):
            motion, height[size_column] = geometry.growth(number, _moving_faces(self.feature))
            twist[:3, size_column] += motion
        columns, form = np.flatnonzero(twist.any(axis=0) | (height != 0)), self.form if number is not None else None
        modes = np.arange(len(columns), len(columns) + (len(self.form_columns) if form else 0))
        columns = np.concatenate([columns, np.array(self.form_columns if form else (), dtype=int)])
        R, t = placement
        turned = np.vstack([R @ twist[:3, columns], R @ twist[3:, columns]])
        placed = None if form is None else form.placed(R, t)
        return FaceDeviation(self.label, columns, R @ geometry.centre + t, turned, height[columns], placed, modes)


@dataclass(frozen=True, eq=False)
class NominalPattern:
    """The features that a declaration tolerances together: the members of a pattern, or one feature by itself.

    Its contributors are the directions that its layers add, shifts of datums that lean, and the sizes of its members.

    geometry      of all members together
    first_column  of its contributors
    labels        "part.feature.freedom" of its contributors; "part.pattern.freedom" for what moves several members
    leans         by their columns: planes that lean against other datums of its tolerances
    form          the tolerance by which the form of its members is drawn; None if they keep their shape
    """

    declared: Feature | Pattern
    members: tuple[NominalFeature, ...]
    geometry: PatternGeometry
    layers: tuple[Layer, ...]
    first_column: int
    labels: tuple[str, ...]
    leans: Mapping[int, Lean]
    form: GeometricTolerance | None = None

    @property
    def part(self) -> int:
        return self.members[0].part

    @property
    def label(self) -> str:
        return f"{self.declared.part.name}.{self.declared.name}"

    @property
    def datums(self) -> tuple[Datum, ...]:
        """The members as datums, all of which are one common datum."""
        return tuple(
            Datum(member.feature, member.geometry, member.coordinates, member.form, member.form_columns)
            for member in self.members
        )

    @property
    def shift_columns(self) -> list[int]:
        """The columns of the shifts of datums."""
        return [first + k for first, lean in self.leans.items() for k in range(len(lean.coordinates))]


@dataclass(eq=False)
class Features:
    """The features of a model while it is discretized, and the faces that deviate with them.

    first_column  of the contributors of features
    """

    first_column: int
    patterns: list[NominalPattern] = field(default_factory=list)
    features: list[NominalFeature] = field(default_factory=list)
    _targets: dict[tuple[int, str], tuple[Datum, ...]] = field(default_factory=dict)
    _used_faces: dict[tuple[Feature, int | None], FaceDeviation] = field(default_factory=dict)

    @property
    def faces(self) -> tuple[FaceDeviation, ...]:
        """The faces of features that belong to pairs and locators."""
        return tuple(self._used_faces.values())

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(label for pattern in self.patterns for label in pattern.labels)

    def copy(self) -> "Features":
        """Return the same features, to which others can be added without changing these."""
        return replace(self, patterns=list(self.patterns), features=list(self.features), _targets=dict(self._targets))

    def add(self, declared: Feature | Pattern, part: int, meshes: Meshes) -> None:
        """Add a feature or a pattern whose datums have been added before. Raises GeometryFault."""
        present = {nominal.feature: nominal for nominal in self.features}
        new = [member for member in declared.members if member not in present]
        if isinstance(declared, Pattern) and (lost := [member.name for member in declared.borrowed if member in new]):
            raise GeometryFault(f'its member "{lost[0]}" could not be made; mend that feature first')
        surfaces = {member: tuple(patch(face, meshes) for face in member.faces) for member in new}
        areas = {member: tuple(face_area(face, meshes) for face in member.faces) for member in new}
        for number, member in enumerate(new):
            self._check_disjoint(member, areas, new[:number], meshes)
        geometries = {member: feature_geometry(surfaces[member]) for member in new}
        shapes = [geometries[member] if member in geometries else present[member].geometry for member in declared.members]
        if declared.tolerances:
            check_alike(shapes)
        geometry = PatternGeometry(tuple(shapes))
        start = self.first_column + len(self.labels)
        layers = tolerance_layers(declared, geometry, self.datums(part), start)
        names = _freedom_names(declared, geometry, layers)
        leans, coordinates = _coordinates(geometry, layers, start)
        names += [f"{declared.name}.{lean.name(k, system)}" for lean, system in leans.values() for k in lean.coordinates]
        sizes = dict[Feature, int]()
        if declared.size is not None:
            for member in new:
                _check_size(member, geometries[member])
                sizes[member] = start + len(names)
                names.append(f"{member.name}.size")
        form, fields = form_fields(declared, {member: (geometries[member], surfaces[member]) for member in new})
        forms = dict[Feature, range]()
        for member, shape in fields.items():
            forms[member] = range(start + len(names), start + len(names) + shape.modes)
            names += [f"{member.name}.form {k:02d}" for k in range(1, shape.modes + 1)]
        coordinates = padded(coordinates, start + len(names))
        members = [
            present.get(member)
            or NominalFeature(
                member, part, shapes[k], coordinates[geometry.slices[k]],
                sizes.get(member), surfaces[member], areas[member], fields.get(member), forms.get(member, range(0)),
            )
            for k, member in enumerate(declared.members)
        ]  # fmt: skip
        self.features += [member for member in members if member.feature in geometries]
        labels = tuple(f"{declared.part.name}.{name}" for name in names)
        shifts = {column: lean for column, (lean, _) in leans.items()}
        self.patterns.append(NominalPattern(declared, tuple(members), geometry, layers, start, labels, shifts, form))

    def add_targets(self, targets: DatumTargets, part: int) -> None:
        """Add a datum whose features have been added before. Raises GeometryFault for a target that is not on its feature."""
        present = {nominal.feature: nominal for nominal in self.features}
        if lost := [feature.name for feature in targets.features if feature not in present]:
            raise GeometryFault(f'its feature "{lost[0]}" could not be made; mend that feature first')
        self._targets[part, targets.letter] = tuple(
            present[point.on].target(np.array(point.position)) for point in targets.points if point.on is not None
        )

    def datums(self, part: int) -> dict[str | None, tuple[Datum, ...]]:
        """Return the datums of a part that have been added, by letters: several features or targets for a common datum."""
        patterns = {pattern.declared.datum: pattern.datums for pattern in self.patterns if pattern.part == part}
        return patterns | {letter: datums for (owner, letter), datums in self._targets.items() if owner == part}

    def _check_disjoint(
        self, feature: Feature, areas: Mapping[Feature, Sequence[FaceArea]], members: Sequence[Feature], meshes: Meshes
    ) -> None:
        """Raise GeometryFault if a face that deviates with a feature also deviates with one before, or of its pattern."""
        mesh = meshes[feature.part]
        present = [(nominal.feature, nominal.areas) for nominal in self.features if nominal.feature.part is feature.part]
        for earlier, earlier_areas in [*present, *((member, areas[member]) for member in members)]:
            for face, moves in zip(areas[feature], _moving_faces(feature), strict=True):
                for earlier_face, earlier_moves in zip(earlier_areas, _moving_faces(earlier), strict=True):
                    if moves and earlier_moves and face.share(earlier_face, mesh) > MIN_SHARE:
                        raise GeometryFault(
                            f'it shares a face with feature "{earlier.name}", so that would deviate twice; give all '
                            "tolerances of a face to one feature"
                        )

    def face_at(self, face: Face, meshes: Meshes, placement: Placement) -> FaceDeviation | None:
        """Return how a face deviates; None if no part of it belongs to a feature.

        Raises GeometryFault if a part of it belongs to a feature, and the rest does not.
        """
        candidates = [feature for feature in self.features if feature.feature.part is face.part and feature.varies]
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

    def middle_of(self, feature: Feature, placement: Placement) -> FaceDeviation | None:
        """Return how the middle of a feature deviates, which no size moves; None if the feature could not be added."""
        nominal = next((nominal for nominal in self.features if nominal.feature is feature), None)
        return None if nominal is None else self._used(nominal, None, placement)

    def use_touched(self, placements: Sequence[Placement]) -> None:
        """Use the faces with form that datums touch, so that archives hold them."""
        touched = [lean.form for pattern in self.patterns for lean in pattern.leans.values() if isinstance(lean, TangentPlane)]
        for nominal in (nominal for nominal in self.features if nominal.form in touched):
            self._used(nominal, 0, placements[nominal.part])

    def _used(self, nominal: NominalFeature, number: int | None, placement: Placement) -> FaceDeviation:
        """Return the deviation of a face: the same object for all that uses it."""
        key = (nominal.feature, number)
        if key not in self._used_faces:
            self._used_faces[key] = nominal.deviation(number, placement)
        return self._used_faces[key]

    def nominal(self, feature: Feature) -> NominalFeature:
        """Return a declared feature with its numbers."""
        return next(nominal for nominal in self.features if nominal.feature is feature)


def _in_words(position: np.ndarray) -> str:
    return f"({', '.join(f'{coordinate:g}' for coordinate in position)})"


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
    if size.is_for_holes not in (None, geometry.is_inner):
        own, other = (
            ("a hole", size.tolerance_class.upper()) if geometry.is_inner else ("no hole", size.tolerance_class.lower())
        )
        raise GeometryFault(f'its tolerance class is {size.tolerance_class}, and it is {own}; write "{other}"')


def _freedom_names(declared: Feature | Pattern, geometry: PatternGeometry, layers: Sequence[Layer]) -> list[str]:
    """Return the names "feature.freedom" of the directions that layers add, of the feature or pattern that they move."""
    names, counts = list[str](), Counter[str]()
    for direction in (direction for layer in layers for direction in layer.added.T):
        number = geometry.owner(direction)
        owner = declared.name if number is None else declared.members[number].name
        name = f"{owner}.{geometry.freedom_name(direction)}"
        counts[name] += 1
        names.append(f"{name} {counts[name]}" if name.endswith((MIXED, RELATIVE)) else name)
    return names


def _coordinates(
    geometry: PatternGeometry, layers: Sequence[Layer], start: int
) -> tuple[dict[int, tuple[Lean, str]], np.ndarray]:
    """Return leans with the names of their datum systems by columns, and coordinates (coordinate, column).

    The columns from `start` on are the directions that layers add, then the leans.
    """
    shift = start + sum(layer.added.shape[1] for layer in layers)
    columns = sum(len(lean.coordinates) for layer in layers for lean in layer.frame.leans)
    coordinates = np.zeros((geometry.count, shift + columns))
    column, leans = start, dict[int, tuple[Lean, str]]()
    for layer in layers:
        followed = layer.followed(geometry)
        count, first = layer.added.shape[1], shift
        for lean in layer.frame.leans:
            leans[shift] = lean.at_column(start, first), layer.tolerance.datums
            shift += len(lean.coordinates)
        coordinates[:, column : column + count] = layer.added
        coordinates[:, :start] += followed[:, :start]
        coordinates[:, first:shift] = followed[:, start:]
        column += count
    return leans, coordinates
