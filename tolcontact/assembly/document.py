"""An assembly as a plain document (dicts, lists, numbers, texts), and back: what an archive keeps of a model."""

import importlib  # scipy.stats takes longer to import than all the rest: only where it is needed
from collections.abc import Callable, Mapping
from typing import Any

from tolcontact.assembly.assembly import Assembly
from tolcontact.assembly.contact import ContactPair
from tolcontact.assembly.force import Force
from tolcontact.assembly.geometry import Box, Mesh
from tolcontact.assembly.locator import Location, Locator, ThreeTwoOne
from tolcontact.assembly.measure import Measure
from tolcontact.assembly.part import Face, Part, Point
from tolcontact.assembly.selection import Facing, Inside, Triangles
from tolcontact.assembly.tolerance import Tolerance

Document = dict[str, Any]


def to_document(
    assembly: Assembly, triangles: Callable[[Face], list[int]], tapes: Mapping[str, tuple[tuple[Any, ...], ...]]
) -> Document:
    """The document of an assembly.

    `triangles` gives the indices of a face that is more than a direction, `tapes` the steps of the users' own expressions.
    Shapes of meshes are not in it; `from_document` wants them beside it.
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
                    {"three_two_one": [face(f) for f in location.scheme.faces], "inset": location.scheme.inset}
                    if isinstance(location.scheme, ThreeTwoOne)
                    else [
                        {
                            **_plain(locator, "name", "point", "direction", "one_sided", "stiffness"),
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


def from_document(document: Document, meshes: Mapping[str, Any]) -> Assembly:
    """The assembly of a document; `meshes` holds a mesh (anything with vertices and faces) for each mesh part."""
    parts: dict[str, Part] = {}

    def face(said: Document) -> Face:
        chosen = Facing(said["direction"]) if "direction" in said else Triangles(tuple(said["triangles"]))
        return Face(parts[said["part"]], (chosen, *(Inside(*corners) for corners in said["inside"])))

    def point(said: Document) -> Point:
        return Point(parts[said["part"]], tuple(said["position"]))

    def location(said: Document) -> Location:
        scheme: ThreeTwoOne | tuple[Locator, ...]
        if isinstance(said["scheme"], dict):
            primary, secondary, tertiary = map(face, said["scheme"]["three_two_one"])
            scheme = ThreeTwoOne(primary, secondary, tertiary, said["scheme"]["inset"])
        else:
            scheme = tuple(
                Locator(
                    one["name"],
                    one["point"],
                    one["direction"],
                    _tolerance_of(one["tolerance"]),
                    one_sided=one["one_sided"],
                    stiffness=one["stiffness"],
                )
                for one in said["scheme"]
            )
        on = None if said["on"] is None else parts[said["on"]]
        return Location(parts[said["part"]], scheme, _tolerance_of(said["tolerance"]), on, said["declared_at"])

    def pair(said: Document) -> ContactPair:
        rest = [said[word] for word in ("points", "spacing", "within", "declared_at")]
        return ContactPair(said["name"], face(said["moving"]), face(said["reference"]), *rest)

    def measure(said: Document) -> Measure:
        of = point(said["of"]) if "of" in said else tuple(tuple(row) for row in said["tape"])
        to = point(said["to"]) if "to" in said else None
        along = None if said["along"] is None else tuple(said["along"])
        rest = [said[word] for word in ("tolerance", "units", "declared_at")]
        return Measure(said["name"], of, to, along, *rest)

    def force(said: Document) -> Force:
        return Force(said["name"], point(said["at"]), tuple(said["vector"]), said["declared_at"])

    for said in document["parts"]:
        geometry = Box(*said["geometry"]["box"]) if "box" in said["geometry"] else Mesh(meshes[said["name"]])
        rest = [said[word] for word in ("fixed", "declared_at")]
        parts[said["name"]] = Part(said["name"], geometry, tuple(said["at"]), tuple(said["rotation"]), *rest)
    return Assembly(
        document["name"],
        parts.values(),
        map(location, document["locations"]),
        map(pair, document["pairs"]),
        map(measure, document["measures"]),
        map(force, document["forces"]),
    )


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


def _tolerance_of(said: Document | None) -> Tolerance | None:
    if said is None:
        return None
    if "scipy" in said:
        return Tolerance(
            distribution=getattr(importlib.import_module("scipy.stats"), said["scipy"])(*said["args"], **said["kwds"])
        )
    return Tolerance(said["range"], said["distribution"])
