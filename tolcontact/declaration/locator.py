"""Locators of parts, 3-2-1 schemes, and the locations that consist of them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, get_args

import numpy as np

from tolcontact.declaration.checks import LENGTH_OR_0, STIFFNESS, TRUTH, Checked, Declaration, direction_faults, one_of
from tolcontact.declaration.part import Face, Feature, Part, Point, face_of
from tolcontact.declaration.tolerance import Tolerance, tolerance as _tolerance
from tolcontact.declaration.values import (
    Direction,
    Vector,
    direction as _direction,
    is_finite,
    repetitions,
    text_faults,
    vector as _vector,
)

USUAL_STIFFNESS = 1.0  # N/mm, of locators that declare none
Placing = Literal["first order", "exact", "best fit"]
FIRST_ORDER, EXACT, BEST_FIT = PLACINGS = get_args(Placing)


@dataclass(frozen=True, repr=False)
class Locator(Checked):
    """A point of a part [mm], a direction into the part, and the deviation along it, in the part's own frame.

    `tc.Locator("A1", (5, 5, 0), "z", 0.2)` has the name "A1", which is unique in its part, and a zone of full width 0.2 mm.
    A positive deviation moves the part along `direction`. `tolerance=None` takes the tolerance of the `locate` call. A
    `one_sided` locator is a support: the part may lift off it along `direction`, but not pass through it. The objective
    "locator stiffness" uses the `stiffness` [N/mm] of two-sided locators, by default 1. Under the objective "seating" a locator
    with a `stiffness` is a linear spring, and a one-sided one only pushes; without a stiffness it is rigid. A locator
    `on` a feature of its part touches this feature, and also moves the part by the deviation of the feature at the point. A
    locator of a joint is at a point of any of its parts, which the point itself states: part.point(x, y, z).
    """

    name: str
    point: Vector
    direction: Vector
    tolerance: Tolerance | None = None
    one_sided: bool = False
    stiffness: float | None = None
    on: Feature | None = None
    part: Part | None = None

    checks: ClassVar = {"stiffness": STIFFNESS, "one_sided": TRUTH}

    def __init__(
        self, name: str, point: Point | Sequence[float] | np.ndarray, direction: Direction, tolerance: Any = None, *,
        one_sided: bool = False, stiffness: float | None = None, on: Feature | None = None, part: Part | None = None,
    ) -> None:  # fmt: skip
        place: Any = point
        if isinstance(point, Point):
            part, on, place = point.part, on or point.on, point.position
        vars(self).update(
            name=name, point=_vector(place), direction=_direction(direction),
            tolerance=None if tolerance is None else _tolerance(tolerance), one_sided=one_sided, stiffness=stiffness, on=on,
            part=part,
        )  # fmt: skip

    def faults(self) -> Iterator[str]:
        if not is_finite(self.point):
            yield f"point is {self.point!r}; expected three finite numbers"
        yield from direction_faults("direction", self.direction)
        if self.tolerance is not None:
            yield from self.tolerance.faults()
        yield from super().faults()
        if not isinstance(self.on, Feature | None):
            yield f"on is a {type(self.on).__name__}; expected a feature of the part, or None"
        if not isinstance(self.part, Part | None):
            yield f"part is a {type(self.part).__name__}; expected the part of the point, or None"

    def __str__(self) -> str:
        point, along = (", ".join(f"{c:g}" for c in v) for v in (self.point, self.direction))
        kind = "one-sided locator" if self.one_sided else "locator"
        stiffness = "" if self.stiffness is None else f", {self.stiffness:g} N/mm"
        return f"{kind} {self.name}: ({point}) along ({along}), {self.tolerance}{stiffness}"


@dataclass(frozen=True, eq=False, repr=False)
class ThreeTwoOne(Checked):
    """A 3-2-1 scheme on three faces; its six points follow from their geometry.

    A1 and A2 lie on the primary face near the secondary one, `inset` [mm] from its ends, and A3 opposite, half way between
    them. B1 and B2 lie on the secondary face at the same two stations, half way up. C1 is the centre of the tertiary face.
    These are places of the bounding rectangle. Where the face has no material, a point moves to where the support is widest: A1
    to A3 span the largest triangle, B1 and B2 lie farthest apart, C1 is nearest to the centre, all `inset` from every edge.
    """

    primary: Face
    secondary: Face
    tertiary: Face
    inset: float = 0.0

    checks: ClassVar = {"inset": LENGTH_OR_0}

    @property
    def faces(self) -> tuple[Face, Face, Face]:
        return (self.primary, self.secondary, self.tertiary)

    def faults(self) -> Iterator[str]:
        for face in self.faces:
            yield from face.faults()
        yield from super().faults()

    def __str__(self) -> str:
        return f"3-2-1 on {', '.join(str(face) for face in self.faces)}, {self.inset:g} mm inside the edges"


def three_two_one(
    primary: Face | Feature, secondary: Face | Feature, tertiary: Face | Feature, *, inset: float = 0.0
) -> ThreeTwoOne:
    """Return a 3-2-1 locating scheme: three points on `primary`, two on `secondary`, one on `tertiary` (see ThreeTwoOne).

    The points are `inset` mm inside the edges of the faces, by default on the edges:
    `tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5)`.
    """
    return ThreeTwoOne(face_of(primary), face_of(secondary), face_of(tertiary), inset)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Location(Declaration):
    """The location of a part: its locators, their common tolerance, and the part that they are `on` (None: the ground).

    Locators `on` a feature of another part follow it as it shifts and tilts: a cylinder with its axis.

    A `floating` part has fewer than six locators. The directions that they leave open are nominal in the raw state, and contact
    determines them.

    `placing` states how the pose follows from the locators: to "first order" in the deviations, as in the paper; "exact", with
    faces that slide over the locators; or as the "best fit" of any number of locators, as a measuring machine aligns a part.

    In a `station` the located body may be a `joint`, by its name; `part` is then its first part.
    """

    part: Part
    on: Part | Feature | None = None
    tolerance: Tolerance | None = None
    scheme: ThreeTwoOne | tuple[Locator, ...]
    declared_at: str = ""
    floating: bool = False
    station: str = ""
    joint: str = ""
    placing: Placing = "first order"

    checks: ClassVar = {"placing": one_of(PLACINGS)}

    @property
    def noun(self) -> str:  # type: ignore[override]
        """The kind of the located body: a part, or a joint."""
        return "joint" if self.joint else "part"

    @property
    def name(self) -> str:  # type: ignore[override]
        """The name of the located body."""
        return self.joint or self.part.name

    @property
    def parent(self) -> Part | None:
        """The part that the locators are on; None for the ground."""
        return self.on.part if isinstance(self.on, Feature) else self.on

    @property
    def parts(self) -> tuple[Part, ...]:
        """The located part, the part that it is on, and the parts of the faces of the scheme."""
        return (self.part, *([] if self.parent is None else [self.parent]), *self.mentioned)

    @property
    def locators(self) -> tuple[Locator, ...]:
        """The locators of a scheme that states them."""
        return () if isinstance(self.scheme, ThreeTwoOne) else self.scheme

    @property
    def faces(self) -> tuple[Face, ...]:
        """The faces of a 3-2-1 scheme."""
        return self.scheme.faces if isinstance(self.scheme, ThreeTwoOne) else ()

    @property
    def mentioned(self) -> tuple[Part, ...]:
        """The parts of the faces of the scheme, and of their criteria."""
        return tuple(part for face in self.faces for part in face.parts)

    def faults(self) -> Iterator[str]:
        yield from self._faces_faults(self.scheme) if isinstance(self.scheme, ThreeTwoOne) else self._locator_faults()
        yield from super().faults()
        if self.placing in PLACINGS[1:] and (self.floating or self.has_supports):
            yield f'placing="{self.placing}" needs locators that hold both ways; leave floating and one_sided out'
        if self.tolerance is not None:
            yield from (f"locators: {fault}" for fault in self.tolerance.faults())
        if isinstance(self.on, Feature) and self.on not in self.on.part.features:
            yield f'it is on feature "{self.on.name}", which is no feature of part "{self.on.part.name}"; take one of that part'

    def _faces_faults(self, scheme: ThreeTwoOne) -> Iterator[str]:
        yield from scheme.faults()
        for face in self.faces:
            if face.part is not self.part and not self.joint:
                yield f'face {face} belongs to part "{face.part.name}", not to part "{self.part.name}"'
        if self.floating:
            yield "a 3-2-1 scheme leaves nothing open; leave floating out, or give it fewer locators"
        if self.tolerance is None:
            yield "its 3-2-1 scheme has no tolerance; give one to the locate call"

    def _locator_faults(self) -> Iterator[str]:
        scheme, names = self.locators, [locator.name for locator in self.locators]
        for locator in scheme:
            part = locator.part or self.part
            if self.joint and locator.part is None:
                yield f'locator "{locator.name}": it is at no part of joint "{self.joint}"; give part.point(x, y, z)'
            elif not self.joint and part is not self.part:
                yield f'locator "{locator.name}" is at a point of part "{part.name}"'
            if isinstance(locator.on, Feature) and locator.on.part is not part:
                yield f'locator "{locator.name}" is on feature "{locator.on.name}" of part "{locator.on.part.name}"'
            yield from (f'locator "{locator.name}": {fault}' for fault in locator.faults())
            if locator.tolerance is None and self.tolerance is None:
                yield f'locator "{locator.name}" has no tolerance; give one to the locator, or to the locate call'
        yield from text_faults("locator", names)
        yield from repetitions("locator", names)
        two_sided = [locator for locator in scheme if locator.one_sided is False]
        count = "1 locator" if len(scheme) == 1 else f"{len(scheme)} locators"
        if len(scheme) < 6 and not self.floating:
            yield (
                f"it has {count}; a part needs six independent ones (3-2-1, for example), or locate(..., floating=True) "
                "if contact holds it in the other directions"
            )
        elif len(two_sided) > 6 and self.placing != BEST_FIT and self.part.elasticity is None:
            idle = [locator.name for locator in _repeating(two_sided)]
            sufficient = ", ".join(locator.name for locator in two_sided if locator.name not in idle)
            verb = "is" if len(idle) == 1 else "are"
            yield (
                f"it is over-constrained: {len(two_sided)} of its {count} hold it both ways, and {', '.join(idle)} {verb} "
                f"redundant with {sufficient}; make the redundant ones one_sided=True, or leave them out"
            )
        elif self.floating and len(two_sided) == 6:
            yield "it is floating, but six locators hold it both ways; leave floating out, or some of them"

    @property
    def has_supports(self) -> bool:
        return any(locator.one_sided for locator in self.locators)

    def __str__(self) -> str:
        scheme = self.scheme if isinstance(self.scheme, ThreeTwoOne) else f"{len(self.scheme)} locators"
        feature = f"{self.on.name} of " if isinstance(self.on, Feature) else ""
        ground = f"{feature}{self.parent.name}" if self.parent else "the ground"
        floating = (", floating" if self.floating else "") + (f", {self.placing}" if self.placing != FIRST_ORDER else "")
        return f"location of {self.name} on {ground}: {scheme}{floating}" + (f"; {self.tolerance}" if self.tolerance else "")


def _repeating(locators: list[Locator]) -> list[Locator]:
    """Return the locators whose constraint depends linearly on the constraints of earlier locators."""
    points = np.array([locator.point for locator in locators])
    arms = points - points.mean(axis=0)
    arms /= np.abs(arms).max() or 1.0
    directions = np.array([locator.direction for locator in locators])
    rows = np.nan_to_num(np.hstack([directions, np.cross(arms, directions)]))
    ranks = [0, *(int(np.linalg.matrix_rank(rows[: k + 1], tol=1e-6)) for k in range(len(rows)))]
    return [locator for locator, rank, next_rank in zip(locators, ranks, ranks[1:], strict=False) if next_rank == rank]
