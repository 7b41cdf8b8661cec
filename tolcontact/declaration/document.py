"""The document of an assembly, as an archive stores it and as a JSON model states it.

An archive differs in three ways: its faces are triangles, its meshes stand beside the document, and it states all defaults.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any

import msgspec
from msgspec import UNSET, Meta, UnsetType

from tolcontact.declaration.assembly import MAX_COUNTS, Assembly
from tolcontact.declaration.codec import CODECS, Choice, DocumentRecord, Inline, Items, Optional, Plain
from tolcontact.declaration.contact_pair import VERTICES, ContactPair, Force
from tolcontact.declaration.dependence import Correlation, Population, Variable
from tolcontact.declaration.face_entry import (
    FLOAT,
    FREE_DIRECTION,
    INDEX,
    MEASURED,
    NOT_NEGATIVE,
    POSITIVE,
    UNIT_VECTOR,
    Document,
    Wrapped,
    Writing,
    feature_named,
    floats,
    indices_of,
    text_type,
)
from tolcontact.declaration.feature_tolerance import KINDS, MATERIALS, RULES, ZONES, GeometricTolerance, ToleranceKind
from tolcontact.declaration.form import COVARIANCES, Form
from tolcontact.declaration.geometry import UNITS, Box, Mesh, Pin
from tolcontact.declaration.joint import Joint, Overlap
from tolcontact.declaration.locator import PLACINGS, USUAL_STIFFNESS, Location, Locator, ThreeTwoOne
from tolcontact.declaration.measure import Measure, Tape, tape_of
from tolcontact.declaration.measurement import Measurement
from tolcontact.declaration.part import ASSOCIATIONS, DatumTargets, Face, Feature, Part, Pattern, Point
from tolcontact.declaration.place import EntryError, Place, Sources
from tolcontact.declaration.size import MOVES, Size
from tolcontact.declaration.station import Station
from tolcontact.declaration.title_block import TitleBlock
from tolcontact.declaration.tolerance import SHAPES, Tolerance, scipy_distribution
from tolcontact.errors import ArchiveError
from tolcontact.method import ACTIVE_SETS, OBJECTIVES, REGULARIZATIONS, RESOLUTIONS, SEARCHES, Method
from tolcontact.poses import ENTRIES

MAX_FREEDOMS = 7  # of a feature, with its size
# Lists that a document leaves out if there is none of what they go with.
GOES_WITH = {"stations": "stations", "joints": "stations", "overlaps": "overlaps"}


class Shape(Choice):
    """Shapes of parts. Meshes are files of a JSON model; an archive has them beside the document, by the names of parts."""

    def encode(self, value: Any, writing: Writing) -> Any:
        return {"mesh": str(value)} if isinstance(value, Mesh) and writing.folder is None else super().encode(value, writing)


def _mesh(place: Place) -> Mesh:
    """Return the mesh that an archive has beside the document."""
    if place.record.name not in place.sources.meshes:
        raise place.error("expected that of a part with a mesh, or with a box")
    return Mesh(place.sources.meshes[place.record.name])


def _file_name(source: Any, writing: Writing) -> str:
    path, folder = Path(source).resolve(), writing.folder or Path()
    return (path.relative_to(folder) if path.is_relative_to(folder) else path).as_posix()


def _file(name: str, place: Place) -> Path:
    if place.sources.folder is None:
        raise place.error("an archive names no files; expected that of a part with a mesh, or with a box")
    return place.sources.folder / name


def _ground_entries(location: Location, writing: Writing) -> Document:
    feature = {"on_feature": location.on.name} if isinstance(location.on, Feature) else {}
    return {"on": location.parent and location.parent.name, **feature}


def _ground(entries: Mapping[str, Any], place: Place) -> Part | Feature | None:
    """Return the part that locators are on, or the feature of it; None for the ground."""
    part = Optional(CODECS[Part]).decode(entries.get("on"), place["on"])
    if "on_feature" not in entries:
        return part  # type: ignore[no-any-return]
    if part is None:
        raise place["on_feature"].error('it goes with "on", the part of the feature; give both')
    return feature_named(entries["on_feature"], replace(place["on_feature"], part=part))


def _stiffness_entries(locator: Locator, writing: Writing) -> Document:
    """Return the stiffness, by default the usual one: a support that gives way, and a declared usual one, have a mark."""
    if locator.stiffness is None:
        return {"stiffness": USUAL_STIFFNESS}
    mark = {"springy": True} if locator.one_sided or locator.stiffness == USUAL_STIFFNESS else {}
    return {"stiffness": float(locator.stiffness), **mark}


def _stiffness(entries: Mapping[str, Any], place: Place) -> float | None:
    """Return a declared stiffness; None for the usual one without a mark."""
    stiffness = entries.get("stiffness", USUAL_STIFFNESS)
    return stiffness if entries.get("springy") or stiffness != USUAL_STIFFNESS else None


def _distribution_entries(thing: Any, writing: Writing) -> Document:
    if isinstance(thing.distribution, str):
        return {"distribution": thing.distribution}
    frozen = thing.distribution
    return {"scipy": frozen.dist.name, "args": floats(tuple(frozen.args), writing), "kwds": floats(frozen.kwds, writing)}


def _distribution(entries: Mapping[str, Any], place: Place) -> Any:
    """Return the name of a distribution, or a frozen distribution of scipy.stats."""
    if "scipy" not in entries:
        for key in {"args", "kwds"} & set(entries):
            raise place[key].error('it goes with "scipy"; leave it out')
        return entries.get("distribution", UNSET)
    if "distribution" in entries:
        raise place["distribution"].error('it is given beside "scipy"; leave one of them out')
    name, family = entries["scipy"], scipy_distribution(entries["scipy"])
    if family is None:
        raise place["scipy"].mismatch("a continuous distribution of scipy.stats", name)
    positional = ARGUMENTS.decode(entries.get("args", []), place["args"])
    keywords = KEYWORDS.decode(entries.get("kwds", {}), place["kwds"])
    try:
        return family(*positional, **keywords)
    except (TypeError, ValueError) as error:  # unknown parameters
        raise place.error(f"scipy.stats.{name}: {error}") from error


def _measured_entries(measure: Measure, writing: Writing) -> Document:
    if measure.is_expression:
        return {"tape": writing.tapes[measure.name]}
    return {"of": MEASURED.encode(measure.of, writing)}


def _measured(entries: Mapping[str, Any], place: Place) -> Point | Measurement | Tape:
    if len(entries) != 1:
        raise place.error('expected either "of", a point or a measurement, or "tape", the steps of an expression')
    if "of" in entries:
        return MEASURED.decode(entries["of"], place["of"])  # type: ignore[no-any-return]
    return tape_of(entries["tape"], place["tape"])


class ToleranceRecord(DocumentRecord):
    """Geometric tolerances of one kind."""

    def holds(self, value: Any) -> bool:
        return isinstance(value, GeometricTolerance) and value.kind == self.kind


def _tolerance_record(kind: ToleranceKind) -> ToleranceRecord:
    """Return the record of a kind of tolerances: their width, and all fields that differ from their defaults."""
    keys = ["width", *(f"{member.name}?" for member in fields(GeometricTolerance) if member.name not in ("of", "width"))]
    return ToleranceRecord(
        GeometricTolerance, " ".join(keys), kind=kind.kind, name=kind.name, build=kind, width=Plain(NOT_NEGATIVE),
        zone=Plain(text_type(ZONES) | None), along=Optional(FREE_DIRECTION),
        material=Plain(text_type(MATERIALS)), rule=Plain(text_type(RULES)),
    )  # fmt: skip


ARGUMENTS, KEYWORDS = Plain(tuple[float, ...]), Plain(Mapping[str, float])
DISTRIBUTION = Inline(
    {"distribution": text_type(SHAPES), "scipy": str, "args": ARGUMENTS.wire, "kwds": KEYWORDS.wire},
    _distribution_entries,
    _distribution,
)
ZONE = DocumentRecord(
    Tolerance, "range? distribution shift? cp? cpk?", name="Zone", range=Plain(NOT_NEGATIVE | str | None), shift=FLOAT,
    distribution=DISTRIBUTION, cp=Plain(POSITIVE | None, write=floats), cpk=Plain(float | None, write=floats),
)  # fmt: skip
WIDTH = Plain(NOT_NEGATIVE | str, read=lambda width, place: place.checked(Tolerance(width)))
CODECS[Tolerance] = Choice("Tolerance", "a width in mm, a text such as '±0.1', or named values", ZONE, WIDTH)
SIZE = DocumentRecord(
    Size, "nominal upper lower cp cpk moves distribution tolerance_class?", kind="size", nominal=Plain(POSITIVE),
    upper=Plain(float | str), lower=Plain(float | None), moves=Plain(text_type(MOVES)), distribution=DISTRIBUTION,
)  # fmt: skip
CODECS[Form] = DocumentRecord(Form, "covariance? length? modes? lobes? measured?", covariance=Plain(text_type(COVARIANCES)))
CONTROL = Choice(
    "FeatureTolerance", f"kind: one of {', '.join(['size', *KINDS])}", SIZE, *map(_tolerance_record, KINDS.values())
)
FEATURE = DocumentRecord(
    Feature, "faces tolerances name datum association? declared_at",
    tolerances=Items(CONTROL), association=Plain(text_type(ASSOCIATIONS)),
)  # fmt: skip
MEMBER = Choice("Member", "a list of faces, or the name of a feature", Items(CODECS[Face]), CODECS[Feature])
PATTERN = DocumentRecord(
    Pattern, "members=constituents tolerances name datum declared_at", mark="members", members=Items(MEMBER),
    tolerances=Items(CONTROL),
)  # fmt: skip
TARGETS = DocumentRecord(DatumTargets, "datum=letter targets=points declared_at", name="DatumTargets")
TOLERANCED = Choice("Toleranced", "a feature, or a pattern with members", PATTERN, FEATURE)
SHAPE = Shape(
    "Shape",
    "a box, a pin, or a file",
    DocumentRecord(Box, "box=x+y+z", mark="box"),
    DocumentRecord(Pin, "pin=diameter+length head?", mark="pin"),
    DocumentRecord(
        Mesh, "file=source units? body? chord?", mark="file", units=Plain(text_type(UNITS) | None),
        chord=Plain(POSITIVE | None), file=Plain(Annotated[str, Meta(description="path, from the folder of this file")],
        _file_name, _file),
    ),
    Wrapped("mesh", Plain(str, read=lambda text, place: _mesh(place))),
)  # fmt: skip
STIFFNESS = Inline({"stiffness": POSITIVE, "springy": bool}, _stiffness_entries, _stiffness)
LOCATOR = DocumentRecord(
    Locator, "name point direction one_sided stiffness tolerance part? on?",
    direction=UNIT_VECTOR, stiffness=STIFFNESS,
)  # fmt: skip
SCHEME = Choice(
    "Scheme",
    "a list of locators, or a 3-2-1 scheme",
    Items(LOCATOR),
    DocumentRecord(ThreeTwoOne, "three_two_one=primary+secondary+tertiary inset", inset=Plain(NOT_NEGATIVE, write=floats)),
)
METHOD = DocumentRecord(
    Method, " ".join(member.name for member in fields(Method)),
    resolution=Plain(text_type(RESOLUTIONS)),
    objective=Plain(text_type(OBJECTIVES)), regularization=Plain(text_type(REGULARIZATIONS)),
    active_set=Plain(text_type(ACTIVE_SETS)),
    search=Plain(text_type(SEARCHES)),
)  # fmt: skip
TITLE_BLOCK = DocumentRecord(TitleBlock, " ".join(f"{name}?" for name in TitleBlock().entries))
GROUND = Inline({"on": str | None, "on_feature": str}, _ground_entries, _ground)
# A part is read without its features, whose faces may refer to all parts.
FEATURES = Inline(
    {"features": Items(TOLERANCED).wire, "datum_targets": Items(TARGETS).wire},
    lambda part, writing: (
        {"features": [TOLERANCED.encode(declared, writing) for declared in part.toleranced]}
        | ({"datum_targets": Items(TARGETS).encode(part.targets, writing)} if part.targets else {})
    ),
    lambda entries, place: UNSET,
)
RECORDS = {
    "parts": DocumentRecord(Part, "geometry name at rotation fixed declared_at features", geometry=SHAPE, features=FEATURES),
    "locations": DocumentRecord(
        Location, "part on tolerance scheme declared_at floating? station? joint? placing?",
        scheme=SCHEME, on=GROUND, placing=Plain(text_type(PLACINGS)),
    ),
    "pairs": DocumentRecord(
        ContactPair, "moving reference name points spacing within declared_at mu? station? stiffness?",
        points=Plain(INDEX | text_type([VERTICES]) | None, read=indices_of),
        spacing=Plain(POSITIVE | None), within=Plain(POSITIVE | None), mu=Plain(NOT_NEGATIVE | None, write=floats),
        stiffness=Plain(POSITIVE | None, write=floats),
    ),
    "measures": DocumentRecord(
        Measure, "name of to? along tolerance units declared_at absolute? limits? station?", of=Inline(
            {"of": MEASURED.wire, "tape": Annotated[list[list[str | int | float]], Meta(description="steps of an expression")]},
            _measured_entries, _measured,
        ), along=Optional(UNIT_VECTOR), tolerance=Plain(POSITIVE | tuple[float, float] | str | None),
        limits=Plain(tuple[float | None, float | None] | None, write=floats),
    ),
    "forces": DocumentRecord(Force, "at name vector declared_at station?"),
    "variables": DocumentRecord(
        Variable, "tolerance drives name units declared_at", drives=Plain(Mapping[str, float], write=floats)
    ),
    "correlations": DocumentRecord(Correlation, "labels matrix declared_at"),
    "populations": DocumentRecord(Population, "values columns source declared_at"),
    "stations": DocumentRecord(Station, "name declared_at"),
    "joints": DocumentRecord(Joint, "name members station declared_at"),
    "overlaps": DocumentRecord(Overlap, "parts declared_at"),
}  # fmt: skip
DOCUMENT = msgspec.defstruct("Document", [
    ("name", str), ("parts", Items(RECORDS["parts"]).wire), ("measures", Items(RECORDS["measures"]).wire),
    ("schema", str | UnsetType, UNSET), ("method", METHOD.wire | None, None),
    ("title_block", TITLE_BLOCK.wire | None, None), ("mu", NOT_NEGATIVE | None, None),
    *((name, Items(record).wire, []) for name, record in RECORDS.items() if name not in ("parts", "measures")),
], forbid_unknown_fields=True, rename={"schema": "$schema"})  # fmt: skip


def to_document(
    assembly: Assembly, triangles: Callable[[Face], list[int]], tapes: Mapping[str, Tape], folder: Path | None = None
) -> Document:
    """Return the document of an assembly, for an archive, or for a JSON model in a folder (see Writing)."""
    writing = Writing(triangles, tapes, folder)
    lists = {
        name: [record.encode(thing, writing) for thing in getattr(assembly, name)]
        for name, record in RECORDS.items()
        if name not in GOES_WITH or getattr(assembly, GOES_WITH[name])
    }
    titles = {} if assembly.title_block is None else {"title_block": TITLE_BLOCK.encode(assembly.title_block, writing)}
    friction = {} if assembly.mu is None else {"mu": float(assembly.mu)}
    return {"name": assembly.name, "method": Optional(METHOD).encode(assembly.method, writing), **titles, **friction, **lists}


def tolerance_of_entry(entry: Any) -> Size | GeometricTolerance:
    """Return a tolerance of a feature from its entry in a document. Raises ArchiveError for an entry that states none."""
    try:
        return CONTROL.decode(entry, Place(Sources({})))  # type: ignore[no-any-return]
    except EntryError as error:
        raise ArchiveError(f"the declared model in the archive is damaged: {error}") from error


def from_document(document: Any, meshes: Mapping[str, Any]) -> Assembly:
    """Return the assembly of an archive's document; `meshes` holds a mesh (vertices and faces) for each mesh part.

    Raises ArchiveError for a document that `to_document` cannot have written. No code in it is run.
    """
    try:
        return assembly_of(document, Sources(meshes))
    except EntryError as error:
        raise ArchiveError(f"the declared model in the archive is damaged: {error}") from error


def assembly_of(document: Any, sources: Sources) -> Assembly:
    """Return the assembly of a document. Raises EntryError, which states the place of the first fault."""
    place = Place(sources)
    struct = place.converted(document, DOCUMENT)
    for name, most in MAX_COUNTS.items():  # before all of them are read
        if (count := len(getattr(struct, name))) > most:
            raise place[name].error(f"it has {count} entries; expected at most {most}")
    for k, entry in enumerate(struct.parts):
        part = RECORDS["parts"].decode(entry, place["parts"][k])
        if part.name in sources.parts:
            raise place["parts"][k]["name"].mismatch("a name that no other part has", part.name)
        sources.parts[part.name] = part
    parts = list(sources.parts.values())
    for k, (part, entry) in enumerate(zip(parts, struct.parts, strict=True)):
        of_part = replace(place["parts"][k]["features"], part=part)
        for number, item in enumerate(of_part.converted(entry.get("features", []), list[Any])):
            part.add(TOLERANCED.decode(item, of_part[number], part=part))
        for targets in Items(TARGETS).decode(entry.get("datum_targets", []), place["parts"][k]["datum_targets"]):
            part.add(targets)

    things: dict[str, Any] = {"parts": parts}
    for name in [name for name in RECORDS if name not in ("parts", "measures")]:
        things[name] = Items(RECORDS[name]).decode(getattr(struct, name), place[name])
    locators = sum(len(location.scheme) if isinstance(location.scheme, tuple) else 6 for location in things["locations"])
    deviations = locators + MAX_FREEDOMS * sum(len(part.features) for part in parts) + len(things["variables"])
    entries = ENTRIES * len(parts) * max(1, len(things["stations"]))
    sources = replace(sources, inputs=entries + deviations)
    things["measures"] = Items(RECORDS["measures"]).decode(struct.measures, Place(sources)["measures"])
    method = Optional(METHOD).decode(struct.method, place["method"])
    title_block = Optional(TITLE_BLOCK).decode(struct.title_block, place["title_block"])
    assembly = Assembly(struct.name, method=method, title_block=title_block, mu=struct.mu).replaced(**things)
    for station in assembly.stations:
        station.belonging_to(assembly)
    for fault in assembly.faults():  # a model with faults is never archived
        raise place.error(fault)
    return assembly
