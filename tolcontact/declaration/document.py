"""An assembly as a plain document (dicts, lists, numbers, texts): what an archive keeps of a model."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, TypeVar

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.geometry import Box, Mesh
from tolcontact.declaration.locator import ThreeTwoOne
from tolcontact.declaration.measure import Measure
from tolcontact.declaration.part import Face, Point
from tolcontact.declaration.selection import Facing, Inside
from tolcontact.declaration.tape import Tape
from tolcontact.declaration.tolerance import Tolerance

Document = dict[str, Any]
T = TypeVar("T")
MOST = 2**31  # of triangles, or points


def to_document(assembly: Assembly, triangles: Callable[[Face], list[int]], tapes: Mapping[str, Tape]) -> Document:
    """The document of an assembly.

    `triangles` gives the indices of a face that is more than a direction, `tapes` the steps of the users' own expressions.
    Shapes of meshes are not in it; `from_document` (see rebuilding) wants them beside it.
    """

    def face(face: Face) -> Document:
        boxes = [[s.lower, s.upper] for s in face.selections if isinstance(s, Inside)]
        rest = [s for s in face.selections if not isinstance(s, Inside)]
        only = rest[0] if len(rest) == 1 else None
        plain = isinstance(only, Facing) and isinstance(only.direction, str) and only == Facing(only.direction)
        chosen = {"direction": str(only)} if plain else {"triangles": triangles(face)}
        return {"part": face.part.name, **chosen, "inside": boxes}

    def measure(measure: Measure) -> Document:
        points = {"of": _point(measure.of)} if isinstance(measure.of, Point) else {"tape": tapes[measure.name]}
        to = {} if measure.to is None else {"to": _point(measure.to)}
        return {"name": measure.name, **points, **to, **_plain(measure, "along", "tolerance", "units", "declared_at")}

    return {
        "name": assembly.name,
        "method": None if assembly.method is None else asdict(assembly.method),
        "parts": [
            {"geometry": _geometry(part.geometry), **_plain(part, "name", "at", "rotation", "fixed", "declared_at")}
            for part in assembly.parts
        ],
        "locations": [
            {
                "part": location.part.name,
                "on": location.on.name if location.on else None,
                "tolerance": _tolerance(location.tolerance),
                "scheme": (
                    {"three_two_one": [face(f) for f in location.scheme.faces], "inset": float(location.scheme.inset)}
                    if isinstance(location.scheme, ThreeTwoOne)
                    else [
                        {
                            **_plain(locator, "name", "point", "direction", "one_sided"),
                            "stiffness": float(locator.stiffness),
                            "tolerance": _tolerance(locator.tolerance),
                        }
                        for locator in location.scheme
                    ]
                ),
                "declared_at": location.declared_at,
            }
            for location in assembly.locations
        ],
        "pairs": [
            {
                "moving": face(pair.moving),
                "reference": face(pair.reference),
                **_plain(pair, "name", "points", "spacing", "within", "declared_at"),
            }
            for pair in assembly.pairs
        ],
        "measures": [measure(m) for m in assembly.measures],
        "forces": [{"at": _point(f.at), **_plain(f, "name", "vector", "declared_at")} for f in assembly.forces],
    }


def _plain(thing: Any, *words: str) -> Document:
    return {word: getattr(thing, word) for word in words}


def _point(point: Point) -> Document:
    return {"part": point.part.name, "position": point.position}


def _geometry(geometry: Box | Mesh) -> Document:
    return {"box": [geometry.x, geometry.y, geometry.z]} if isinstance(geometry, Box) else {"mesh": str(geometry)}


def _tolerance(tolerance: Tolerance | None) -> Document | None:
    if tolerance is None:
        return None
    if isinstance(tolerance.distribution, str):
        return {"range": tolerance.range, "distribution": tolerance.distribution}
    frozen = tolerance.distribution
    return {
        "scipy": frozen.dist.name,
        "args": [float(a) for a in frozen.args],
        "kwds": {k: float(v) for k, v in frozen.kwds.items()},
    }
