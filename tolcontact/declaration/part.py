"""Parts, their points and faces, and the forces that press them onto their supports: gravity, clamps and others."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from tolcontact.declaration.feature_tolerance import GeometricTolerance, Size
from tolcontact.declaration.geometry import Box, Mesh
from tolcontact.declaration.selection import Near, Picker, Selection, criterion
from tolcontact.declaration.values import Vector, is_finite, is_length, script_line, vector
from tolcontact.later import LATER, PMI
from tolcontact.readable import Readable

OUTSIDE, LEAST_SQUARES = ASSOCIATIONS = ("outside", "least squares")  # from a plane to a datum, ISO 5459
LETTER = re.compile(r"[A-Z]{1,2}")


@dataclass(frozen=True, eq=False, repr=False)
class Part(Readable):
    """A rigid body: its shape, its place in the nominal assembly, and whether contact may move it.

    A point `p` of the part lies at `rotation * p + at` in the nominal assembly frame; `rotation` is a rotation vector [rad],
    `at` a position [mm]. With `fixed=None` a part is free if it is the moving side of a contact pair, floats, or has
    one-sided locators; otherwise it is fixed.
    """

    name: str
    geometry: Box | Mesh
    at: Vector = (0.0, 0.0, 0.0)
    rotation: Vector = (0.0, 0.0, 0.0)
    fixed: bool | None = None
    declared_at: str = field(default_factory=script_line)
    _features: "list[Feature]" = field(default_factory=list, init=False)

    @property
    def features(self) -> "tuple[Feature, ...]":
        return tuple(self._features)

    def feature(
        self,
        name: str,
        *constituents: "Face | Size | GeometricTolerance",
        datum: str | None = None,
        association: str = OUTSIDE,
    ) -> "Feature":
        """Name a face, or two that are opposed, with its tolerances: `part.feature("H1", face, tc.Size(...), datum="B")`.

        `association` is how a plane that leans becomes a datum: "outside" or "least squares" (see `tolcontact.features`).
        """
        for constituent in constituents:
            if not isinstance(constituent, Face | Size | GeometricTolerance):
                raise TypeError(
                    f'feature "{name}": {type(constituent).__name__} is neither a face nor a tolerance; expected '
                    "part.face(...), tc.Size(...), tc.Position(...) or another tolerance of a feature"
                )
        faces = tuple(constituent for constituent in constituents if isinstance(constituent, Face))
        tolerances = tuple(constituent for constituent in constituents if not isinstance(constituent, Face))
        self.add(Feature(name, self, faces, tolerances, datum, script_line(), association))
        return self._features[-1]

    def add(self, *features: "Feature") -> None:
        """Add declared features to this part."""
        self._features.extend(features)

    def features_from_pmi(self) -> Any:
        """Declare the features that the STEP file of this part states as PMI, and return a `tolcontact.pmi.DeclaredPmi`.

        It lists every tolerance, dimension and datum of the file with the features that state it, or with the reason why none
        does. Faces of one surface are one feature, and so are the two planes of a slot or a tab whose size or position is
        toleranced. A feature is named after the letter of its datum, else after its kind and the number of its first face, as
        in "cylinder 12". Raises ModelError if the file cannot be read, or states no PMI.
        """
        return LATER[PMI](self)

    def point(self, x: float, y: float, z: float) -> "Point":
        """Return the point (x, y, z) [mm] of this part, in its own frame."""
        return Point(self, vector((x, y, z)))

    def face(self, *selections: str | Sequence[int] | Picker | Selection) -> "Face":
        """Return the triangles of this part that meet every criterion; without any, the whole surface.

        A criterion is a direction ("+x" to "-z": all triangles whose outward normal points there in the part's own
        frame), `tc.Facing`, `tc.Inside` a box, `tc.Near` another part, `tc.Cylinder`, `tc.Largest`, `tc.Brep` (a face of a
        STEP file), the indices of triangles, or a function `(centres, normals) -> mask` of arrays (triangle, 3) [mm, -].
        """
        return Face(self, tuple(map(criterion, selections)))

    def faults(self) -> Iterator[str]:
        yield from self.geometry.faults()
        for label, value in (("at", self.at), ("rotation", self.rotation)):
            if not is_finite(value):
                yield f"{label} is not a vector of three finite numbers"

    def __str__(self) -> str:
        place = "" if self.at == (0.0, 0.0, 0.0) else " at ({:g}, {:g}, {:g})".format(*self.at)
        choice = {None: "", True: ", fixed", False: ", free"}[self.fixed]
        return f"part {self.name}: {self.geometry}{place}{choice}"


@dataclass(frozen=True, eq=False, repr=False)
class Face(Readable):
    """The triangles of a part's surface that meet every criterion."""

    part: Part
    selections: tuple[Selection, ...]

    @property
    def parts(self) -> tuple[Part, ...]:
        """The part itself, and the parts that its criteria refer to."""
        return (self.part, *(selection.part for selection in self.selections if isinstance(selection, Near)))

    def faults(self) -> Iterator[str]:
        for selection in self.selections:
            yield from (f'face of part "{self.part.name}": {fault}' for fault in selection.faults())

    def __str__(self) -> str:
        return " ".join([self.part.name, *map(str, self.selections)])


