"""Parts, their points and faces, their elasticity, and their toleranced geometry: features, patterns and datums."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar, Literal, TypeVar, get_args

from tolcontact.declaration.checks import Checked, Declaration, one_of
from tolcontact.declaration.geometry import Elastic, Geometry, elastic_faults
from tolcontact.declaration.selection import Near, Picker, Selection, criterion
from tolcontact.declaration.toleranced import ASSOCIATIONS, Association, Control, Toleranced, letter_faults
from tolcontact.declaration.values import Mirror, Side, Vector, is_finite, script_line, vector
from tolcontact.readable import Readable
from tolcontact.user_functions import refuse_in_functions

D = TypeVar("D", bound=Checked)

Standard = Literal["", "ISO", "ASME"]


@dataclass(frozen=True, eq=False, repr=False)
class Part(Declaration):
    """A body: its shape, its place in the nominal assembly, and whether contact may move it. It is rigid unless `elastic`.

    A point `p` of the part lies at `rotation * p + at` in the nominal assembly frame; `rotation` is a rotation vector [rad],
    `at` a position [mm]. With `mirror="x"` the x axis of its frame is reversed before, so that it is a mirror image. With
    `fixed=None` a part is free if it is the moving side of a contact pair, floats, or has one-sided locators; otherwise it is
    fixed. The `standard` of its drawing is explained by Assembly.
    """

    name: str
    geometry: Geometry
    at: Vector = (0.0, 0.0, 0.0)
    rotation: Vector = (0.0, 0.0, 0.0)
    fixed: bool | None = None
    standard: Standard = ""
    declared_at: str = field(default_factory=script_line)
    mirror: Mirror = ""
    _declared: "list[Feature | Pattern | DatumTargets | Elastic]" = field(default_factory=list, init=False)
    noun: ClassVar[str] = "part"
    checks: ClassVar = {"standard": one_of(get_args(Standard)), "mirror": one_of(get_args(Mirror))}

    @property
    def toleranced(self) -> "tuple[Feature | Pattern, ...]":
        """The features and patterns in the order of the script."""
        return tuple(declared for declared in self._declared if isinstance(declared, Feature | Pattern))

    @property
    def features(self) -> "tuple[Feature, ...]":
        """The features, among them the members of patterns."""
        return tuple(dict.fromkeys(member for declared in self.toleranced for member in declared.members))

    @property
    def targets(self) -> "tuple[DatumTargets, ...]":
        return tuple(declared for declared in self._declared if isinstance(declared, DatumTargets))

    @property
    def elasticity(self) -> Elastic | None:
        """Its elasticity; None for a rigid part."""
        return next((declared for declared in self._declared if isinstance(declared, Elastic)), None)

    def feature(
        self, name: str, *constituents: "Face | Control", datum: str | None = None, association: Association = "outside"
    ) -> "Feature":
        """Name a face, or two that are opposed, with its tolerances: `part.feature("H1", face, tc.Size(8, 0.1), datum="B")`.

        The `name` is unique in the part; `constituents` are one face or two, and tolerances. `datum` is a letter.
        `association` is how a plane with tilt or form becomes a datum: "outside" (default) or "least squares".
        """
        faces = tuple(constituent for constituent in constituents if isinstance(constituent, Face))
        tolerances = tuple(constituent for constituent in constituents if isinstance(constituent, Control))
        if others := [constituent for constituent in constituents if not isinstance(constituent, Face | Control)]:
            raise TypeError(
                f'feature "{name}": {type(others[0]).__name__} is neither a face nor a tolerance; expected '
                "part.face(...), tc.Size(...), tc.Position(...) or another tolerance of a feature"
            )
        return self.add(Feature(name, self, faces, tolerances, datum, script_line(), association))

    def pattern(
        self, name: str, *constituents: "Face | Sequence[Face] | Feature | Control", datum: str | None = None
    ) -> "Pattern":
        """Name several like faces with their common tolerances: `part.pattern("H", face, face, tc.Position(0.2, "A"))`.

        Its `constituents` are members, which get the `name` and a number, and tolerances; `datum` is a common letter. Members
        are faces, or pairs (face, face). Members of a datum alone may be unlike, or features with tolerances (see Pattern).
        """
        members: list[tuple[Face, ...] | Feature] = []
        for constituent in constituents:
            if isinstance(constituent, list | tuple) and all(isinstance(face, Face) for face in constituent):
                members.append(tuple(constituent))
            elif isinstance(constituent, Face | Feature):
                members.append((constituent,) if isinstance(constituent, Face) else constituent)
            elif not isinstance(constituent, Control):
                raise TypeError(
                    f'pattern "{name}": {type(constituent).__name__} is neither a member nor a tolerance; expected '
                    "part.face(...), two faces in parentheses, a feature, tc.Size(...), tc.Position(...) or another tolerance"
                )
        tolerances = tuple(tolerance for tolerance in constituents if isinstance(tolerance, Control))
        return self.add(Pattern(name, self, tuple(members), tolerances, datum, script_line()))

    def elastic(
        self, E: float | None = None, nu: float | None = None, *, density: float | None = None,
        stiffness: str | Path | None = None, nodes: str | Path | None = None, pad: float | None = None,
        element_size: float | None = None,
    ) -> Elastic:  # fmt: skip
        """Declare that forces bend this part: `part.elastic(E=70e3, nu=0.33)`, or by the files of a matrix (see Elastic).

        E, nu             modulus [MPa] and Poisson's ratio of its material
        density           [kg/m^3], which `assembly.gravity` needs
        stiffness, nodes  files of a stiffness matrix [N/mm] without supports, and of its nodes [mm], in place of E and nu
        pad               [mm] radius over which a force at a point is spread
        element_size      [mm] longest edge of its tetrahedra, smaller than by default if `tolcontact check` asks for it
        """
        elastic = Elastic(E=E, nu=nu, density=density, stiffness=stiffness, nodes=nodes, pad=pad, element_size=element_size)
        return self.add(replace(elastic, declared_at=script_line()))

    def add(self, declared: D) -> D:
        """Add a declaration of this part, and return it."""
        refuse_in_functions()
        self._declared.append(declared)  # type: ignore[arg-type]
        return declared

    def datum_targets(self, letter: str, *points: "Point") -> "DatumTargets":
        """Declare datum `letter` by `points` on features: `part.datum_targets("A", pad.point(0, 0, 0))` (see DatumTargets)."""
        if others := [point for point in points if not isinstance(point, Point)]:
            raise TypeError(f'datum "{letter}": {type(others[0]).__name__} is no point; expected feature.point(x, y, z)')
        return self.add(DatumTargets(letter, points, script_line()))

    def point(self, x: float, y: float, z: float) -> "Point":
        """Return the point (x, y, z) [mm] of this part, in its own frame, as in `part.point(10, 0, 5)`."""
        return Point(self, vector((x, y, z)))

    def face(self, *selections: Side | str | Sequence[int] | Picker | Selection) -> "Face":
        """Return the triangles of this part that meet all `selections`, as in `part.face("+z")`; without any, all.

        A selection is a direction ("+x" to "-z": all triangles whose outward normal points there in the part's own
        frame), one of `tc.select` (`Facing`, `Inside` a box, `Near` another part, `Cylinder`, `Largest`, `Brep`: a face of a
        STEP file), the indices of triangles, or a function `(centres, normals) -> mask` of arrays (triangle, 3) [mm, -].
        """
        return Face(self, tuple(map(criterion, selections)))

    def faults(self) -> Iterator[str]:
        yield from super().faults()
        yield from self.geometry.faults()
        for label, example in (("at", "(0, 0, 10)"), ("rotation", "tc.degrees(0, 0, 90)")):
            if not is_finite(getattr(self, label)):
                yield f"{label} is {getattr(self, label)!r}; expected three finite numbers, as in {label}={example}"
        yield from elastic_faults([declared for declared in self._declared if isinstance(declared, Elastic)], self.fixed)

    def __str__(self) -> str:
        place = "" if self.at == (0.0, 0.0, 0.0) else " at ({:g}, {:g}, {:g})".format(*self.at)
        choice = (", mirrored" if self.mirror else "") + {None: "", True: ", fixed", False: ", free"}[self.fixed]
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
            yield f'point of part "{self.part.name}" is {self.position!r}; expected three finite numbers'
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
class Feature(Toleranced):
    """A face of a part, or two that are opposed (a slot, a tab, a thickness), with a name and its tolerances.

    A feature may be used in place of a face. Contact, locators and measures on a feature share its deviation, which is positive
    outward from the material. Tolerances refer to it by the letter `datum`, and `association` is how a plane with tilt or form
    becomes that datum: one of ASSOCIATIONS.
    """

    name: str
    part: Part
    faces: tuple[Face, ...]
    tolerances: tuple[Control, ...] = ()
    datum: str | None = None
    declared_at: str = ""
    association: Association = "outside"
    checks, fault_prefix = {"association": one_of(ASSOCIATIONS)}, "its "

    @property
    def members(self) -> "tuple[Feature, ...]":
        """The feature itself: it is a pattern of one member."""
        return (self,)

    def point(self, x: float, y: float, z: float) -> Point:
        """Return the point (x, y, z) [mm] of its part, which moves with the feature when it deviates: `top.point(0, 0, 5)`."""
        return Point(self.part, vector((x, y, z)), self)

    def axis(self, end: int) -> Point:
        """Return an end of the axis of a cylinder or cone, or the centre of a sphere.

        `hole.axis(1)` is its upper end if it is vertical: an `end` is 0 or 1, in the sense of the axis' largest component.
        """
        return Point(self.part, None, self, end)

    def faults(self) -> Iterator[str]:
        yield from (*self.face_faults(), *letter_faults(self.datum), *super().faults())
        yield from self.tolerance_faults(len(self.faces))

    def face_faults(self) -> Iterator[str]:
        """Yield the faults of the faces alone."""
        for face in self.faces:
            yield from face.faults()
            if face.part is not self.part:
                yield f'its face {face} belongs to part "{face.part.name}"'
        if not 1 <= len(self.faces) <= 2:
            yield f"it has {len(self.faces)} faces; expected one, or two that are opposed"

    def __str__(self) -> str:
        return self.in_words(", ".join(map(str, self.faces)))


@dataclass(frozen=True, eq=False, repr=False)
class Pattern(Toleranced):
    """Several features of a part that share their tolerances, and may be one datum together.

    constituents   of each member: its face, or two that are opposed; or a feature that was declared before
    datum          the letter of the common datum of all members

    The members of faces are features "H 1", "H 2", ... of a pattern "H", in this order. They are of one kind and one nominal
    size. Only a pattern without tolerances, which is a datum alone, may have unlike members and features declared before.
    """

    name: str
    part: Part
    constituents: tuple[tuple[Face, ...] | Feature, ...]
    tolerances: tuple[Control, ...] = ()
    datum: str | None = None
    declared_at: str = ""
    noun, has_members = "pattern", True

    @cached_property
    def members(self) -> tuple[Feature, ...]:
        """The features of the pattern."""
        return tuple(
            member if isinstance(member, Feature)
            else Feature(f"{self.name} {number}", self.part, member, self.tolerances, None, self.declared_at)
            for number, member in enumerate(self.constituents, start=1)
        )  # fmt: skip

    @property
    def borrowed(self) -> tuple[Feature, ...]:
        """The members that were declared before, as features."""
        return tuple(constituent for constituent in self.constituents if isinstance(constituent, Feature))

    def faults(self) -> Iterator[str]:
        if len(self.members) < 2:
            yield f"it has {len(self.members)} member(s); expected two or more; declare one with part.feature(...)"
        for member in (member for member in self.members if member not in self.borrowed):
            yield from (f'member "{member.name}": {fault}' for fault in member.face_faults())
        yield from letter_faults(self.datum)
        for feature in self.borrowed:
            if feature not in self.part.toleranced:
                yield f'its member "{feature.name}" is no feature of part "{self.part.name}"; take one of that part'
            elif self.tolerances:
                yield (
                    f'its member "{feature.name}" is a feature with tolerances of its own; give the faces of members to a '
                    "pattern with tolerances, or leave its tolerances out"
                )
        if not self.tolerances and self.datum is None:
            yield 'it has neither tolerances nor a datum letter; give one of them, as in datum="B"'
        yield from self.tolerance_faults(max((len(member.faces) for member in self.members), default=1))

    def __str__(self) -> str:
        return self.in_words(f"{len(self.members)} members")


@dataclass(frozen=True, eq=False, repr=False)
class DatumTargets(Declaration):
    """A datum that touches its part at points on features, along their normals there, as locators of a fixture do.

    Several features may have targets of one datum. More targets than it locks freedoms count by least squares.
    """

    letter: str
    points: tuple[Point, ...]
    declared_at: str = ""
    noun: ClassVar[str] = "datum"

    @property
    def name(self) -> str:  # type: ignore[override]
        return self.letter

    @property
    def features(self) -> tuple[Feature, ...]:
        """The features that the targets are on."""
        return tuple(dict.fromkeys(point.on for point in self.points if point.on is not None))

    def faults(self) -> Iterator[str]:
        yield from letter_faults(self.letter)
        if not self.points:
            yield 'it has no targets; give points on features, as in part.datum_targets("A", pad.point(0, 0, 0))'
        for point in self.points:
            yield from point.faults()
            if point.on is None or point.end is not None:
                yield f"its target {point} is not on a face of a feature; take it from a feature, as in pad.point(0, 0, 0)"

    def __str__(self) -> str:
        return f"datum {self.letter}: targets {', '.join(map(str, self.points))}"


def face_of(face: Face | Feature) -> Face:
    """Return the face itself, or the face of a feature. Raises TypeError for a feature of two faces."""
    if isinstance(face, Feature):
        if len(face.faces) != 1:
            raise TypeError(f'feature "{face.name}" has {len(face.faces)} faces; choose one of them: .faces[0]')
        return face.faces[0]
    return face
