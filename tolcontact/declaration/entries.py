"""Entries of parts, features, tolerances, locations, contact pairs, measures and causes in a document.

An archive differs from a JSON model in three ways: its faces are triangles, its meshes are next to the document, and it states
all defaults.
"""

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from tolcontact.declaration.checks import NOT_NEGATIVE, POSITIVE, text_type
from tolcontact.declaration.codec import CODECS, Choice, Document, Items, Plain, floats
from tolcontact.declaration.contact_pair import ContactPair, Force, Joint, Overlap
from tolcontact.declaration.declarations import Station
from tolcontact.declaration.dependence import Correlation, Variable
from tolcontact.declaration.face_entries import FREE_DIRECTION, MEASURED, UNIT_VECTOR, Writing, feature_named
from tolcontact.declaration.feature_tolerance import KINDS, GeometricTolerance
from tolcontact.declaration.geometry import Box, Elastic, Mesh, Pin
from tolcontact.declaration.locator import USUAL_STIFFNESS, Location, Locator, ThreeTwoOne
from tolcontact.declaration.measure import Measure, tape_of
from tolcontact.declaration.measured_table import Population
from tolcontact.declaration.part import DatumTargets, Face, Feature, Part, Pattern
from tolcontact.declaration.place import Place
from tolcontact.declaration.record import Field, Record
from tolcontact.declaration.size import Form, Size
from tolcontact.declaration.title_block import TitleBlock
from tolcontact.declaration.tolerance import SHAPES, Tolerance, scipy_distribution
from tolcontact.method import ACTIVE_SETS, OBJECTIVES, REGULARIZATIONS, RESOLUTIONS, SEARCHES, Method


def _distribution_values(thing: Any, writing: Writing) -> Document:
    if isinstance(thing.distribution, str):
        return {"distribution": thing.distribution}
    frozen = thing.distribution
    return {"scipy": frozen.dist.name, "args": tuple(frozen.args), "kwds": frozen.kwds}


def _distribution(values: Document, place: Place) -> Document:
    """Return the name of a distribution, or a frozen distribution of scipy.stats."""
    if "scipy" not in values:
        for key in {"args", "kwds"} & set(values):
            raise place[key].error('it goes with "scipy"; leave it out')
        return values
    if "distribution" in values:
        raise place["distribution"].error('it is given together with "scipy"; leave one of them out')
    name, family = values["scipy"], scipy_distribution(values["scipy"])
    if family is None:
        raise place["scipy"].mismatch("a continuous distribution of scipy.stats", name)
    try:
        return {"distribution": family(*values.get("args", ()), **values.get("kwds", {}))}
    except (TypeError, ValueError) as error:  # unknown parameters
        raise place.error(f"scipy.stats.{name}: {error}") from error


DISTRIBUTION = Field({
    "distribution": Plain(text_type(SHAPES)), "scipy": Plain(str), "args": Plain(tuple[float, ...], floats),
    "kwds": Plain(Mapping[str, float], floats),
}, _distribution_values, _distribution)  # fmt: skip
WIDTH = Plain(NOT_NEGATIVE | str, read=lambda width, place: place.checked(Tolerance(width)))
CODECS[Tolerance] = Choice(
    "Tolerance",
    "a width in mm, a text such as '±0.1', or named values",
    Record(
        Tolerance, name="Zone", omitted="range shift cp cpk side parts", floats="shift cpk", range=Plain(NOT_NEGATIVE | str),
        distribution=DISTRIBUTION, cp=Plain(POSITIVE, floats),
    ),
    WIDTH,
)  # fmt: skip
CODECS[Form] = Record(Form, omitted="covariance length modes lobes measured")
TOLERANCE_FIELDS = [member.name for member in fields(GeometricTolerance) if member.name != "of"]
CONTROL = CODECS[Size | GeometricTolerance] = Choice(
    "FeatureTolerance",
    f"kind: one of {', '.join(['size', *KINDS])}",
    Record(
        Size, kind="size", omitted="tolerance_class envelope side parts",
        nominal=Plain(POSITIVE), upper=Plain(float | str), distribution=DISTRIBUTION,
    ),
    *(
        Record(
            GeometricTolerance, kind=kind.kind, name=kind.name, build=kind, fields=" ".join(TOLERANCE_FIELDS),
            omitted=" ".join(TOLERANCE_FIELDS[1:]), width=Plain(NOT_NEGATIVE), along=FREE_DIRECTION,
        )
        for kind in KINDS.values()
    ),
)  # fmt: skip
MEMBER = Choice("Member", "a list of faces, or the name of a feature", Items(CODECS[Face]), CODECS[Feature])
TARGETS = Record(
    DatumTargets, fields="letter points declared_at", keys={"letter": "datum", "points": "targets"}, name="DatumTargets"
)
TOLERANCED = Choice(
    "Toleranced",
    "a feature, or a pattern with members",
    Record(Pattern, mark="members", fields="constituents tolerances name datum declared_at", constituents=Items(MEMBER)),
    Record(Feature, fields="faces tolerances name datum association declared_at", omitted="association"),
)