@dataclass(frozen=True, eq=False, repr=False)
class Point(Readable):
    """A point of a part, in the part's own frame [mm]; a point `on` a feature moves with the deviation of the feature.

    An `end` (0 or 1) of the feature's axis may replace the position.
    """

    part: Part
    position: Vector | None = None
    on: "Feature | None" = None
    end: int | None = None

    def faults(self) -> Iterator[str]:
        if self.position is not None and not is_finite(self.position):
            yield f'point of part "{self.part.name}" is not three finite numbers'
        if self.position is None and self.on is None:
            yield f'point of part "{self.part.name}" has no position; an end of an axis needs the feature that it is on'
        elif self.position is None and self.end not in (0, 1):
            yield f"end of the axis is {self.end!r}; expected 0 or 1"

    def __str__(self) -> str:
        owner = f"{self.part.name}.{self.on.name}" if self.on else self.part.name
        if self.position is None:
            return f"{owner} axis end {self.end}"
        return "{} ({:g}, {:g}, {:g})".format(owner, *self.position)


@dataclass(frozen=True, eq=False, repr=False)
class Feature(Readable):
    """A face of a part, or two that are opposed (a slot, a tab, a thickness), with a name and its tolerances.

    A feature may be used in place of a face. Contact, locators and measures on a feature share its deviation, which is positive
    outward from the material. `datum` is the letter by which tolerances refer to it, and `association` is how a plane becomes
    that datum if it leans: one of ASSOCIATIONS.
    """

    name: str
    part: Part
    faces: tuple[Face, ...]
    tolerances: tuple[Size | GeometricTolerance, ...] = ()
    datum: str | None = None
    declared_at: str = ""
    association: str = OUTSIDE

    @property
    def size(self) -> Size | None:
        """The tolerance of the size; None without one."""
        return next((tolerance for tolerance in self.tolerances if isinstance(tolerance, Size)), None)

    @property
    def geometric(self) -> tuple[GeometricTolerance, ...]:
        """The geometric tolerances, without the size."""
        return tuple(tolerance for tolerance in self.tolerances if isinstance(tolerance, GeometricTolerance))

    def point(self, x: float, y: float, z: float) -> Point:
        """Return the point (x, y, z) [mm] of its part, which moves with the feature when it deviates."""
        return Point(self.part, vector((x, y, z)), self)

    def axis(self, end: int) -> Point:
        """Return an end of the axis of a cylinder or cone, or the centre of a sphere.

        The ends 0 and 1 are in the sense of the axis' largest component.
        """
        return Point(self.part, None, self, end)

    def faults(self) -> Iterator[str]:
        for face in self.faces:
            yield from face.faults()
            if face.part is not self.part:
                yield f'its face {face} belongs to part "{face.part.name}"'
        if not 1 <= len(self.faces) <= 2:
            yield f"it has {len(self.faces)} faces; expected one, or two that are opposed"
        if self.datum is not None and not (isinstance(self.datum, str) and LETTER.fullmatch(self.datum)):
            yield f"its datum letter is {self.datum!r}; expected one or two capital letters"
        if self.association not in ASSOCIATIONS:
            yield f"its association is {self.association!r}; expected one of: {', '.join(ASSOCIATIONS)}"
        for tolerance in self.tolerances:
            yield from (f"{tolerance.kind}: {fault}" for fault in tolerance.faults())
        yield from self._size_faults()
        yield from self._form_faults()

    def _size_faults(self) -> Iterator[str]:
        if sum(isinstance(tolerance, Size) for tolerance in self.tolerances) > 1:
            yield "its size is toleranced twice; leave one out"
        for tolerance in self.geometric:
            if tolerance.material and self.size is None:
                yield (
                    f"{tolerance.kind}: a bonus (material {tolerance.material!r}) needs the tolerance of a size; "
                    "add tc.Size(...)"
                )
        if self.size and self.size.moves != "both" and len(self.faces) == 1:
            yield f"size: moves is {self.size.moves!r}, but the feature has one face; leave it out"
        elif self.size and self.size.moves != "both" and any(not tolerance.is_form for tolerance in self.geometric):
            yield (
                f"size: moves is {self.size.moves!r}, so the feature has no middle that could have a place; give its other "
                'tolerances to a feature of the face alone, in place of the size, or let "both" move'
            )

    def _form_faults(self) -> Iterator[str]:
        tolerances = [tolerance for tolerance in self.geometric if is_length(tolerance.width)]
        for form in (tolerance for tolerance in tolerances if tolerance.is_form):
            for tolerance in tolerances:
                contains = not tolerance.is_form and (not form.around or tolerance.kind in form.around)
                if contains and tolerance.width < form.width:
                    yield (
                        f"{form.kind} {form.width:g} is wider than {tolerance.kind} {tolerance.width:g}, which contains it; "
                        "expected form within orientation within location"
                    )

    def __str__(self) -> str:
        letter = f" (datum {self.datum})" if self.datum else ""
        constituents = "; ".join([", ".join(str(face) for face in self.faces), *map(str, self.tolerances)])
        return f"feature {self.name} of {self.part.name}{letter}: {constituents}"


def face_of(face: Face | Feature) -> Face:
    """Return the face itself, or the face of a feature. Raises TypeError for a feature of two faces."""
    if isinstance(face, Feature):
        if len(face.faces) != 1:
            raise TypeError(f'feature "{face.name}" has {len(face.faces)} faces; choose one of them: .faces[0]')
        return face.faces[0]
    return face


@dataclass(frozen=True, eq=False, repr=False)
class Force(Readable):
    """A force `vector` [N] at a point of a part, constant in the assembly frame. The objective "seating" uses it."""

    name: str
    at: Point
    vector: Vector
    declared_at: str = ""

    def faults(self) -> Iterator[str]:
        yield from self.at.faults()
        if not (is_finite(self.vector) and any(self.vector)):
            yield "vector is not a nonzero vector of three finite numbers [N]"

    def __str__(self) -> str:
        return f"force {self.name}: ({', '.join(f'{c:g}' for c in self.vector)}) N at {self.at}"
