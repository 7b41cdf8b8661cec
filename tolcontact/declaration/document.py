"""The document of an assembly, as an archive stores it and as a JSON model states it: a record for each of its lists."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, get_args

import msgspec
from msgspec import UNSET, Meta, UnsetType

from tolcontact.declaration import entries
from tolcontact.declaration.assembly import MAX_COUNTS, Assembly
from tolcontact.declaration.checks import NOT_NEGATIVE, POSITIVE, text_type
from tolcontact.declaration.codec import (
    CODECS,
    Document,
    EntryError,
    Items,
    Place,
    Plain,
    Sources,
    Writing,
    definitions,
    floats,
)
from tolcontact.declaration.contact_pair import ContactPair, Force, Joint, Overlap
from tolcontact.declaration.declarations import Station
from tolcontact.declaration.dependence import Correlation, Variable
from tolcontact.declaration.feature_tolerance import GeometricTolerance
from tolcontact.declaration.locator import Location
from tolcontact.declaration.measure import Measure, Tape, tape_of
from tolcontact.declaration.part import Face, Feature, Part, Standard
from tolcontact.declaration.population import Population
from tolcontact.declaration.record import Field, Record
from tolcontact.declaration.size import Size
from tolcontact.declaration.title_block import TitleBlock
from tolcontact.errors import ArchiveError
from tolcontact.method import ACTIVE_SETS, OBJECTIVES, REGULARIZATIONS, RESOLUTIONS, SEARCHES, Method
from tolcontact.poses import ENTRIES

MAX_FREEDOMS = 7  # of a feature, with its size
STEPS = Annotated[list[list[str | int | float]], Meta(description="steps of an expression")]


def _ground_values(location: Location, writing: Writing) -> Document:
    feature = {"on_feature": location.on.name} if isinstance(location.on, Feature) else {}
    return {"on": location.parent, **feature}


def _ground(values: Document, place: Place) -> Document:
    """Return the part that locators are on, or the feature of it; None for the ground."""
    part = values.get("on")
    if "on_feature" not in values:
        return {"on": part}
    if part is None:
        raise place["on_feature"].error('it goes with "on", the part of the feature; give both')
    return {"on": entries.feature_named(values["on_feature"], replace(place["on_feature"], part=part))}


def _measured_values(measure: Measure, writing: Writing) -> Document:
    return {"tape": writing.tapes[measure.name]} if measure.is_expression else {"of": measure.of}


def _measured(values: Document, place: Place) -> Document:
    if len(values) != 1:
        what = " and ".join(values) or "neither"
        raise place.error(
            f'it has {what}; expected either "of", a point or a measurement, or "tape", the steps of an expression'
        )
    return {"of": next(iter(values.values()))}


METHOD = Record(Method, **{  # type: ignore[arg-type]
    name: Plain(text_type(choices)) for name, choices in {
        "resolution": RESOLUTIONS, "objective": OBJECTIVES, "regularization": REGULARIZATIONS, "active_set": ACTIVE_SETS,
        "search": SEARCHES,
    }.items()
})  # fmt: skip
TITLE_BLOCK = Record(TitleBlock, omitted=" ".join(TitleBlock().entries))
RECORDS = {
    "parts": Record(
        Part, fields="geometry name at rotation fixed standard mirror declared_at features", omitted="standard mirror",
        geometry=entries.SHAPE, features=entries.OF_PART,
    ),
    "locations": Record(
        Location, omitted="floating station joint placing", scheme=entries.SCHEME,
        on=Field({"on": CODECS[Part], "on_feature": Plain(str)}, _ground_values, _ground, is_nullable=True),
    ),
    "pairs": Record(ContactPair, omitted="mu station stiffness", floats="mu stiffness"),
    "measures": Record(
        Measure, omitted="to absolute limits station", floats="limits", along=entries.UNIT_VECTOR,
        of=Field({"of": entries.MEASURED, "tape": Plain(STEPS, read=tape_of, are_finite=False)}, _measured_values, _measured),
        tolerance=Plain(POSITIVE | tuple[float, float] | str),
    ),
    "forces": Record(Force, omitted="station"),
    "variables": Record(Variable, floats="drives nominal expands loads", omitted="nominal expands loads"),
    "correlations": Record(Correlation, omitted="kind"),
    "populations": Record(
        Population, fields="values columns source declared_at gauge lots left_out", floats="gauge",
        omitted="gauge lots left_out",
    ),
    "stations": Record(Station),
    "joints": Record(Joint, omitted="at pad"),
    "overlaps": Record(Overlap),
}  # fmt: skip
# Lists that a document leaves out if it has no items for them.
GOES_WITH = {"stations": "stations", "joints": "stations", "overlaps": "overlaps"}
GRAVITY = Plain(tuple[float, float, float], floats)
CODECS_OF_LISTS = METHOD, TITLE_BLOCK, *RECORDS.values()
DOCUMENT = msgspec.defstruct("Document", [
    ("name", str), ("parts", Items(RECORDS["parts"]).wire), ("measures", Items(RECORDS["measures"]).wire),
    ("schema", str | UnsetType, UNSET), ("method", METHOD.wire | None, None),
    ("title_block", TITLE_BLOCK.wire | None, None), ("mu", NOT_NEGATIVE | None, None), ("gravity", GRAVITY.wire | None, None),
    ("standard", text_type(get_args(Standard)), ""),
    *((name, Items(record).wire, []) for name, record in RECORDS.items() if name not in ("parts", "measures")),
], forbid_unknown_fields=True, rename={"schema": "$schema"})  # fmt: skip


def json_schema() -> Document:
    """Return the JSON schema of a model as JSON: names, types, defaults and limits of all that is declared."""
    root = msgspec.json.schema_components([DOCUMENT], ref_template="#/$defs/{name}")[1]["Document"]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **root,
        "title": "tolcontact model",
        "description": "A declared assembly: lengths in mm, angles in rad, forces in N.",
        "$defs": definitions(*CODECS_OF_LISTS),
    }


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
    standard = {"standard": assembly.standard} if assembly.standard else {}
    gravity = {} if assembly.acceleration is None else {"gravity": GRAVITY.encode(assembly.acceleration, writing)}
    method = None if assembly.method is None else METHOD.encode(assembly.method, writing)
    return {"name": assembly.name, "method": method, **titles, **friction, **gravity, **standard, **lists}


def tolerance_of_entry(entry: Any) -> Size | GeometricTolerance:
    """Return a tolerance of a feature from its entry in a document. Raises ArchiveError for an entry that states none."""
    return _archived(lambda: entries.CONTROL.decode(entry, Place(Sources({}))))  # type: ignore[no-any-return]


def variable_of_entry(entry: Any) -> Variable:
    """Return a variable from its entry in a document. Raises ArchiveError for an entry that states none."""
    return _archived(lambda: RECORDS["variables"].decode(entry, Place(Sources({}))))  # type: ignore[no-any-return]


def from_document(document: Any, meshes: Mapping[str, Any]) -> Assembly:
    """Return the assembly of an archive's document; `meshes` holds a mesh (vertices and faces) for each mesh part.

    Raises ArchiveError for a document that `to_document` cannot have written. No code in it is run.
    """
    return _archived(lambda: assembly_of(document, Sources(meshes)))  # type: ignore[no-any-return]


def _archived(decode: Callable[[], Any]) -> Any:
    """Return what an entry of an archive declares. Raises ArchiveError for an entry that no run has written."""
    try:
        return decode()
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
        sources.parts[part.name] = part if part.standard else replace(part, standard=struct.standard)
    parts = list(sources.parts.values())
    for k, (part, entry) in enumerate(zip(parts, struct.parts, strict=True)):
        of_part = replace(place["parts"][k]["features"], part=part)
        for number, item in enumerate(of_part.converted(entry.get("features", []), list[Any])):
            part.add(entries.TOLERANCED.decode(item, of_part[number], part=part))
        for targets in Items(entries.TARGETS).decode(entry.get("datum_targets", []), place["parts"][k]["datum_targets"]):
            part.add(targets)
        part._declared.extend(Items(entries.ELASTIC).decode(entry.get("elastic", []), place["parts"][k]["elastic"]))

    things: dict[str, Any] = {"parts": parts}
    for name in [name for name in RECORDS if name not in ("parts", "measures")]:
        things[name] = Items(RECORDS[name]).decode(getattr(struct, name), place[name])
    locators = sum(len(location.scheme) if isinstance(location.scheme, tuple) else 6 for location in things["locations"])
    deviations = locators + MAX_FREEDOMS * sum(len(part.features) for part in parts) + len(things["variables"])
    pose_entries = ENTRIES * len(parts) * max(1, len(things["stations"]))
    sources = replace(sources, inputs=pose_entries + deviations)
    things["measures"] = Items(RECORDS["measures"]).decode(struct.measures, Place(sources)["measures"])
    method = None if struct.method is None else METHOD.decode(struct.method, place["method"])
    title_block = None if struct.title_block is None else TITLE_BLOCK.decode(struct.title_block, place["title_block"])
    settings: dict[str, Any] = {"method": method, "title_block": title_block, "mu": struct.mu, "standard": struct.standard}
    assembly = Assembly(struct.name, **settings).replaced(**things)
    assembly.acceleration = None if struct.gravity is None else GRAVITY.decode(struct.gravity, place["gravity"])
    for station in assembly.stations:
        station.belonging_to(assembly)
    for fault in assembly.faults():  # a model with faults is never archived
        raise place.error(fault)
    return assembly