class ArchivedMesh(Record):
    """Meshes of an archive, which has them next to the document, by the names of parts."""

    def holds(self, value: Any, writing: Any) -> bool:
        return writing.folder is None and super().holds(value, writing)


def _mesh_source(values: Document, place: Place) -> Document:
    """Return the mesh that an archive has next to the document."""
    if place.record.name not in place.sources.meshes:
        raise place["mesh"].error("expected that of a part with a mesh, or with a box")
    return {"source": place.sources.meshes[place.record.name]}


def _file_name(source: Any, writing: Writing) -> str:
    path, folder = Path(source).resolve(), writing.folder or Path()
    return (path.relative_to(folder) if path.is_relative_to(folder) else path).as_posix()


def _file(name: str, place: Place) -> Path:
    if place.sources.folder is None:
        raise place.error("an archive names no files; expected that of a part with a mesh, or with a box")
    return place.sources.folder / name


FILE_PATH = Annotated[str, Meta(description="path, from the folder of this file")]
SHAPE = Choice(
    "Shape",
    "a box, a pin, or a file",
    Record(Box, mark="box", marked=3),
    Record(Pin, mark="pin", marked=2, omitted="head"),
    ArchivedMesh(Mesh, mark="mesh", name="ArchivedMesh", fields="source", source=Field(
        {"mesh": Plain(str)}, lambda mesh, writing: {"mesh": str(mesh)}, _mesh_source, is_required=True
    )),
    Record(
        Mesh, mark="file", omitted="units body chord",
        source=Plain(FILE_PATH, _file_name, _file),
    ),
)  # fmt: skip


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
    return {"on": feature_named(values["on_feature"], replace(place["on_feature"], part=part))}


def _stiffness_values(locator: Locator, writing: Writing) -> Document:
    """Return the stiffness, by default the usual one: a compliant support, and a declared usual one, have a mark."""
    if locator.stiffness is None:
        return {"stiffness": USUAL_STIFFNESS}
    mark = {"springy": True} if locator.one_sided or locator.stiffness == USUAL_STIFFNESS else {}
    return {"stiffness": float(locator.stiffness), **mark}


def _stiffness(values: Document, place: Place) -> Document:
    """Return a declared stiffness; None for the usual one without a mark."""
    stiffness = values.get("stiffness", USUAL_STIFFNESS)
    return {"stiffness": stiffness if values.get("springy") or stiffness != USUAL_STIFFNESS else None}


LOCATOR = Record(
    Locator, fields="name point direction one_sided stiffness tolerance part on", omitted="part on", direction=UNIT_VECTOR,
    stiffness=Field({"stiffness": Plain(POSITIVE), "springy": Plain(bool)}, _stiffness_values, _stiffness),
)  # fmt: skip
SCHEME = Choice(
    "Scheme",
    "a list of locators, or a 3-2-1 scheme",
    Items(LOCATOR),
    Record(ThreeTwoOne, mark="three_two_one", marked=3, floats="inset"),
)
STEPS = Annotated[list[list[str | int | float]], Meta(description="steps of an expression")]


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


MATRIX_FILE = Plain(  # archives have the path as it was stated
    FILE_PATH,
    lambda source, writing: str(source) if writing.folder is None else _file_name(source, writing),
    lambda name, place: Path(name) if place.sources.folder is None else _file(name, place),
)
ELASTIC = Record(
    Elastic, omitted="E nu density stiffness nodes pad element_size", floats="E nu density pad element_size",
    stiffness=MATRIX_FILE, nodes=MATRIX_FILE,
)  # fmt: skip


class OfPart(Items):
    """Features and datum targets, whose faces may refer to all parts: a document is read for them once it has all parts."""

    def decode(self, entry: Any, place: Place, **arguments: Any) -> Any:
        return entry


FEATURES = Field(
    {"features": OfPart(TOLERANCED), "datum_targets": OfPart(TARGETS), "elastic": OfPart(ELASTIC)},
    lambda part, writing: {
        "features": part.toleranced,
        **({"datum_targets": part.targets} if part.targets else {}),
        **({"elastic": [part.elasticity]} if part.elasticity else {}),
    },
    lambda values, place: {},
)
RECORDS = {
    "parts": Record(
        Part, fields="geometry name at rotation fixed standard mirror declared_at features", omitted="standard mirror",
        geometry=SHAPE, features=FEATURES,
    ),
    "locations": Record(
        Location, omitted="floating station joint placing", scheme=SCHEME,
        on=Field({"on": CODECS[Part], "on_feature": Plain(str)}, _ground_values, _ground, is_nullable=True),
    ),
    "pairs": Record(ContactPair, omitted="mu station stiffness", floats="mu stiffness"),
    "measures": Record(
        Measure, omitted="to absolute limits station", floats="limits", along=UNIT_VECTOR,
        of=Field({"of": MEASURED, "tape": Plain(STEPS, read=tape_of, are_finite=False)}, _measured_values, _measured),
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
