"""Where on a part the annotations of a file apply: each claims surfaces, which become features. Part frame, mm."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from tolcontact.declaration.values import Vector
from tolcontact.geometry.analytic_surfaces import are_opposed
from tolcontact.geometry.brep_face import are_one_surface, describe_faces, faces_at, faces_on_surfaces, plain_vector
from tolcontact.geometry.face_groups import FaceOnSurface
from tolcontact.geometry.face_in_file import FaceInFile
from tolcontact.geometry.files import FROM_PRODUCT, STATED_FACES, Shape
from tolcontact.pmi.annotations import Datum, Dimension, Pmi, Tolerance
from tolcontact.pmi.declarable import Undeclared
from tolcontact.pmi.modifiers import OF_TOLERANCES
from tolcontact.readable import Readable

MAX_ANGLE = 0.01  # [rad] between directions of faces that may be parts of one surface: fitted ones differ by much less
MAX_DISTANCE = 1e-3  # of a part's size: from a point to its face
_ROUND = ("cylinder", "cone", "sphere", "torus")
Annotation = Tolerance | Dimension | Datum
Place = tuple[frozenset[int], ...]  # of a feature: the face indices of its surface, or of each of its two planes
NO_FACE = "the file states no face for it"  # a reason
MAX_NAMES = 6  # of features in a reason
_MEDIAN_KINDS = ("position", "symmetry")  # of two opposed planes: of their median plane


class TolerancedSurfaces:
    """The surfaces of a part, by the record numbers of their faces.

    faces   the faces of the part, by their numbers less 1
    """

    def __init__(self, mesh: Shape) -> None:
        self._mesh = mesh
        self._numbers = {
            record: number for number, face in enumerate(mesh.metadata[STATED_FACES], start=1) for record in face.records
        }
        self._surfaces: Sequence[FaceOnSurface] = faces_on_surfaces(mesh)
        self.faces: Sequence[FaceInFile] = describe_faces(mesh)

    def numbers(self, records: Iterable[int]) -> list[int]:
        """Return the face indices of some records on this part."""
        return [self._numbers[record] for record in records if record in self._numbers]

    def placed(self, point: Vector) -> Vector:
        """Return a point of the product in the frame of the part."""
        R, t = self._mesh.metadata[FROM_PRODUCT]
        return plain_vector(R @ point + t)

    def number_at(self, point: Vector) -> int | None:
        """Return the index of the face of a point; None if it lies on none, or where faces meet."""
        numbers, distance = faces_at(self._mesh, point)
        return numbers[0] if len(numbers) == 1 and distance < MAX_DISTANCE * self._mesh.scale else None

    def surfaces(self, numbers: Iterable[int]) -> list[frozenset[int]]:
        """Return the surfaces that some faces make up, each with all of its faces.

        Planes are one surface if they lie in one plane. A round face represents the whole surface around its axis.
        """
        remaining = list(dict.fromkeys(number for stated in numbers for number in self._whole(stated)))
        surfaces = []
        while remaining:
            first = remaining[0]
            members = [number for number in remaining if number == first or self._are_one(first, number)]
            remaining = [number for number in remaining if number not in members]
            surfaces.append(frozenset(members))
        return surfaces

    def kind(self, surface: frozenset[int]) -> str:
        """Return the kind of a surface: plane, cylinder, cone, sphere, torus, or "general"."""
        return self.faces[min(surface) - 1].kind

    def normal(self, plane: frozenset[int]) -> np.ndarray:
        """Return the outward normal (3,) of a plane."""
        return np.array(self.faces[min(plane) - 1].direction)

    def are_opposed(self, surfaces: Sequence[frozenset[int]]) -> bool:
        """Return whether these are two planes with opposite normals."""
        if len(surfaces) != 2 or any(self.kind(surface) != "plane" for surface in surfaces):
            return False
        return are_opposed(*map(self.normal, surfaces))

    def _are_one(self, number: int, other: int) -> bool:
        """Return whether two faces are parts of one surface. Most differ in their kind or direction."""
        face, next_face = self.faces[number - 1], self.faces[other - 1]
        if face.kind != next_face.kind or face.is_inner != next_face.is_inner:
            return False
        if face.direction and next_face.direction and np.linalg.norm(np.cross(face.direction, next_face.direction)) > MAX_ANGLE:
            return False
        return are_one_surface(self._mesh, self._surfaces[number - 1], self._surfaces[other - 1])

    def _whole(self, number: int) -> Iterator[int]:
        face = self.faces[number - 1]
        yield number
        if face.kind in _ROUND:
            yield from face.whole


@dataclass(frozen=True, repr=False)
class DeclaredAnnotation(Readable):
    """A tolerance, dimension or datum of a file: the names of the `features` that state it, and the `reason` if none does.

    If both are present, the reason says which part of it is not declared.
    """

    annotation: Annotation
    features: tuple[str, ...]
    reason: str = ""

    @property
    def remark(self) -> str:
        """What to know about the features that state it; "" for most."""
        modifiers = self.annotation.modifiers if self.features and isinstance(self.annotation, Tolerance) else ()
        return "; ".join(filter(None, (OF_TOLERANCES[word].remark for word in modifiers if word in OF_TOLERANCES)))

    def __str__(self) -> str:
        names = f"declared as {', '.join(self.features)}" if self.features else "not declared"
        details = "; ".join(filter(None, (self.reason, self.remark)))
        return f"{self.annotation}: {names}{f' ({details})' if details else ''}"


@dataclass(eq=False)
class Claim:
    """An annotation, the faces that it claims, and its outcome.

    stated    number of faces and targets that the file states for it
    numbers   of its faces on the part
    targets   points of a datum that is established by points alone, with their face numbers
    places    of the features that are to state it
    names     of the features that state it
    refusals  reasons why it is not declared, with the names of the features, or none of them for all
    """

    annotation: Annotation
    stated: int
    numbers: tuple[int, ...]
    targets: tuple[tuple[int, Vector], ...] = ()
    places: tuple[Place, ...] = ()
    names: list[str] = field(default_factory=list)
    refusals: dict[str, list[str]] = field(default_factory=dict)

    def refuse(self, reason: object, name: str = "") -> None:
        """Note why it is not declared for the feature with a name, or for none."""
        self.refusals.setdefault(str(reason), []).extend(filter(None, [name]))

    @property
    def reasons(self) -> list[str]:
        """Why it is not declared: each reason with the names of the features, unless it is for all."""
        reasons = []
        for reason, names in self.refusals.items():
            listed = f"{', '.join(names[:MAX_NAMES])}{', ...' if len(names) > MAX_NAMES else ''}: "
            reasons.append(f"{listed if names and len(names) < len(self.places) else ''}{reason}")
        return reasons

    @property
    def result(self) -> DeclaredAnnotation:
        """The outcome."""
        missing = [missing_faces(self.stated - len(self.numbers), self.stated)] if self.numbers else []
        reasons = dict.fromkeys(filter(None, [*missing, *self.reasons]))
        return DeclaredAnnotation(self.annotation, tuple(dict.fromkeys(self.names)), "; ".join(reasons))


def missing_faces(missing: int, stated: int) -> str:
    """Return the reason for faces that are stated and not on a part; "" if there are none."""
    return f"{missing} of its {stated} faces are not on the part" if missing else ""


def claims_of(pmi: Pmi, surfaces: TolerancedSurfaces) -> list[Claim]:
    """Return the claims of all annotations of a file on the surfaces of a part, in the order of the file.

    Claims of the fewest faces find their places first, so that a note for many faces cannot join features that others separate.
    """
    claims = [_datum_claim(datum, surfaces) for datum in pmi.datums]
    toleranced: tuple[Tolerance | Dimension, ...] = (*pmi.dimensions, *pmi.tolerances)
    claims += [Claim(one, len(one.face_records), tuple(surfaces.numbers(one.face_records))) for one in toleranced]
    place_of: dict[int, Place] = {}
    for claim in sorted(claims, key=lambda claim: len(claim.numbers)):
        try:
            _check(claim.annotation)
            claim.places = tuple(_places(claim, surfaces, place_of))
        except Undeclared as reason:
            claim.refuse(reason)
        place_of = {number: place for place in claim.places for surface in place for number in surface} | place_of
    return claims


def _datum_claim(datum: Datum, surfaces: TolerancedSurfaces) -> Claim:
    """Return the claim of a datum: of its features on the part, else of its targets, which may be areas or points of faces.

    A line or an area locks more than a point: its face is taken as a datum feature.
    """
    if numbers := surfaces.numbers(datum.face_records):
        return Claim(datum, len(numbers), tuple(numbers))
    records = [record for target in datum.targets for record in target.face_records]
    bare = [target for target in datum.targets if not surfaces.numbers(target.face_records)]
    points = [surfaces.placed(target.point) for target in bare if target.point is not None]
    places = [(surfaces.number_at(point), point) for point in points]
    targets = tuple((number, point) for number, point in places if number is not None)
    numbers = list(dict.fromkeys([*surfaces.numbers(records), *(number for number, _ in targets)]))
    stated = len(numbers) or len(datum.face_records) + len(records) + len(places)
    are_points = len(targets) == len(datum.targets) and all(target.kind == "point" for target in datum.targets)
    return Claim(datum, stated, tuple(numbers), targets if are_points else ())


def _check(annotation: Annotation) -> None:
    """Raise Undeclared if an annotation is not one of features."""
    if isinstance(annotation, Dimension) and annotation.kind != "size":
        raise Undeclared(
            f"it is {'an' if annotation.kind[0] in 'aeiou' else 'a'} {annotation.kind}, and features have sizes only"
        )
    if isinstance(annotation, Tolerance) and annotation.extent == "all over":
        raise Undeclared("it is for all faces of the file; declare it for the faces that matter")


def _places(claim: Claim, surfaces: TolerancedSurfaces, place_of: dict[int, Place]) -> list[Place]:
    """Return the places of a claim: places of earlier claims on the same faces, and new ones."""
    numbers = claim.numbers
    if not numbers and isinstance(claim.annotation, Datum) and claim.annotation.targets:
        raise Undeclared("none of its targets is on a face of the part")
    if not numbers:
        raise Undeclared("none of its faces is on the part" if claim.stated else NO_FACE)
    groups = surfaces.surfaces(numbers)
    if surfaces.are_opposed(groups) and _has_middle(claim.annotation, tuple(groups), place_of):
        return [_pair(groups, place_of)]
    claimed = {number for group in groups for number in group}
    earlier = list(dict.fromkeys(place_of[number] for number in sorted(claimed) if number in place_of))
    for place in earlier:
        if not all(surface <= claimed for surface in place):
            faces = ", ".join(str(number) for number in sorted(n for surface in place for n in surface))
            raise Undeclared(f"it is for a part of what others tolerance as one feature, faces {faces}")
    return [*earlier, *((surface,) for surface in surfaces.surfaces(sorted(claimed - place_of.keys())))]


def _has_middle(annotation: Annotation, groups: Place, place_of: dict[int, Place]) -> bool:
    """Return whether an annotation of two opposed planes applies to their median plane, or to their distance."""
    if isinstance(annotation, Tolerance):
        return annotation.kind in _MEDIAN_KINDS or set(place_of.get(min(groups[0]), ())) == set(groups)
    return True


def _pair(groups: Sequence[frozenset[int]], place_of: dict[int, Place]) -> Place:
    """Return the place of two opposed planes. Raises Undeclared if one of them belongs to another place."""
    places = {place_of.get(number) for group in groups for number in group}
    if places == {None}:
        return tuple(groups)
    (first, *others) = places
    if not others and first is not None and set(first) == set(groups):
        return first
    raise Undeclared("its two planes have tolerances of their own, so they are no slot or tab")
