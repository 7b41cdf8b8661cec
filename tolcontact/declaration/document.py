"""An assembly as a plain document (dicts, lists, numbers, texts): what an archive keeps of a model."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from typing import Any, TypeVar

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.feature_tolerance import GeometricTolerance, Size
from tolcontact.declaration.geometry import Box
from tolcontact.declaration.locator import ThreeTwoOne
from tolcontact.declaration.measure import Measure
from tolcontact.declaration.part import Face, Feature, Part, Point
from tolcontact.declaration.selection import Facing, Inside
from tolcontact.declaration.tape import Tape
from tolcontact.declaration.tolerance import Tolerance

Document = dict[str, Any]
T = TypeVar("T")
MOST = 2**31  # of triangles, or points


def plain_faces(triangles: Callable[[Face], list[int]]) -> Callable[[Face], Document]:
    """How an archive has faces: `triangles` gives the indices of one that is more than a direction."""

    def face(face: Face) -> Document:
        boxes = [[s.lower, s.upper] for s in face.selections if isinstance(s, Inside)]
        rest = [s for s in face.selections if not isinstance(s, Inside)]
        only = rest[0] if len(rest) == 1 else None
        plain = isinstance(only, Facing) and isinstance(only.direction, str) and only == Facing(only.direction)
        chosen = {"direction": str(only)} if plain else {"triangles": triangles(face)}
        return {"part": face.part.name, **chosen, "inside": boxes}

    return face


def plain_geometry(part: Part) -> Document:
    """How an archive has shapes: those of meshes are beside the document."""
    shape = part.geometry
    return {"box": [shape.x, shape.y, shape.z]} if isinstance(shape, Box) else {"mesh": str(shape)}


def to_document(
    assembly: Assembly,
    face: Callable[[Face], Document],
    tapes: Mapping[str, Tape],
    geometry: Callable[[Part], Document] = plain_geometry,
) -> Document:
    """The document of an assembly, with faces and shapes as `face` and `geometry` have them.

    `tapes` are the steps of the users' own expressions.
    """

    def feature(feature: Feature) -> Document:
        return {
            "faces": [face(each) for each in feature.faces],
            "tolerances": [_of_feature(each) for each in feature.tolerances],
            **_plain(feature, "name", "datum", "declared_at"),
        }

    def measure(measure: Measure) -> Document:
        points = {"of": _point(measure.of)} if isinstance(measure.of, Point) else {"tape": tapes[measure.name]}
        to = {} if measure.to is None else {"to": _point(measure.to)}
        said: Document = {} if measure.absolute is None else {"absolute": measure.absolute}
        if measure.limits is not None:
            said["limits"] = [None if limit is None else float(limit) for limit in measure.limits]
        return {"name": measure.name, **points, **to, **_plain(measure, "along", "tolerance", "units", "declared_at"), **said}

    return {
        "name": assembly.name,
        "method": None if assembly.method is None else asdict(assembly.method),
        "parts": [
            {
                "geometry": geometry(part),
                **_plain(part, "name", "at", "rotation", "fixed", "declared_at"),
                "features": [feature(each) for each in part.features],
            }
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
                            **({} if locator.on is None else {"on": locator.on.name}),
                        }
                        for locator in location.scheme
                    ]
                ),
                "declared_at": location.declared_at,
                **({"floating": True} if location.floating else {}),
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
        "variables": [
            {
                "tolerance": _tolerance(each.tolerance),
                "drives": {label: float(factor) for label, factor in each.drives.items()},
                **_plain(each, "name", "units", "declared_at"),
            }
            for each in assembly.variables
        ],
        "correlations": [_plain(each, "labels", "matrix", "declared_at") for each in assembly.correlations],
        "populations": [
            {"values": each.values.tolist(), **_plain(each, "columns", "source", "declared_at")}
            for each in assembly.populations
        ],
    }


def _plain(thing: Any, *words: str) -> Document:
    return {word: getattr(thing, word) for word in words}


def _point(point: Point) -> Document:
    on = {} if point.on is None else {"on": point.on.name}
    return {"part": point.part.name, **on, **({"end": point.end} if point.position is None else {"position": point.position})}


def _tolerance(tolerance: Tolerance | None) -> Document | None:
    if tolerance is None:
        return None
    off = {word: float(value) for word in ("shift", "cp", "cpk") if (value := getattr(tolerance, word))}
    if isinstance(tolerance.distribution, str):
        return {"range": tolerance.range, **_distribution(tolerance.distribution), **off}
    return _distribution(tolerance.distribution) | off


def _distribution(distribution: Any) -> Document:
    if isinstance(distribution, str):
        return {"distribution": distribution}
    return {
        "scipy": distribution.dist.name,
        "args": [float(a) for a in distribution.args],
        "kwds": {k: float(v) for k, v in distribution.kwds.items()},
    }


def _of_feature(tolerance: Size | GeometricTolerance) -> Document:
    """A tolerance of a feature: its kind, and what it does not have by default."""
    said = {each.name: getattr(tolerance, each.name) for each in fields(tolerance) if each.name != "distribution"}
    if isinstance(tolerance, Size):
        return {"kind": "size", **said, **_distribution(tolerance.distribution)}
    defaults = {each.name: each.default for each in fields(tolerance)}
    said["along"] = tolerance.across
    return {"kind": tolerance.kind} | {word: value for word, value in said.items() if value != defaults[word]}
