"""An assembly from the plain document that an archive keeps of it."""

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.contact_pair import VERTICES, ContactPair
from tolcontact.declaration.contributor import Correlation, Population, Variable
from tolcontact.declaration.criteria import criterion_of
from tolcontact.declaration.feature_tolerance import KINDS, GeometricTolerance, Size
from tolcontact.declaration.force import Force
from tolcontact.declaration.geometry import Box, Mesh
from tolcontact.declaration.locator import Location, Locator, ThreeTwoOne
from tolcontact.declaration.measure import Measure
from tolcontact.declaration.part import Face, Feature, Part, Point
from tolcontact.declaration.said import Said
from tolcontact.declaration.selection import Facing, Inside, Triangles
from tolcontact.declaration.tape import tape_of
from tolcontact.declaration.tolerance import SHAPES, Tolerance, scipy_distribution
from tolcontact.declaration.vectors import DIRECTIONS
from tolcontact.errors import OptionError
from tolcontact.method import Method
from tolcontact.poses import ENTRIES

T = TypeVar("T")
MOST = 2**31  # of triangles, or points
FREEDOMS_OF_FEATURE = 7  # at most, with its size


def from_document(document: Any, meshes: Mapping[str, Any]) -> Assembly:
    """The assembly of a document; `meshes` holds a mesh (anything with vertices and faces, or words for tc.Mesh) for
    each mesh part.

    Raises ArchiveError for a document that `to_document` cannot have made. Nothing in it is run.
    """
    whole, reader = Said(document), _Reader(meshes)
    for said in whole["parts"]:
        new = reader.part(said)
        if new.name in reader.parts:
            raise said["name"].wrong("a name that no other part has")
        reader.parts[new.name] = new
    for said, part in zip(whole["parts"], list(reader.parts.values()), strict=True):
        part.add(*(reader.feature(part, each) for each in said.optional("features")))
    locations = list(map(reader.location, whole["locations"]))
    variables = list(map(reader.variable, whole.optional("variables")))
    assembly = Assembly.of(
        whole["name"].text(),
        _optional(whole["method"], _method_of) if "method" in whole else None,  # which the first format does not have
        parts=reader.parts.values(),
        locations=locations,
        pairs=map(reader.pair, whole["pairs"]),
        measures=map(reader.measure, whole["measures"]),
        forces=map(reader.force, whole["forces"]),
        variables=variables,
        correlations=map(reader.correlation, whole.optional("correlations")),
        populations=map(reader.population, whole.optional("populations")),
    )
    for fault in assembly.faults():  # a model that has any is not archived
        raise whole.refused(fault)
    return assembly


