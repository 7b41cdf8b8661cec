"""An assembly as a plain document (dicts, lists, numbers, texts), and back: what an archive keeps of a model."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, TypeVar

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.contact_pair import VERTICES, ContactPair
from tolcontact.declaration.force import Force
from tolcontact.declaration.geometry import Box, Mesh
from tolcontact.declaration.locator import Location, Locator, ThreeTwoOne
from tolcontact.declaration.measure import Measure
from tolcontact.declaration.part import Face, Part, Point
from tolcontact.declaration.said import Said
from tolcontact.declaration.selection import Facing, Inside, Triangles
from tolcontact.declaration.tape import Tape, tape_of
from tolcontact.declaration.tolerance import SHAPES, Tolerance, scipy_distribution
from tolcontact.declaration.vectors import DIRECTIONS
from tolcontact.errors import OptionError
from tolcontact.method import Method

Document = dict[str, Any]
T = TypeVar("T")
MOST = 2**31  # of triangles, or points


def to_document(assembly: Assembly, triangles: Callable[[Face], list[int]], tapes: Mapping[str, Tape]) -> Document:
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


def from_document(document: Any, meshes: Mapping[str, Any]) -> Assembly:
    """The assembly of a document; `meshes` holds a mesh (anything with vertices and faces) for each mesh part.

    Raises ArchiveError for a document that `to_document` cannot have made. Nothing in it is run.
    """
    whole = Said(document)
    parts: dict[str, Part] = {}

    def known(said: Said) -> Part:
        if said.text() not in parts:
            raise said.wrong("the name of a part")
        return parts[said.text()]

    def face(said: Said) -> Face:
        if "direction" in said:
            chosen: Facing | Triangles = Facing(said["direction"].one_of(DIRECTIONS))
        else:
            chosen = Triangles(tuple(index.index(MOST) for index in said["triangles"]))
        boxes = [[corner.vector() for corner in box.items(2)] for box in said["inside"]]
        return Face(known(said["part"]), (chosen, *(Inside(lower, upper) for lower, upper in boxes)))

    def point(said: Said) -> Point:
        return Point(known(said["part"]), said["position"].vector())

    def locator(said: Said) -> Locator:
        return Locator(
            said["name"].text(),
            said["point"].vector(),
            said["direction"].vector(),
            _optional(said["tolerance"], _tolerance_of),
            one_sided=said["one_sided"].boolean(),
            stiffness=said["stiffness"].number(),
        )

    def location(said: Said) -> Location:
        scheme: ThreeTwoOne | tuple[Locator, ...]
        if "three_two_one" in said["scheme"]:
            primary, secondary, tertiary = map(face, said["scheme"]["three_two_one"].items(3))
            scheme = ThreeTwoOne(primary, secondary, tertiary, said["scheme"]["inset"].number())
        else:
            scheme = tuple(map(locator, said["scheme"]))
        common, on = _optional(said["tolerance"], _tolerance_of), _optional(said["on"], known)
        return Location(known(said["part"]), scheme, common, on, said["declared_at"].text())

    def pair(said: Said) -> ContactPair:
        points = said["points"].one_of([VERTICES]) if said["points"].is_text else _optional(said["points"], _count)
        spacing, within = (_optional(said[word], Said.number) for word in ("spacing", "within"))
        sides = face(said["moving"]), face(said["reference"])
        return ContactPair(said["name"].text(), *sides, points, spacing, within, said["declared_at"].text())

    def measure(said: Said) -> Measure:
        of = point(said["of"]) if "of" in said else tape_of(said["tape"], len(parts))
        to = point(said["to"]) if "to" in said else None
        along, tolerance = _optional(said["along"], Said.vector), _optional(said["tolerance"], Said.number)
        return Measure(said["name"].text(), of, to, along, tolerance, said["units"].text(), said["declared_at"].text())

    def force(said: Said) -> Force:
        return Force(said["name"].text(), point(said["at"]), said["vector"].vector(), said["declared_at"].text())

    def part(said: Said) -> Part:
        name = said["name"].text()
        if "box" in said["geometry"]:
            geometry: Box | Mesh = Box(*said["geometry"]["box"].vector())
        elif name in meshes:
            geometry = Mesh(meshes[name])
        else:
            raise said["name"].wrong("a part with a mesh, or with a box")
        place, fixed = (said["at"].vector(), said["rotation"].vector()), _optional(said["fixed"], Said.boolean)
        return Part(name, geometry, *place, fixed, said["declared_at"].text())

    for said in whole["parts"]:
        new = part(said)
        if new.name in parts:
            raise said["name"].wrong("a name that no other part has")
        parts[new.name] = new
    assembly = Assembly.of(
        whole["name"].text(),
        _optional(whole["method"], _method_of) if "method" in whole else None,  # which the first format does not have
        parts=parts.values(),
        locations=map(location, whole["locations"]),
        pairs=map(pair, whole["pairs"]),
        measures=map(measure, whole["measures"]),
        forces=map(force, whole["forces"]),
    )
    for fault in assembly.faults():  # a model that has any is not archived
        raise whole.refused(fault)
    return assembly


def _optional(said: Said, read: Callable[[Said], T]) -> T | None:
    return None if said.is_none else read(said)


def _method_of(said: Said) -> Method:
    choices = {word: value.text() if value.is_text else value.number() for word, value in said.pairs().items()}
    try:
        return Method(**choices)  # type: ignore[arg-type]
    except (OptionError, TypeError) as error:
        raise said.refused(str(error)) from error


def _count(said: Said) -> int:
    return said.index(MOST)


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


def _tolerance_of(said: Said) -> Tolerance:
    if "scipy" not in said:
        return Tolerance(said["range"].number(), said["distribution"].one_of(SHAPES))
    name, keywords = said["scipy"].text(), said["kwds"].pairs()
    distribution = scipy_distribution(name)
    if distribution is None:
        raise said["scipy"].wrong("a continuous distribution of scipy.stats")
    try:
        return Tolerance(
            distribution=distribution(
                *(argument.number() for argument in said["args"]),
                **{word: value.number() for word, value in keywords.items()},
            )
        )
    except (TypeError, ValueError) as error:  # parameters that it does not have
        raise said.refused(f"scipy.stats.{name}: {error}") from error
