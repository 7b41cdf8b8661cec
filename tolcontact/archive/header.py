"""The header of an archive: everything except the values that are written block by block."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import netCDF4
import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.archive import settings
from tolcontact.archive.contact_values import Values, contact_values, face_numbers
from tolcontact.archive.elastic_values import elastic_values
from tolcontact.archive.rows import Row, kept_rows
from tolcontact.archive.settings import Run
from tolcontact.archive.variables import define, labels_of_rows, units_of_model
from tolcontact.compilation import Program
from tolcontact.declaration import Mesh
from tolcontact.discretization import Nominal, NominalPart
from tolcontact.geometry import known_surfaces, surface_arrays
from tolcontact.geometry.triangle_mesh import COORDINATE_SPACING, coordinate_spacing
from tolcontact.simulation.locator_offsets import locator_variations
from tolcontact.simulation.other_objectives import compared_objectives, empty_by_objective
from tolcontact.vocabulary import ArchiveVariable

# A group, and the values of variables that it gets; None for what is written block by block.
Entries = Iterator[tuple[netCDF4.Dataset, Mapping[ArchiveVariable, Any]]]


def write_header(file: netCDF4.Dataset, program: Program, run: Run, sums: Sequence[int]) -> None:
    """Write all attributes, dimensions, labels and groups, and define rows and fields without values.

    `sums` is the length of the sums of each part's field, in one state.
    """
    title_block = program.nominal.assembly.title_block
    file.setncatts(
        {
            "Conventions": terms.CONVENTIONS,
            "format": np.int64(terms.FORMAT),
            "title": f"variation simulation of {program.nominal.assembly.name}",
            "source": "Monte-Carlo variation simulation of a rigid-body assembly with contact",
            "references": "Sadeghi Tabar, Lindkvist, Wärmefjord, Söderberg: "
            "Variation Simulation of Rigid Bodies with Contact Representation",
            "history": f"{settings.now()} created",
            "versions": settings.versions(),
            "realizations": np.int64(0),
            **settings.run_settings(program, run),
            **settings.watch_settings(program),
            **(title_block.attributes if title_block else {}),
        }
    )
    # Where values follow each definition, the netCDF library writes all definitions every time, so that an archive of 300 parts
    # takes seven times as long. So all variables are defined first, while the groups are made.
    entries, units = _entries(file, program, run, sums), units_of_model(program)
    defined = [define(group, variable, values, units=units) for group, added in entries for variable, values in added.items()]
    for stored, values in defined:
        if values.size:
            stored[...] = values


def _entries(file: netCDF4.Dataset, program: Program, run: Run, sums: Sequence[int]) -> Entries:
    """Yield all groups with the values of their variables.

    The caller defines the variables of an entry before it asks for the next one. So their order in the file is the order of
    these entries. A group may occur in several entries.
    """
    nominal, rows = program.nominal, kept_rows(program.nominal, run.keep)
    labels = labels_of_rows(nominal)
    file.createDimension(terms.REALIZATION, None)
    for name, texts in labels.items():
        file.createDimension(name, len(texts))
    yield file, {coordinate: labels.get(coordinate.name) for coordinate in terms.COORDINATES}
    if nominal.scenes:
        yield from _stations(file, nominal, rows)
    yield file, {variable: None for variable in terms.ROWS if Row("", variable) in rows}
    variations = locator_variations(program)[nominal.last_indices]
    yield file, {terms.SUMMED_ROWS: 0, terms.LOCATOR_VARIATION: variations, **_measure_values(program)}
    yield from _model(file.createGroup("model"), program)
    points = sum(len(pair.P_m) for pair in nominal.pairs)
    shares = np.full(points, np.nan), np.full((points, 2), np.nan), 0  # of touching, before any are known
    yield file.createGroup("contact"), contact_values(program) | dict(zip(terms.TOUCHING, shares, strict=True))
    yield from _sample(file.createGroup("sample"), program, rows)
    if len(nominal.loads):
        yield from _elastic(file.createGroup(terms.ELASTIC_GROUP), program, rows)
    yield file.createGroup("surface"), empty_checks(run.surfaces, len(nominal.pairs))
    if objectives := compared_objectives(program):
        yield file.createGroup(terms.OBJECTIVES_GROUP), {terms.BY_OBJECTIVE_LABEL: objectives, **empty_by_objective(program)}
    for part, numbers in zip(nominal.last_parts, sums, strict=True):
        group = file.createGroup(terms.field_of(part.name))
        group.setncattr("part", part.name)
        yield group, _field_values(part, numbers)


def _stations(file: netCDF4.Dataset, nominal: Nominal, rows: Sequence[Row]) -> Entries:
    """Yield the station of each measure, pair and part, and what each station has for realizations."""
    values: Values = {
        terms.MEASURE_STATION: [measure.station for measure in nominal.measures],
        terms.PAIR_STATION: [nominal.parts[pair.moving].station for pair in nominal.pairs],
        terms.PART_STATION: [part.station for part in nominal.last_parts],
    }
    yield file, values
    for scene in nominal.scenes:
        path = terms.station_group(scene.station)
        group = file.createGroup(path)
        group.setncattr("station", scene.station)
        parts = [part.name for part in scene.assembly.parts]
        yield group, {terms.STATION_PART_LABEL: parts, **{row.variable: None for row in rows if row.group == path}}


def _measure_values(program: Program) -> Values:
    measures = program.nominal.measures
    bounds = np.array([m.bounds(nominal) for m, nominal in zip(measures, program.nominal_measures, strict=True)])
    bounds = np.where(np.isfinite(bounds), bounds, np.nan).reshape(-1, 2)
    return {
        terms.MEASURE_NOMINAL: program.nominal_measures,
        terms.MEASURE_TOLERANCE: [np.nan if measure.width is None else measure.width for measure in measures],
        terms.LOWER_LIMIT: bounds[:, 0],
        terms.UPPER_LIMIT: bounds[:, 1],
        terms.MEASURE_ACCURACY: program.accuracies,
        terms.QUANTITY: [measure.quantity for measure in measures],
        terms.MEASURE_UNITS: [measure.units for measure in measures],
    }


def _model(group: netCDF4.Group, program: Program) -> Entries:
    nominal = program.nominal
    yield group, {terms.DECLARATION: settings.declaration(program)}
    lines = [(number, line) for number, lines in enumerate(nominal.lines) for line in lines]
    if lines:
        numbers, ends = zip(*lines, strict=True)
        yield group, {terms.MEASURE_OF_LINE: numbers, terms.LINE_ENDS: np.array(ends)}
    for part in nominal.last_parts:
        if isinstance(part.part.geometry, Mesh):
            mesh = group.createGroup(f"mesh/{terms.group_of(part.name)}")
            mesh.setncattr("part", part.name)
            yield mesh, _mesh_values(part)


def _mesh_values(part: NominalPart) -> Values:
    values = {terms.MESH_VERTICES: part.mesh.vertices, terms.MESH_FACES: part.mesh.faces}
    if COORDINATE_SPACING in part.mesh.metadata:
        values[terms.COORDINATE_SPACING] = coordinate_spacing(part.mesh)
    if (known := known_surfaces(part.mesh)) is not None:
        face_of, surfaces, names = known
        arrays = surface_arrays(surfaces)
        values |= {terms.BREP_OF_FACE: face_of, **{variable: arrays[name] for name, variable in terms.OF_BREP_FACE.items()}}
        if names:
            values[terms.NAME_OF_BREP_FACE] = names
    return values


def _sample(group: netCDF4.Group, program: Program, rows: Sequence[Row]) -> Entries:
    contributors, locators = program.draws.contributors, program.nominal.locators
    group.createDimension(terms.CONTRIBUTOR, len(contributors))
    group.createDimension(terms.LOCATOR, len(locators))
    yield group, {row.variable: None for row in rows if row.variable is terms.DEVIATION}
    values: Values = {
        terms.CONTRIBUTOR_LABEL: [contributor.label for contributor in contributors],
        terms.CONTRIBUTOR_SOURCE: [contributor.source for contributor in contributors],
        terms.CONTRIBUTOR_UNITS: [contributor.units for contributor in contributors],
        terms.TOLERANCE_RANGE: [contributor.range for contributor in contributors],
        terms.DISTRIBUTION: [contributor.description for contributor in contributors],
        terms.MEAN_SHIFT: [contributor.mean_shift for contributor in contributors],
    }
    yield group, values
    if any(parts := [contributor.parts for contributor in contributors]):
        yield group, {terms.PARTS: parts}
    values = {
        terms.LOCATOR_LABEL: locators.labels,
        terms.STIFFNESS: locators.stiffness,
        terms.ONE_SIDED: locators.one_sided,
        terms.LOCATOR_POINT: locators.points,
        terms.LOCATOR_DIRECTION: locators.directions,
        terms.FACE_OF_LOCATOR: face_numbers(program.nominal, locators.faces),
    }
    yield group, values
    if any(locators.grounds):
        yield group, {terms.GROUND_OF_LOCATOR: face_numbers(program.nominal, locators.grounds)}


def _elastic(group: netCDF4.Group, program: Program, rows: Sequence[Row]) -> Entries:
    nominal = program.nominal
    group.createDimension(terms.LOADS, len(nominal.loads))
    group.createDimension(terms.WELD_ROWS, nominal.input_count - len(nominal.contributors))
    yield group, {row.variable: None for row in rows if row.group == terms.ELASTIC_GROUP}
    yield group, elastic_values(program)


def empty_checks(count: int, pairs: int) -> dict[ArchiveVariable, np.ndarray]:
    """Return the values of the group `surface` before any check."""
    findings = (terms.SURFACE_PENETRATION, terms.BESIDE, terms.FALSE_CONTACT, terms.CONTACTS, terms.CONTACTS_ENDED)
    return {
        terms.CHECKED_REALIZATION: np.full(count, terms.UNCHECKED),
        **{finding: np.full((count, pairs), np.nan) for finding in findings},
        terms.AT_RANDOM: np.zeros(count, dtype=np.int8),
    }


def _field_values(part: NominalPart, numbers: int) -> Values:
    """Return the surface of a part, and its displacement field and sums before they are known."""
    states, vertices = len(terms.STATES), len(part.vertices)
    empty = np.full([states, vertices, len(terms.COMPONENTS)], np.nan)
    return {
        terms.COMPONENT_LABEL: terms.COMPONENTS,
        terms.FIELD_VERTICES: part.vertices,
        terms.FIELD_FACES: part.faces,
        terms.BOUND_LABEL: terms.BOUNDS,
        terms.FIELD_MEAN: empty,
        terms.FIELD_SIX_SIGMA: empty,
        terms.FIELD_INTERVAL: np.full([states, vertices, len(terms.BOUNDS)], np.nan),
        terms.FIELD_REALIZATIONS: 0,
        terms.MAGNITUDE_REALIZATIONS: 0,
        terms.FIELD_SUMS: np.full([states, numbers], np.nan),
    }
