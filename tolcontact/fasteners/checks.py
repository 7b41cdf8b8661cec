"""Faults of what a fastener refers to."""

from collections.abc import Iterator, Mapping
from typing import Any

from tolcontact.declaration import Assembly, Face, Feature, Part, Size, Station
from tolcontact.declaration.values import is_finite, is_length, vector
from tolcontact.fasteners.fit import INTO, SEAT


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
    elif assembly.method is None or assembly.method.objective != "seating":
        yield (
            'pushed is a force, which only the objective "seating" uses; state it in the model: '
            'tc.Assembly(..., method=tc.Method(objective="seating"))'
        )
