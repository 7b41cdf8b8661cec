"""Criteria of faces as JSON has them, and back."""

from collections.abc import Callable
from typing import Any

from tolcontact.declaration.part import Face, Part
from tolcontact.declaration.said import Said
from tolcontact.declaration.selection import Brep, Cylinder, Facing, Inside, Largest, Near, Picked, Selection, Triangles
from tolcontact.declaration.vectors import DIRECTIONS

MOST = 2**31  # of triangles


def said_of(selection: Any, face: Face, triangles: Callable[[Face], list[int]]) -> Any:
    """What JSON says of a criterion of a face; `triangles` gives those that a function picks."""
    if isinstance(selection, Facing) and isinstance(selection.direction, str) and selection == Facing(selection.direction):
        return selection.direction
    said: dict[type, Callable[[Any], dict[str, Any]]] = {
        Facing: lambda of: {"facing": list(of.axis), "angle": of.angle},
        Inside: lambda of: {"inside": [list(of.lower), list(of.upper)]},
        Near: lambda of: {"near": of.part.name, "within": of.within},
        Brep: lambda of: {"brep": next(each for each in (of.number, of.name, list(of.at or ())) if each is not None)},
        Cylinder: lambda of: {"cylinder": _given(radius=of.radius, inner=of.inner)},
        Largest: lambda of: {"largest": of.kind, **_given(direction=of.axis and list(of.axis))},
        Triangles: lambda of: {"triangles": [int(index) for index in of.indices]},
        Picked: lambda of: {"triangles": triangles(Face(face.part, (of,)))},
    }
    return said[type(selection)](selection)


def _given(**words: Any) -> dict[str, Any]:
    return {word: value for word, value in words.items() if value is not None}


def criterion_of(said: Said, part: Callable[[Said], Part]) -> Selection:
    """The criterion that JSON means; `part` gives those that it names."""
    if said.is_text:
        return Facing(said.one_of(DIRECTIONS))
    kinds: dict[str, Callable[[Said], Selection]] = {
        "facing": lambda of: Facing(of["facing"].vector(), *(of[word].number() for word in ("angle",) if word in of)),
        "inside": lambda of: Inside(*(corner.vector() for corner in of["inside"].items(2))),
        "near": lambda of: Near(part(of["near"]), of["within"].number()),
        "brep": lambda of: Brep(_which(of["brep"])),
        "cylinder": lambda of: _cylinder(of["cylinder"]),
        "largest": lambda of: Largest(of["largest"].text(), *(_way(of[word]) for word in ("direction",) if word in of)),
        "triangles": lambda of: Triangles(tuple(index.index(MOST) for index in of["triangles"])),
    }
    for kind, read in kinds.items():
        if kind in said:
            return read(said)
    raise said.wrong(f"one of {', '.join(kinds)}")


def _which(said: Said) -> Any:
    return said.vector() if said.is_list else said.text() if said.is_text else said.index(MOST)


def _cylinder(said: Said) -> Cylinder:
    radius = said["radius"].number() if "radius" in said else None
    return Cylinder(radius, said["inner"].boolean() if "inner" in said else None)


def _way(said: Said) -> Any:
    return said.text() if said.is_text else said.vector()
