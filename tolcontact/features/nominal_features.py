"""The features of a model with numbers: their freedoms, made once, and how faces deviate with everything that varies."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from tolcontact.declaration import DatumTargets, Face, Feature, GeometricTolerance, Part, Pattern, Point, Variable
from tolcontact.errors import GeometryFault
from tolcontact.features.datum_frames import Datums, DatumShift, Declared, datum_frame
from tolcontact.features.feature_geometry import ConeFeature, FeatureGeometry, FeatureOfSize, GeneralFeature
from tolcontact.features.feature_recognition import feature_geometry
from tolcontact.features.freedoms import DATUM, FEATURE, FORM, Freedom
from tolcontact.features.nominal_feature import Expansion, FaceDeviation, NominalFeature, Placement, moving_faces, padded
from tolcontact.features.nominal_pattern import MIXED, RELATIVE, NominalPattern, mobile, tolerance_layers, unlike_members
from tolcontact.features.tolerance_kinds import form_field_of, form_tolerance
from tolcontact.geometry.faces import FaceArea, Meshes, face_area, patch
from tolcontact.geometry.tolerances import SAME_SIZE

MIN_SHARE = 1e-6  # of a face's area: a smaller common part of two faces does not count


@dataclass(eq=False)
class Features:
    """The features of a model while it is discretized, and the faces that deviate with them.

    first_column  of the freedoms of features
    mated         faces of contact pairs: contact decides where such a datum at its material boundary lies
    causes        variables, whose columns follow the columns of features
    """

    first_column: int
    mated: frozenset[Face] = frozenset()
    causes: Sequence[Variable] = ()
    patterns: list[NominalPattern] = field(default_factory=list)
    features: dict[Feature, NominalFeature] = field(default_factory=dict)
    _gauges: dict[str, NominalFeature] = field(default_factory=dict)
    _targets: dict[tuple[int, str], tuple[NominalFeature, ...]] = field(default_factory=dict)
    _used_faces: dict[tuple[Any, ...], FaceDeviation] = field(default_factory=dict)

    @cached_property
    def _coefficients(self) -> dict[str, dict[int, float]]:
        """The coefficients of the causes that expand each part, by its name and their indices."""
        coefficients = defaultdict[str, dict[int, float]](dict)
        for index, cause in enumerate(self.causes):
            for part, coefficient in cause.expands.items():
                coefficients[part][index] = coefficient
        return dict(coefficients)

    @property
    def faces(self) -> tuple[FaceDeviation, ...]:
        """The faces of features, and of parts that expand, that belong to pairs and locators."""
        return tuple(self._used_faces.values())

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        return tuple(freedom for pattern in self.patterns for freedom in pattern.freedoms)

    @property
    def _next_column(self) -> int:
        return self.first_column + len(self.freedoms)

    def copy(self) -> "Features":
        """Return a copy, so that further features do not change these."""
        copies = {name: getattr(self, name).copy() for name in ("patterns", "features", "_gauges", "_targets")}
        return replace(self, **copies)

    def add(self, declared: Declared, part: int, meshes: Meshes) -> None:
        """Add a feature, a pattern or datum targets, whose datums and features have been added before. Raises GeometryFault."""
        if not isinstance(declared, Feature):
            noun, made_of = ("member", declared.borrowed) if isinstance(declared, Pattern) else ("feature", declared.features)
            if lost := [feature.name for feature in made_of if feature not in self.features]:
                raise GeometryFault(f'its {noun} "{lost[0]}" could not be made; mend that feature first')
        if isinstance(declared, DatumTargets):
            self._targets[part, declared.letter] = tuple(
                self.features[point.on].target(np.array(point.position)) for point in declared.points if point.on is not None
            )
            return
        recognized = dict[Feature, NominalFeature]()
        for member in declared.members:
            if member not in self.features:
                recognized[member] = self._recognized(member, part, meshes, recognized.values())
        pattern = NominalPattern(declared, tuple((recognized.get(m) or self.features[m]) for m in declared.members))
        if declared.tolerances and (fault := unlike_members(pattern.geometries)):
            raise GeometryFault(fault)
        systems = [self._system(declared, tolerance, part) for tolerance in declared.geometric]
        # The order of the freedoms is the order of their columns: displacements, datum shifts, sizes, modes of forms.
        start = self._next_column
        pattern = replace(pattern, layers=tolerance_layers(pattern, systems, start))
        freedoms = _displacements(pattern)
        shifts, coordinates = _follow_datums(pattern, start, freedoms)
        if declared.size is not None:
            for member, nominal in recognized.items():
                _check_size(member, nominal.geometry)
                recognized[member] = replace(nominal, size_column=start + len(freedoms))
                freedoms.append(Freedom(f"{nominal.label}.size", FEATURE, declared.size.tolerance))
        form = None
        for member, nominal in recognized.items():
            if form := form_tolerance(declared, nominal.geometry):
                shape = form_field_of(form, nominal.geometry, nominal.surfaces[0])
                first = start + len(freedoms)
                recognized[member] = replace(nominal, form=shape, form_columns=range(first, first + shape.modes))
                labels = [f"{nominal.label}.form {k:02d}" for k in range(1, shape.modes + 1)]
                freedoms += [Freedom(label, FORM, geometric=form) for label in labels]
        coordinates = padded(coordinates, start + len(freedoms))
        for place, member in zip(pattern.slices, declared.members, strict=True):
            if member in recognized:
                self.features[member] = replace(recognized[member], coordinates=coordinates[place])
        members = tuple(self.features[member] for member in declared.members)
        self.patterns.append(replace(pattern, members=members, freedoms=tuple(freedoms), shifts=tuple(shifts), form=form))

    def _system(self, declared: Feature | Pattern, tolerance: GeometricTolerance, part: int) -> list[Datums]:
        """Return the datums of a tolerance, compartment by compartment; those with play as their gauge elements have them.

        Raises GeometryFault for a datum that could not be made.
        """
        known, system = self.datums(part), list[Datums]()
        for letters, modifier in zip(tolerance.system, tolerance.modifiers, strict=True):
            if absent := [letter for letter in letters if letter not in known]:
                raise GeometryFault(
                    f"{tolerance.kind} refers to datum {absent[0]}, which could not be made; mend its feature first"
                )
            compartment = [datum for letter in letters for datum in known[letter]]
            patterns = [other for other in self._of(part) if other.declared.datum in letters]
            has_mate = any(not self.mated.isdisjoint(datum.feature.faces) for datum in compartment)  # contact decides its place
            if modifier and len(patterns) == 1 and declared.part.standard and not has_mate:
                compartment = [self._at_gauge(declared, tolerance, patterns[0], system)]
            system.append(compartment)
        return system

    def _at_gauge(
        self, declared: Feature | Pattern, tolerance: GeometricTolerance, datum: NominalPattern, before: Sequence[Datums]
    ) -> NominalFeature:
        """Return a datum as its gauge element has it, which other tolerances share in a simultaneous requirement.

        before   the datums before it in the system of the tolerance
        """
        is_shared = declared.part.standard == "ASME" if tolerance.simultaneous is None else tolerance.simultaneous
        owner = (datum.declared if is_shared else declared).label
        label = f"{owner}.mobility of datum {datum.declared.datum} of {tolerance.datums.replace(' ', '')}"
        if label not in self._gauges:
            start, k = self._next_column, len(before)
            frame = datum_frame(before, datum.centre, datum.reach, start, tolerance.orientation_only[:k])
            gauge = mobile(datum, frame.free, tolerance.modifiers[k], start, label)
            self.patterns += [gauge] if gauge.freedoms else []
            self._gauges[label] = gauge.members[0]
        return self._gauges[label]

    def datums(self, part: int) -> dict[str | None, tuple[NominalFeature, ...]]:
        """Return the datums of a part that have been added, by letters: several features or targets for a common datum."""
        patterns = {pattern.declared.datum: pattern.members for pattern in self._of(part)}
        return patterns | {letter: datums for (owner, letter), datums in self._targets.items() if owner == part}

    def _of(self, part: int) -> list[NominalPattern]:
        """Return the features and patterns of a part, without gauge elements."""
        return [pattern for pattern in self.patterns if pattern.part == part and not pattern.is_gauge]

    def _recognized(self, feature: Feature, part: int, meshes: Meshes, members: Iterable[NominalFeature]) -> NominalFeature:
        """Return a feature without freedoms; `members` are the features before in its pattern. Raises GeometryFault."""
        surfaces = tuple(patch(face, meshes) for face in feature.faces)
        areas = tuple(face_area(face, meshes) for face in feature.faces)
        for earlier in (*self.features.values(), *members):
            if earlier.feature.part is feature.part:
                _check_disjoint(feature, areas, earlier, meshes)
        geometry = feature_geometry(surfaces)
        return NominalFeature(feature, part, geometry, surfaces, areas, np.zeros((len(geometry.names), 0)))

    def expansion(self, part: Part) -> Expansion | None:
        """Return the expansion of a part by temperatures, once all features have been added; None if none expands it."""
        coefficients = self._coefficients.get(part.name)
        if coefficients is None:
            return None
        return Expansion(self._next_column + np.array([*coefficients]), np.array([*coefficients.values()], dtype=float))

    def deviation(self, face: Face, meshes: Meshes, placement: Placement) -> FaceDeviation | None:
        """Return how a face deviates with its feature, and expands with its part; None for neither. Raises GeometryFault.

        A plane, cylinder, cone or sphere that expands keeps its kind: it moves, and grows in height if it has a radius. Its rim
        follows its centre alone.
        """
        deviation, expansion = self.face_at(face, meshes, placement), self.expansion(face.part)
        if expansion is None:
            return deviation
        key = (face.part, *face.selections)
        if key not in self._used_faces:
            try:
                geometry = feature_geometry([patch(face, meshes)])
                if isinstance(geometry, GeneralFeature):
                    raise GeometryFault(
                        f"it is {geometry.in_words}, whose expansion is not known; choose planes and round faces"
                    )
            except GeometryFault as fault:
                raise GeometryFault(f'face {face} of part "{face.part.name}", which expands: {fault}') from fault
            fixed_point = geometry.apex if isinstance(geometry, ConeFeature) else geometry.centre
            height = geometry.growth(0, (True,))[1] * geometry.size if isinstance(geometry, FeatureOfSize) else 0.0
            self._used_faces[key] = expansion.added_to(deviation, str(face), fixed_point, placement, height)
        return self._used_faces[key]

    def position(self, point: Point) -> np.ndarray:
        """Return the position (3,) [mm] of a declared point in its part."""
        if point.end is not None and point.on is not None:
            return self.features[point.on].geometry.end(point.end)
        return np.array(point.position)

    def of_point(self, point: Point, placement: Placement) -> FaceDeviation | None:
        """Return how a declared point moves with the face of its feature, or the median of two, and expands; else None."""
        deviation, expansion = None, self.expansion(point.part)
        if point.on is not None:
            feature = self.features[point.on]
            number = None if point.position is None else feature.face_with(np.array(point.position))
            deviation = feature.deviation(number, placement)
        return expansion.added_to(deviation, str(point), self.position(point), placement) if expansion else deviation

    def at_point(
        self, deviation: FaceDeviation | None, part: Part, point: np.ndarray, placement: Placement
    ) -> FaceDeviation | None:
        """Return how a point (3,) [mm] of the nominal assembly expands with its part, in addition to its `deviation`."""
        expansion, (R, t) = self.expansion(part), placement
        if expansion is None:
            return deviation
        key = (part, deviation, *point)
        if key not in self._used_faces:
            position = (point - t) @ R
            name = "{} ({:g}, {:g}, {:g})".format(part.name, *position)
            self._used_faces[key] = expansion.added_to(deviation, name, position, placement)
        return self._used_faces[key]

    def face_at(self, face: Face, meshes: Meshes, placement: Placement) -> FaceDeviation | None:
        """Return how a face deviates; None if no part of it belongs to a feature.

        Raises GeometryFault if a part of it belongs to a feature, and the rest does not.
        """
        candidates = [nominal for nominal in self.features.values() if nominal.feature.part is face.part and nominal.varies]
        area = face_area(face, meshes) if candidates else None
        for nominal in candidates:
            for index, feature_area in enumerate(nominal.areas):
                common = area.share(feature_area, meshes[face.part]) if area else 0.0
                if common > 1 - MIN_SHARE and moving_faces(nominal.feature)[index]:
                    return self._used(nominal, index, placement)
                if MIN_SHARE < common <= 1 - MIN_SHARE:
                    raise GeometryFault(
                        f'its face on part "{face.part.name}" is partly that of feature "{nominal.feature.name}", which '
                        "deviates by itself; declare one pair (or scheme) for the feature, and another one for the rest"
                    )
        return None

    def face_of(self, feature: Feature, position: np.ndarray, placement: Placement) -> FaceDeviation | None:
        """Return how a feature deviates at a locator's point (3,) [mm] of its part; None if it could not be added."""
        nominal = self.features.get(feature)
        return None if nominal is None else self._used(nominal, nominal.face_with(position), placement)

    def grounds(
        self, feature: Feature, points: np.ndarray, directions: np.ndarray, placement: Placement
    ) -> tuple[FaceDeviation | None, ...]:
        """Return how a feature deviates under locators of another part that are on it; None if it could not be added.

        points, directions   (locator, 3) of the locators [mm], in the nominal assembly

        A locator follows the face of a size that it stands on, and else the centre of the feature, which no size moves.
        """
        nominal, (R, t) = self.features.get(feature), placement
        if nominal is None:
            return (None,) * len(points)
        faces = [nominal.face_under(*row) for row in zip((points - t) @ R, directions @ R, strict=True)]
        return tuple(self._used(nominal, index, placement) for index in faces)

    def use_touched(self, placements: Sequence[Placement]) -> None:
        """Use the faces with form that datums touch, so that archives hold them."""
        touched = [shift.form for pattern in self.patterns for shift in pattern.shifts if shift.form is not None]
        for nominal in self.features.values():
            if nominal.form in touched:
                self._used(nominal, 0, placements[nominal.part])

    def _used(self, nominal: NominalFeature, index: int | None, placement: Placement) -> FaceDeviation:
        """Return the deviation of a face: the same object for all that uses it."""
        key = (nominal.feature, index)
        if key not in self._used_faces:
            self._used_faces[key] = nominal.deviation(index, placement)
        return self._used_faces[key]


