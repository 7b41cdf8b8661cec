"""The fit of a fastener in its holes in the nominal assembly, and the faults of what it refers to. Lengths in mm."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tolcontact.declaration import Assembly, Face, Feature, Part, Size, Station
from tolcontact.declaration.values import is_finite, is_length, vector
from tolcontact.errors import GeometryFault
from tolcontact.fasteners.placed_faces import Axis, axis_of, outer_cylinders, placed_cylinder
from tolcontact.features import PlaneFeature
from tolcontact.features.feature_geometry import CylinderFeature
from tolcontact.geometry.tolerances import SQUARE

INTO, SEAT = "into", "seat"  # labels of faces, in addition to "through[0]" and so on
FREE_END = 0.25  # of the diameter: how far a made shank reaches out of the parts
ROUNDING = 1e-6  # of a diameter: what counts as nothing
PRESSED = 1e-3  # of a diameter: distance allowed between the axes of a part and of the hole that it goes into

Holes = Mapping[str, CylinderFeature]  # by their labels, from the head on


@dataclass(frozen=True, eq=False)
class Fit:
    """A shank in its holes.

    seat     the plane under its head; None without a seat
    radius   [mm] of the shank
    reach    stations [mm] of its ends on its axis
    shank    its face; None for a fastener that is to be made
    """

    holes: Holes
    seat: PlaneFeature | None
    axis: Axis
    radius: float
    reach: tuple[float, float]
    shank: Face | None = None

    def faults(self, seat: Face | None) -> Iterator[str]:
        """Yield why the shank does not stand in its holes, or its head on the face of the seat."""
        if self.seat and np.linalg.norm(np.cross(self.seat.normal, self.axis.head)) > SQUARE:
            yield f"{SEAT}: face {seat} is not square to the axis of the holes; expected the plane under the head"
            return
        for label, hole in self.holes.items():
            yield from self._hole_faults(label, hole)

    def _hole_faults(self, label: str, hole: CylinderFeature) -> Iterator[str]:
        clearance, (low, high) = hole.size / 2 - self.radius, self.axis.extent(hole)
        offset = max(self.axis.distance(hole.end(number)) for number in (0, 1))
        limit = PRESSED * 2 * self.radius if label == INTO else clearance
        if label != INTO and clearance < -ROUNDING * self.radius:
            yield (
                f"{label} has a diameter of {hole.size:.6g} mm, and the fastener {2 * self.radius:.6g} mm; expected a "
                "fastener that is not thicker than its hole"
            )
        elif offset > limit + ROUNDING * self.radius:
            yield (
                f"{label}: its axis is {offset:.4g} mm off that of the fastener in the nominal assembly, where at most "
                f"{limit:.4g} mm are possible; move the part, or choose another hole"
            )
        elif min(high, self.reach[1]) - max(low, self.reach[0]) < ROUNDING * self.radius:
            yield f"{label}: the fastener does not reach into this hole; move it, or choose another one"


def made_fit(diameter: float, holes: Holes, seat: PlaneFeature | None) -> Fit:
    """Return the fit of a fastener that is to be made: on the axis of its last hole, with its origin under its head."""
    axis = _axis_of(list(holes.values()), seat)
    extents = {label: axis.extent(hole) for label, hole in holes.items()}
    top = axis.station(seat.centre) if seat else max(high for _, high in extents.values()) + FREE_END * diameter
    bottom = extents[INTO][0] if INTO in extents else min(low for low, _ in extents.values()) - FREE_END * diameter
    return Fit(holes, seat, Axis(axis.at(top), axis.head), diameter / 2, (bottom - top, 0.0))


def part_fit(part: Part, face: Face | None, holes: Holes, seat: PlaneFeature | None) -> Fit:
    """Return the fit of a part whose shank is a face, or the thickest outer cylinder about the middle of the first hole.

    Raises GeometryFault if there is none.
    """
    first, *_ = holes.values()
    if face is not None:
        shank = placed_cylinder(face)
        if shank.is_inner:
            raise GeometryFault(f"face {face} is the wall of a hole; expected the outside of the shank")
    else:
        candidates = [candidate for candidate in outer_cylinders(part) if _reaches(candidate[1], first)]
        if not candidates:
            raise GeometryFault(
                f'no outer cylinder of part "{part.name}" stands in the first hole; move the part there, or give the face of '
                "its shank in place of the part"
            )
        face, shank = candidates[0]
    axis = axis_of(shank, _axis_of(list(holes.values()), seat).head)
    return Fit(holes, seat, axis, shank.size / 2, axis.extent(shank), face)


def _reaches(cylinder: CylinderFeature, hole: CylinderFeature) -> bool:
    """Return whether the middle of a hole lies within a cylinder."""
    axis = axis_of(cylinder, cylinder.axis)
    low, high = axis.extent(cylinder)
    return axis.distance(hole.centre) < cylinder.size / 2 and low < axis.station(hole.centre) < high


def _axis_of(holes: list[CylinderFeature], seat: PlaneFeature | None) -> Axis:
    """Return the axis of the last hole, towards the first one, or out of the seat."""
    first, last = holes[0], holes[-1]
    return axis_of(last, seat.normal if seat else first.centre - last.centre)


def check_types(scene: Any, name: str, fastener: Any, through: Any, into: Any, seat: Any) -> None:
    """Raise TypeError for an argument of a wrong type."""
    kinds: Any = Part | Face | Feature | Size | int | float
    face: Any = Face | Feature
    hole = "the wall of a hole: part.face(tc.select.Cylinder(...)), or a feature"
    arguments = [
        ("the first argument", scene, Assembly | Station, "an assembly, or one of its stations"),
        ("fastener", fastener, kinds, "a diameter in mm, a tc.Size, a part, or the face of its shank"),
        ("through", through, list | tuple, "a list of holes, from the head on"),
        *((f"through[{k}]", item, face, hole) for k, item in enumerate(through if isinstance(through, list | tuple) else ())),
        ("into", into, face | None, f"{hole}, or None"),
        ("seat", seat, face | None, 'the plane under the head: part.face("+z"), or a feature'),
    ]
    for label, value, kind, expected in arguments:
        if not isinstance(value, kind) or isinstance(value, bool):
            raise TypeError(f'fasten "{name}": {label} is a {type(value).__name__}; expected {expected}')


def station_faults(assembly: Assembly, scene: Assembly | Station) -> Iterator[str]:
    """Yield the fault of a fastener of an assembly with stations that belongs to none of them."""
    if assembly.stations and scene is assembly:
        yield f"it belongs to no station; declare it in one: tc.fasten({assembly.stations[0].name}, ...)"


def reference_faults(
    assembly: Assembly, fastener: Part | Size | float, holes: Mapping[str, Face], seat: Face | None, pushed: Any
) -> Iterator[str]:
    """Yield the faults that show before any shape is read."""
    passed = [label for label in holes if label != INTO]
    if not passed:
        yield "through is empty; give the holes that it passes through, from its head on: through=[hole, ...]"
    elif len(holes) < 2:
        yield "it passes through one part, and goes into none; give the hole of a second part, in through or as into"
    owners = {label: face.part for label, face in holes.items()}
    if isinstance(fastener, Part):
        owners["the fastener"] = fastener
    elif isinstance(fastener, Size):
        yield from fastener.faults()
    elif not (is_length(fastener) and fastener > 0):
        yield f"its diameter is {fastener!r}; expected a length in mm above 0"
    yield from _owner_faults(assembly, owners | ({SEAT: seat.part} if seat else {}))
    if seat is not None and not any(seat.part is owners[label] for label in passed):
        yield f'seat is on part "{seat.part.name}", which it does not pass through; choose the face under its head'
    if seat is not None and isinstance(fastener, Part) and INTO in holes:
        yield "seat has no effect on a part that stands in a hole, which holds it; leave it out"
    if pushed is not None:
        yield from _push_faults(assembly, holes, pushed)


def _owner_faults(assembly: Assembly, owners: Mapping[str, Part]) -> Iterator[str]:
    """Yield parts that the assembly does not have, and parts with two holes. `owners` are parts by the labels of faces."""
    earlier: dict[int, str] = {}
    for label, part in owners.items():
        if not any(part is member for member in assembly.parts):
            names = ", ".join(member.name for member in assembly.parts) or "none"
            yield f'{label} is on part "{part.name}", which "{assembly.name}" does not have; its parts are: {names}'
        elif label != SEAT and id(part) in earlier:
            yield f'{earlier[id(part)]} and {label} are of one part, "{part.name}"; expected one hole of each part'
        earlier.setdefault(id(part), label)


def _push_faults(assembly: Assembly, holes: Mapping[str, Face], pushed: Any) -> Iterator[str]:
    force = vector(pushed)
    if not (is_finite(force) and any(force)):
        yield f"pushed is {pushed!r}; expected a force (x, y, z) in N that is not zero"
    elif INTO in holes:
        yield f"pushed has no effect on a fastener that the hole in {INTO} holds; leave it out, or push a part"
    elif assembly.method is not None and not assembly.method.minimizes.presses:
        yield (
            'pushed is a force, which only the objective "seating" uses; state it in the model: '
            'tc.Assembly(..., method=tc.Method(objective="seating")), or leave the method out'
        )