class _Reader:
    """What is said of each thing, as the thing itself. Parts come first: the others refer to them."""

    def __init__(self, meshes: Mapping[str, Any]) -> None:
        self.meshes = meshes
        self.parts: dict[str, Part] = {}
        self.contributors = 0  # at most: those of the things that have been read

    def known(self, said: Said) -> Part:
        if said.text() not in self.parts:
            raise said.wrong("the name of a part")
        return self.parts[said.text()]

    def face(self, said: Said) -> Face:
        if "select" in said:
            return Face(self.known(said["part"]), tuple(criterion_of(each, self.known) for each in said["select"]))
        if "direction" in said:
            chosen: Facing | Triangles = Facing(said["direction"].one_of(DIRECTIONS))
        else:
            chosen = Triangles(tuple(index.index(MOST) for index in said["triangles"]))
        boxes = [[corner.vector() for corner in box.items(2)] for box in said["inside"]]
        return Face(self.known(said["part"]), (chosen, *(Inside(lower, upper) for lower, upper in boxes)))

    def point(self, said: Said) -> Point:
        part = self.known(said["part"])
        on = self.feature_of(part, said["on"]) if "on" in said else None
        if on is not None and "end" in said:
            return Point(part, None, on, said["end"].index(2))
        return Point(part, said["position"].vector(), on)

    def feature_of(self, part: Part, said: Said) -> Feature:
        known = {feature.name: feature for feature in part.features}
        if said.text() not in known:
            raise said.wrong(f'the name of a feature of part "{part.name}"')
        return known[said.text()]

    def feature(self, part: Part, said: Said) -> Feature:
        faces = tuple(map(self.face, said["faces"]))
        tolerances = tuple(map(_of_feature, said["tolerances"]))
        datum = _optional(said["datum"], Said.text)
        self.contributors += FREEDOMS_OF_FEATURE
        return Feature(said["name"].text(), part, faces, tolerances, datum, said["declared_at"].text())

    def variable(self, said: Said) -> Variable:
        drives = {label: factor.number() for label, factor in said["drives"].pairs().items()}
        tolerance = _tolerance_of(said["tolerance"])
        self.contributors += 1
        return Variable(said["name"].text(), tolerance, drives, said["units"].text(), said["declared_at"].text())

    def correlation(self, said: Said) -> Correlation:
        matrix = tuple(tuple(number.number() for number in row) for row in said["matrix"])
        return Correlation(tuple(label.text() for label in said["labels"]), matrix, said["declared_at"].text())

    def population(self, said: Said) -> Population:
        columns = tuple(label.text() for label in said["columns"])
        rows = [[number.number() for number in row.items(len(columns))] for row in said["values"]]
        values = np.array(rows, dtype=float).reshape(len(rows), len(columns))
        return Population(columns, values, said["source"].text(), said["declared_at"].text())

    def locator(self, part: Part, said: Said) -> Locator:
        return Locator(
            said["name"].text(),
            said["point"].vector(),
            said["direction"].vector(),
            _optional(said["tolerance"], _tolerance_of),
            one_sided=said["one_sided"].boolean(),
            stiffness=said["stiffness"].number(),
            on=self.feature_of(part, said["on"]) if "on" in said else None,
        )

    def location(self, said: Said) -> Location:
        scheme: ThreeTwoOne | tuple[Locator, ...]
        if "three_two_one" in said["scheme"]:
            primary, secondary, tertiary = map(self.face, said["scheme"]["three_two_one"].items(3))
            scheme = ThreeTwoOne(primary, secondary, tertiary, said["scheme"]["inset"].number())
        else:
            part = self.known(said["part"])
            scheme = tuple(self.locator(part, each) for each in said["scheme"])
        self.contributors += 6 if isinstance(scheme, ThreeTwoOne) else len(scheme)
        common, on = _optional(said["tolerance"], _tolerance_of), _optional(said["on"], self.known)
        floating = "floating" in said and said["floating"].boolean()
        return Location(self.known(said["part"]), scheme, common, on, said["declared_at"].text(), floating)

    def pair(self, said: Said) -> ContactPair:
        points = said["points"].one_of([VERTICES]) if said["points"].is_text else _optional(said["points"], _count)
        spacing, within = (_optional(said[word], Said.number) for word in ("spacing", "within"))
        sides = self.face(said["moving"]), self.face(said["reference"])
        return ContactPair(said["name"].text(), *sides, points, spacing, within, said["declared_at"].text())

    def measure(self, said: Said) -> Measure:
        of = self.point(said["of"]) if "of" in said else tape_of(said["tape"], ENTRIES * len(self.parts) + self.contributors)
        to = self.point(said["to"]) if "to" in said else None
        along, tolerance = _optional(said["along"], Said.vector), _optional(said["tolerance"], Said.number)
        lower, upper = (_optional(each, Said.number) for each in said["limits"].items(2)) if "limits" in said else (None, None)
        absolute = said["absolute"].boolean() if "absolute" in said else None
        return Measure(
            said["name"].text(), of, to, along, tolerance, said["units"].text(), said["declared_at"].text(),
            (lower, upper) if "limits" in said else None, absolute,
        )  # fmt: skip

    def force(self, said: Said) -> Force:
        return Force(said["name"].text(), self.point(said["at"]), said["vector"].vector(), said["declared_at"].text())

    def part(self, said: Said) -> Part:
        name = said["name"].text()
        if "box" in said["geometry"]:
            geometry: Box | Mesh = Box(*said["geometry"]["box"].vector())
        elif name in self.meshes:
            of = self.meshes[name]
            words = (
                {word: of[word] for word in ("source", "units", "body", "chord") if word in of} if isinstance(of, dict) else {}
            )
            geometry = Mesh(**words) if words else Mesh(of)
        else:
            raise said["name"].wrong("a part with a mesh, or with a box")
        place, fixed = (said["at"].vector(), said["rotation"].vector()), _optional(said["fixed"], Said.boolean)
        return Part(name, geometry, *place, fixed, said["declared_at"].text())


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


def _tolerance_of(said: Said) -> Tolerance:
    off = {word: said[word].number() for word in ("shift", "cp", "cpk") if word in said}
    if "scipy" not in said:
        return Tolerance(said["range"].number(), said["distribution"].one_of(SHAPES), **off)
    return Tolerance(None, _distribution_of(said), **off)


def _of_feature(said: Said) -> Size | GeometricTolerance:
    kind = said["kind"].one_of(["size", *KINDS])
    words: dict[str, Any] = {
        word: value.text() if value.is_text else None if value.is_none else value.number()
        for word, value in said.pairs().items()
        if word not in ("kind", "along", "args", "kwds", "scipy")
    }
    try:
        if kind == "size":
            if "scipy" in said:
                words["distribution"] = _distribution_of(said)
            return Size(**words)
        if "along" in said:
            words["along"] = said["along"].vector()
        return KINDS[kind](**words)
    except TypeError as error:
        raise said.refused(f"{kind}: {error}") from error


def _distribution_of(said: Said) -> Any:
    name, keywords = said["scipy"].text(), said["kwds"].pairs()
    distribution = scipy_distribution(name)
    if distribution is None:
        raise said["scipy"].wrong("a continuous distribution of scipy.stats")
    try:
        return distribution(
            *(argument.number() for argument in said["args"]),
            **{word: value.number() for word, value in keywords.items()},
        )
    except (TypeError, ValueError) as error:  # parameters that it does not have
        raise said.refused(f"scipy.stats.{name}: {error}") from error