def _displacements(pattern: NominalPattern) -> list[Freedom]:
    """Return the freedoms of the directions that layers add, named after the feature or pattern that they move."""
    counts, freedoms = Counter[str](), list[Freedom]()
    for layer in pattern.layers:
        for direction in layer.added.T:
            member = pattern.owner(direction)
            owner = pattern.declared if member is None else pattern.members[member]
            label = f"{owner.label}.{pattern.freedom_name(direction)}"
            counts[label] += 1
            label = f"{label} {counts[label]}" if label.endswith((MIXED, RELATIVE)) else label
            freedoms.append(Freedom(label, FEATURE, geometric=layer.tolerance))
    return freedoms


def _follow_datums(pattern: NominalPattern, start: int, freedoms: list[Freedom]) -> tuple[list[DatumShift], np.ndarray]:
    """Return the datum shifts that a pattern follows, and its coordinates (coordinate, column) per unit deviation.

    The freedoms of these shifts are added to its `freedoms`, which begin at the column `start`.
    """
    shifts, coordinates = list[DatumShift](), np.zeros((pattern.count, start + len(freedoms)))
    for layer in pattern.layers:
        effect = layer.added @ layer.added.T @ pattern.values
        kept, first = layer.frame.columns_affecting(effect), start + len(freedoms)
        places = np.array([*range(start), *range(first, first + len(kept) - start)], dtype=int)
        for shift in filter(None, (shift.moved(kept, places) for shift in layer.frame.shifts)):
            shifts.append(shift)
            names = shift.labels(layer.tolerance.datums)
            freedoms += [Freedom(f"{pattern.declared.label}.{name}", DATUM, rule=shift.rule) for name in names]
        coordinates = padded(coordinates, start + len(freedoms))
        coordinates[:, layer.columns] = layer.added
        coordinates[:, places] += effect @ layer.frame.motion[:, kept]
    return shifts, coordinates


