"""Where on a part the annotations of a file apply, and what features can state of them. Part frame, mm.

Each annotation claims surfaces, which become features.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tolcontact.declaration import feature_tolerance as declared
from tolcontact.declaration.feature_tolerance import KINDS as DECLARED_KINDS, GeometricTolerance
from tolcontact.declaration.size import Size
from tolcontact.declaration.values import Vector
from tolcontact.declaration.written_tolerance import TextFault, tolerance_class
from tolcontact.features.tolerance_kinds import is_drawn
from tolcontact.geometry.analytic_surfaces import are_opposed
from tolcontact.geometry.brep_face import describe_faces, faces_at, faces_on_surfaces, plain_vector
from tolcontact.geometry.face_groups import are_one_surface
from tolcontact.geometry.files import FROM_PRODUCT, STATED_FACES, Shape
from tolcontact.pmi.annotations import OF_DATUMS, OF_TOLERANCES, Datum, DatumReference, Dimension, Modifier, Pmi, Tolerance
from tolcontact.readable import Readable

MAX_ANGLE = 0.01  # [rad] between directions of faces that may be parts of one surface: fitted ones differ by much less
MAX_DISTANCE = 1e-3  # of a part's size: from a point to its face
MAX_NAMES = 6  # of features in a reason
MAX_SIZE_DIFFERENCE = 1.0  # in widths of the limits: between them and the size of the shape
NO_FACE = "the file states no face for it"  # a reason
_DIGITS = 9  # of sizes [mm] after the point
_KINDS = {
    "surface profile": declared.Profile, "circular runout": declared.CircularRunout, "total runout": declared.TotalRunout,
    "concentricity": declared.Coaxiality,
}  # fmt: skip
_MEDIAN_KINDS = ("position", "symmetry")  # of two opposed planes: of their median plane
_ROUND = ("cylinder", "cone", "sphere", "torus")
_ROUND_ZONES = ("cylindrical or circular", "within a cylinder", "within a circle", "spherical", "within a sphere")
Annotation = Tolerance | Dimension | Datum
Place = tuple[frozenset[int], ...]  # of a feature: the face indices of its surface, or of each of its two planes


class Undeclared(Exception):
    """An annotation that no feature can state; the message is the reason."""


class TolerancedSurfaces:
    """The surfaces of a part, by the record numbers of their faces.

    faces   the faces of the part, by their numbers less 1
    """

    def __init__(self, mesh: Shape) -> None:
        self._mesh = mesh
        stated_faces = enumerate(mesh.metadata[STATED_FACES], start=1)
        self._numbers = {record: number for number, face in stated_faces for record in face.records}
        self._surfaces = faces_on_surfaces(mesh)
        self.faces = describe_faces(mesh)

    def numbers(self, records: Iterable[int]) -> list[int]:
        """Return the face indices of some records on this part."""
        return [self._numbers[record] for record in records if record in self._numbers]

    def located(self, point: Vector) -> tuple[int | None, Vector]:
        """Return the face index of a point of the product, None on no face or where faces meet, and its place in the part."""
        R, t = self._mesh.metadata[FROM_PRODUCT]
        placed = plain_vector(R @ point + t)
        numbers, distance = faces_at(self._mesh, placed)
        return numbers[0] if len(numbers) == 1 and distance < MAX_DISTANCE * self._mesh.scale else None, placed

    def surfaces(self, numbers: Iterable[int]) -> list[frozenset[int]]:
        """Return the surfaces that some faces make up, each with all of its faces.

        Planes are one surface if they lie in one plane. A round face represents the whole surface around its axis.
        """
        faces = [(number, self.faces[number - 1]) for number in numbers]
        remaining = list(dict.fromkeys(k for n, face in faces for k in (n, *(face.whole if face.kind in _ROUND else ()))))
        surfaces = []
        while remaining:
            first = remaining[0]
            surfaces.append(frozenset(number for number in remaining if number == first or self._are_one(first, number)))
            remaining = [number for number in remaining if number not in surfaces[-1]]
        return surfaces

    def kind(self, surface: frozenset[int]) -> str:
        """Return the kind of a surface: plane, cylinder, cone, sphere, torus, or "general"."""
        return self.faces[min(surface) - 1].kind

    def are_opposed(self, surfaces: Sequence[frozenset[int]]) -> bool:
        """Return whether these are two planes with opposite normals."""
        if len(surfaces) != 2 or any(self.kind(surface) != "plane" for surface in surfaces):
            return False
        return are_opposed(*(np.array(self.faces[min(surface) - 1].direction) for surface in surfaces))

    def _are_one(self, number: int, other: int) -> bool:
        """Return whether two faces are parts of one surface. Most differ in their kind or direction."""
        face, next_face = self.faces[number - 1], self.faces[other - 1]
        if face.kind != next_face.kind or face.is_inner != next_face.is_inner:
            return False
        if face.direction and next_face.direction and np.linalg.norm(np.cross(face.direction, next_face.direction)) > MAX_ANGLE:
            return False
        return are_one_surface(self._mesh, self._surfaces[number - 1], self._surfaces[other - 1])


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
        return [
            f"{', '.join(names[:MAX_NAMES])}{', ...' if len(names) > MAX_NAMES else ''}: {reason}"
            if names and len(names) < len(self.places) else reason
            for reason, names in self.refusals.items()
        ]  # fmt: skip

    @property
    def result(self) -> DeclaredAnnotation:
        """The outcome."""
        missing = missing_faces(self.stated - len(self.numbers), self.stated) if self.numbers else ""
        reasons = dict.fromkeys(filter(None, [missing, *self.reasons]))
        return DeclaredAnnotation(self.annotation, tuple(dict.fromkeys(self.names)), "; ".join(reasons))


def missing_faces(missing: int, stated: int) -> str:
    """Return the reason for faces that are stated and not on a part; "" if there are none."""
    return f"{missing} of its {stated} faces are not on the part" if missing else ""


def claims_of(pmi: Pmi, surfaces: TolerancedSurfaces) -> list[Claim]:
    """Return the claims of all annotations of a file on the surfaces of a part, in the order of the file.

    Claims of the fewest faces find their places first, so that a note for many faces cannot join features that others separate.
    """
    toleranced: tuple[Tolerance | Dimension, ...] = (*pmi.dimensions, *pmi.tolerances)
    claims = [
        *(_datum_claim(datum, surfaces) for datum in pmi.datums),
        *(Claim(stated, len(stated.face_records), tuple(surfaces.numbers(stated.face_records))) for stated in toleranced),
    ]
    place_of: dict[int, Place] = {}
    for claim in sorted(claims, key=lambda claim: len(claim.numbers)):
        try:
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
    places = [surfaces.located(target.point) for target in bare if target.point is not None]
    targets = tuple((number, point) for number, point in places if number is not None)
    numbers = list(dict.fromkeys([*surfaces.numbers(records), *(number for number, _ in targets)]))
    stated = len(numbers) or len(datum.face_records) + len(records) + len(places)
    are_points = len(targets) == len(datum.targets) and all(target.kind == "point" for target in datum.targets)
    return Claim(datum, stated, tuple(numbers), targets if are_points else ())


def _places(claim: Claim, surfaces: TolerancedSurfaces, place_of: dict[int, Place]) -> list[Place]:
    """Return the places of a claim: places of earlier claims on the same faces, and new ones. Raises Undeclared."""
    numbers, annotation = claim.numbers, claim.annotation
    if isinstance(annotation, Dimension) and annotation.kind != "size":
        article = "an" if annotation.kind[0] in "aeiou" else "a"
        raise Undeclared(f"it is {article} {annotation.kind}, and features have sizes only")
    if isinstance(annotation, Tolerance) and annotation.extent == "all over":
        raise Undeclared("it is for all faces of the file; declare it for the faces that matter")
    if not numbers and isinstance(annotation, Datum) and annotation.targets:
        raise Undeclared("none of its targets is on a face of the part")
    if not numbers:
        raise Undeclared("none of its faces is on the part" if claim.stated else NO_FACE)
    groups = surfaces.surfaces(numbers)
    if surfaces.are_opposed(groups) and (
        not isinstance(annotation, Tolerance)  # a size, or a datum
        or annotation.kind in _MEDIAN_KINDS
        or set(place_of.get(min(groups[0]), ())) == set(groups)
    ):
        return [_pair(groups, place_of)]
    claimed = {number for group in groups for number in group}
    earlier = list(dict.fromkeys(place_of[number] for number in sorted(claimed) if number in place_of))
    for place in earlier:
        if not all(surface <= claimed for surface in place):
            faces = ", ".join(str(number) for number in sorted(n for surface in place for n in surface))
            raise Undeclared(f"it is for a part of what others tolerance as one feature, faces {faces}")
    return [*earlier, *((surface,) for surface in surfaces.surfaces(sorted(claimed - place_of.keys())))]


def _pair(groups: Sequence[frozenset[int]], place_of: dict[int, Place]) -> Place:
    """Return the place of two opposed planes. Raises Undeclared if one of them belongs to another place."""
    first, *others = {place_of.get(number) for group in groups for number in group}
    if not others and (first is None or set(first) == set(groups)):
        return first or tuple(groups)
    raise Undeclared("its two planes have tolerances of their own, so they are no slot or tab")


def declared_tolerance(stated: Tolerance, *, is_axis: bool) -> GeometricTolerance:
    """Return a tolerance of a feature, with or without an axis, as it is declared. Raises Undeclared with the reason."""
    kind = _KINDS.get(stated.kind) or DECLARED_KINDS.get(stated.kind)
    if kind is None:
        raise Undeclared("its kind is not stated" if not stated.kind else f"features do not declare its kind, {stated.kind}")
    if stated.value is None:
        raise Undeclared("its value is not stated")
    if stated.maximum is not None:
        raise Undeclared("its value has an upper bound, which zones do not have")
    options: dict[str, Any] = {"projected": stated.projected, "outside": stated.displacement}
    for modifier in stated.modifiers:
        options |= _declared(modifier, OF_TOLERANCES, "of a declared tolerance")
    if stated.per_unit:
        options["per"] = stated.per_unit if len(stated.per_unit) > 1 else stated.per_unit[0]
    if is_axis and "zone" in kind.options and stated.zone not in _ROUND_ZONES:
        raise Undeclared("its zone is flat, and the file does not state across which direction")
    is_lower = stated.refines is not None  # the lower segments of a composite frame lock directions alone
    system = "|".join(_compartment(reference, is_turned=is_lower) for reference in stated.datums)
    if (kind.is_form and not is_drawn(kind, options.get("per"))) or not (kind.is_form or kind.needs_datums or system):
        options["form"] = None  # a profile without datums may be of any surface
    if "(" not in system:
        options.pop("simultaneous", None)  # nothing is shared or separate
    result = kind(stated.value, system, **options)
    if not system and kind.needs_datums and kind is not declared.Position:  # which members of a pattern may have
        raise Undeclared("it needs datums, and the file states none")
    for fault in result.faults():
        raise Undeclared(fault)
    return result


def _compartment(reference: DatumReference, *, is_turned: bool) -> str:
    """Return a place of a datum system as it is declared; with `is_turned` it locks directions alone."""
    letters, marks = "-".join(reference.letters), {"><"} if is_turned else set[str]()
    try:
        marks |= {_declared(modifier, OF_DATUMS, "of a declared datum")["mark"] for modifier in reference.modifiers}
    except Undeclared as reason:
        raise Undeclared(f"datum {letters}: {reason}") from reason
    return letters + "".join(sorted(marks))  # "(M)" comes before "><"


def _declared(modifier: str, table: Mapping[str, Modifier], of_what: str) -> dict[str, Any]:
    """Return how a modifier is declared. Raises Undeclared with the reason and the standard if it is not."""
    if modifier not in table:
        raise Undeclared(f"its modifier, {modifier}, is not one {of_what}")
    entry = table[modifier]
    if isinstance(entry.declared, str):
        raise Undeclared(f"its modifier, {modifier} ({entry.sign}, {entry.standard}): {entry.declared}")
    return entry.declared


def declared_size(stated: Dimension, nominal: float, *, is_inner: bool) -> Size:
    """Return the size of a shape of `nominal` size [mm], with the limits of a dimension about it.

    Raises Undeclared with the reason.
    """
    lower, upper = _limits(stated, nominal, is_inner)
    if not lower < upper:
        raise Undeclared(f"its limits {lower:g} and {upper:g} leave no width")
    if not lower - MAX_SIZE_DIFFERENCE * (upper - lower) <= nominal <= upper + MAX_SIZE_DIFFERENCE * (upper - lower):
        raise Undeclared(f"its limits are {lower:.6g} to {upper:.6g}, and the size of the shape is {nominal:.6g}")
    middle = round(nominal, _DIGITS)  # the kernel's numbers differ from the file's in their last digits
    return Size(middle, round(upper - middle, _DIGITS), round(lower - middle, _DIGITS))


def _limits(stated: Dimension, nominal: float, is_inner: bool) -> tuple[float, float]:
    """Return the limits of a size [mm], from its dimension or else from its tolerance class. Raises Undeclared."""
    factor = 2.0 if "radius" in stated.name else 1.0
    if stated.lower is not None and stated.upper is not None:
        if stated.unit != "mm":
            raise Undeclared("it is an angle")
        return factor * stated.lower, factor * stated.upper
    if not stated.fit:
        raise Undeclared("its limits are not stated")
    basis = nominal if stated.nominal is None else factor * stated.nominal
    try:
        fit = tolerance_class("".join(stated.fit.split()[:1]))
        lower, upper = fit.deviations(basis) if fit else (math.nan, math.nan)
    except TextFault as error:
        raise Undeclared(str(error)) from error
    if fit is None:
        raise Undeclared(f"its fit {stated.fit} is no tolerance class of ISO 286-1")
    if fit.is_hole != is_inner:
        kinds = ("a hole", "a shaft") if fit.is_hole else ("a shaft", "a hole")
        raise Undeclared(f"its fit {stated.fit} is for {kinds[0]}, and the feature is {kinds[1]}")
    return basis + lower, basis + upper