def _check_disjoint(feature: Feature, areas: Sequence[FaceArea], earlier: NominalFeature, meshes: Meshes) -> None:
    """Raise GeometryFault if a face that deviates with a feature also deviates with an earlier feature of its part."""
    for face, moves in zip(areas, moving_faces(feature), strict=True):
        for earlier_face, earlier_moves in zip(earlier.areas, moving_faces(earlier.feature), strict=True):
            if moves and earlier_moves and face.share(earlier_face, meshes[feature.part]) > MIN_SHARE:
                raise GeometryFault(
                    f'it shares a face with feature "{earlier.feature.name}", so that would deviate twice; give all '
                    "tolerances of a face to one feature"
                )


def _check_size(feature: Feature, geometry: FeatureGeometry) -> None:
    size = feature.size
    if size is None or not isinstance(geometry, FeatureOfSize):
        raise GeometryFault(f"a size is for cylinders, spheres and two opposed planes, and it is {geometry.in_words}")
    if abs(geometry.size - size.nominal) > SAME_SIZE * geometry.size:
        raise GeometryFault(
            f"its size is {geometry.size:.9g} mm as shaped, and {size.nominal:g} mm in its tolerance; state the size of the "
            "shape, with the limits about it"
        )
    if size.tolerance_class and size.tolerance_class.isupper() != geometry.is_inner:
        kind, letters = (
            ("a hole", size.tolerance_class.upper()) if geometry.is_inner else ("no hole", size.tolerance_class.lower())
        )
        raise GeometryFault(f'its tolerance class is {size.tolerance_class}, and it is {kind}; write "{letters}"')
