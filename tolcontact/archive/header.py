"""The header of an archive: everything except the values that are written block by block."""

from collections.abc import Sequence
from typing import Any

import netCDF4
import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.archive.elastic_values import write_elastic
from tolcontact.archive.form_values import datum_values, form_values
from tolcontact.archive.rows import Row, kept_rows
from tolcontact.archive.settings import Run, declaration, now, run_settings, versions, watch_settings
from tolcontact.archive.stored_rows import empty_checks
from tolcontact.archive.variables import Definitions, define, labels_of_rows, units_of_rows
from tolcontact.compilation import Program
from tolcontact.declaration import Mesh
from tolcontact.discretization import Nominal, NominalPart
from tolcontact.features import FaceDeviation
from tolcontact.geometry import known_surfaces, surface_arrays
from tolcontact.geometry.triangle_mesh import COORDINATE_SPACING, coordinate_spacing
from tolcontact.mechanics.correction import central_moments
from tolcontact.simulation.bodies import locator_variations
from tolcontact.simulation.run_checks import compared_objectives, empty_by_objective
from tolcontact.vocabulary import ArchiveVariable


def write_header(file: netCDF4.Dataset, program: Program, run: Run, sums: Sequence[int]) -> None:
    """Write all attributes, dimensions, labels and groups, and define rows and fields without values.

    `sums` is the length of the sums of each part's field, in one state.
    """
    nominal = program.nominal
    file.setncatts(
        {
            "Conventions": terms.CONVENTIONS,
            "format": np.int64(terms.FORMAT),
            "title": f"variation simulation of {nominal.assembly.name}",
            "source": "Monte-Carlo variation simulation of a rigid-body assembly with contact",
            "references": "Sadeghi Tabar, Lindkvist, Wärmefjord, Söderberg: "
            "Variation Simulation of Rigid Bodies with Contact Representation",
            "history": f"{now()} created",
            "versions": versions(),
            "realizations": np.int64(0),
            **run_settings(program, run),
            **watch_settings(program),
            **(nominal.assembly.title_block.attributes if nominal.assembly.title_block else {}),
        }
    )
    new, rows = Definitions(), kept_rows(nominal, run.keep)
    _write_labels(new, file, nominal)
    _write_stations(new, file, nominal, rows)
    _write_rows(new, file, program, rows)
    _write_measures(new, file, program)
    _write_model(new, file.createGroup("model"), nominal, declaration(program))
    points = sum(len(pair.P_m) for pair in nominal.pairs)
    new.add_all(file.createGroup("contact"), contact_values(program) | empty_touching(points))
    _write_sample(new, file.createGroup("sample"), program, deviations=Row("sample", terms.DEVIATION) in rows)
    if len(nominal.loads):
        write_elastic(new, file.createGroup(terms.ELASTIC_GROUP), program, [row.variable for row in rows])
    new.add_all(file.createGroup("surface"), empty_checks(run.surfaces, len(nominal.pairs)))
    if objectives := compared_objectives(program):
        group = file.createGroup(terms.OBJECTIVES_GROUP)
        new.add(group, terms.BY_OBJECTIVE_LABEL, objectives)
        new.add_all(group, empty_by_objective(program))
    for part, numbers in zip(nominal.last_parts, sums, strict=True):
        _write_field(new, file.createGroup(terms.field_of(part.name)), part, numbers)
    new.write()


def _write_labels(new: Definitions, file: netCDF4.Dataset, nominal: Nominal) -> None:
    """Write the dimensions of the root and their labels."""
    labels = labels_of_rows(nominal)
    file.createDimension(terms.REALIZATION, None)
    for name, values in labels.items():
        file.createDimension(name, len(values))
    for coordinate in terms.COORDINATES:
        if coordinate.name in labels:
            new.add(file, coordinate, labels[coordinate.name])
        else:
            define(file, coordinate)


def _write_rows(new: Definitions, file: netCDF4.Dataset, program: Program, rows: Sequence[Row]) -> None:
    """Define the variables of realizations, without values."""
    for variable in terms.ROWS:
        if Row("", variable) in rows:
            define(file, variable)
    for variable, units in units_of_rows(program).items():
        file[variable.name].units = units
    new.add(file, terms.SUMMED_ROWS, 0)
    new.add(file, terms.LOCATOR_VARIATION, locator_variations(program)[program.nominal.last_indices])


def _write_stations(new: Definitions, file: netCDF4.Dataset, nominal: Nominal, rows: Sequence[Row]) -> None:
    """Write the station of each measure, pair and part, and define the variables of each station; nothing without stations."""
    if not nominal.scenes:
        return
    new.add(file, terms.MEASURE_STATION, [measure.station for measure in nominal.measures])
    new.add(file, terms.PAIR_STATION, [nominal.parts[pair.moving].station for pair in nominal.pairs])
    new.add(file, terms.PART_STATION, [part.station for part in nominal.last_parts])
    for scene in nominal.scenes:
        path = terms.station_group(scene.station)
        group = file.createGroup(path)
        group.setncattr("station", scene.station)
        new.add(group, terms.STATION_PART_LABEL, [part.name for part in scene.assembly.parts])
        for row in rows:
            if row.group == path:
                define(group, row.variable)


def _write_measures(new: Definitions, file: netCDF4.Dataset, program: Program) -> None:
    measures = program.nominal.measures
    new.add(file, terms.MEASURE_NOMINAL, program.nominal_measures)
    new.add(file, terms.MEASURE_TOLERANCE, [np.nan if measure.width is None else measure.width for measure in measures])
    bounds = np.array([m.bounds(nominal) for m, nominal in zip(measures, program.nominal_measures, strict=True)])
    bounds = np.where(np.isfinite(bounds), bounds, np.nan).reshape(-1, 2)
    new.add(file, terms.LOWER_LIMIT, bounds[:, 0])
    new.add(file, terms.UPPER_LIMIT, bounds[:, 1])
    new.add(file, terms.MEASURE_ACCURACY, program.accuracies)
    new.add(file, terms.QUANTITY, [measure.quantity for measure in measures])
    new.add(file, terms.MEASURE_UNITS, [measure.units for measure in measures])


def _write_field(new: Definitions, group: netCDF4.Group, part: NominalPart, numbers: int) -> None:
    """Write the surface of a part, and lay out its displacement field and its sums."""
    group.setncattr("part", part.name)
    new.add(group, terms.COMPONENT_LABEL, terms.COMPONENTS)
    new.add(group, terms.FIELD_VERTICES, part.vertices)
    new.add(group, terms.FIELD_FACES, part.faces)
    new.add(group, terms.BOUND_LABEL, terms.BOUNDS)
    new.add_all(group, empty_field(len(part.vertices)))
    new.add(group, terms.FIELD_SUMS, np.full([len(terms.STATES), numbers], np.nan))


def empty_field(vertices: int) -> dict[ArchiveVariable, Any]:
    """Return the values in the group of a part before its field is written."""
    states = len(terms.STATES)
    return {
        **{v: np.full([states, vertices, len(terms.COMPONENTS)], np.nan) for v in (terms.FIELD_MEAN, terms.FIELD_SIX_SIGMA)},
        terms.FIELD_INTERVAL: np.full([states, vertices, len(terms.BOUNDS)], np.nan),
        terms.FIELD_REALIZATIONS: 0,
        terms.MAGNITUDE_REALIZATIONS: 0,
    }


def empty_touching(points: int) -> dict[ArchiveVariable, Any]:
    """Return the shares of touching before any are known."""
    return {
        terms.TOUCHING_SHARE: np.full(points, np.nan),
        terms.TOUCHING_INTERVAL: np.full((points, 2), np.nan),
        terms.TOUCHING_REALIZATIONS: 0,
    }


def _write_model(new: Definitions, group: netCDF4.Group, nominal: Nominal, document: str) -> None:
    new.add(group, terms.DECLARATION, document)
    lines = [(number, line) for number, lines in enumerate(nominal.lines) for line in lines]
    if lines:
        new.add(group, terms.MEASURE_OF_LINE, [number for number, _ in lines])
        new.add(group, terms.LINE_ENDS, np.array([line for _, line in lines]))
    for part in nominal.last_parts:
        if isinstance(part.part.geometry, Mesh):
            mesh = group.createGroup(f"mesh/{terms.group_of(part.name)}")
            mesh.setncattr("part", part.name)
            new.add(mesh, terms.MESH_VERTICES, part.mesh.vertices)
            new.add(mesh, terms.MESH_FACES, part.mesh.faces)
            if COORDINATE_SPACING in part.mesh.metadata:
                new.add(mesh, terms.COORDINATE_SPACING, coordinate_spacing(part.mesh))
            surfaces = known_surfaces(part.mesh)
            if surfaces is not None:
                new.add(mesh, terms.BREP_OF_FACE, surfaces[0])
                arrays = surface_arrays(surfaces[1])
                new.add_all(mesh, {variable: arrays[name] for name, variable in terms.OF_BREP_FACE.items()})
                if surfaces[2]:
                    new.add(mesh, terms.NAME_OF_BREP_FACE, surfaces[2])


def contact_values(program: Program) -> dict[ArchiveVariable, Any]:
    """Return the values of the group `contact`: which parts touch, and where."""
    nominal, pairs = program.nominal, program.nominal.pairs
    parts = {
        terms.MOVING_PART: [nominal.number(pair.moving) for pair in pairs],
        terms.REFERENCE_PART: [-1 if pair.reference is None else nominal.number(pair.reference) for pair in pairs],
    }
    if not pairs:
        return parts | _face_values(nominal) | form_values(program) | datum_values(program)
    locators = [np.full(len(pair.P_m), -1) if pair.locators is None else pair.locators for pair in pairs]
    values = parts | {
        terms.PAIR_OF_POINT: np.repeat(np.arange(len(pairs)), [len(pair.P_m) for pair in pairs]),
        terms.MOVING_POINT: np.vstack([pair.P_m for pair in pairs]),
        terms.REFERENCE_POINT: np.vstack([pair.P_r for pair in pairs]),
        terms.REFERENCE_NORMAL: np.vstack([pair.n_r for pair in pairs]),
        terms.LOCATOR_OF_POINT: np.concatenate(locators),
    }
    if any(pair.is_springy for pair in pairs):
        stiffness = [np.full(len(pair.P_m), np.inf) if pair.stiffness is None else pair.stiffness for pair in pairs]
        values[terms.POINT_STIFFNESS] = np.concatenate(stiffness)
    values |= (
        _objective_values(program)
        | _bounded_values(program)
        | _coordinate_values(nominal)
        | _round_values(nominal)
        | _face_values(nominal)
    )
    return values | form_values(program) | datum_values(program)


def _objective_values(program: Program) -> dict[ArchiveVariable, Any]:
    """Return the moments of the faces that the objective counts; none if it does not count faces."""
    if not program.method.counts_faces:
        return {}
    count = len(program.nominal.pairs)
    areas, centres, seconds = np.zeros((count, 2)), np.zeros((count, 2, 3)), np.zeros((count, 2, 3, 3))
    for group in (compiled.group for compiled in program.groups):
        for side in group.sides:
            number, index = group.pairs[side.pair], 1 - side.is_moving
            if not program.nominal.pairs[number].is_supports:
                areas[number, index] = side.moments[0] / side.density
                centres[number, index], seconds[number, index] = central_moments(np.asarray(side.centre), side.moments)
    values = [terms.SIDES, areas, centres, seconds]
    return dict(zip(terms.OBJECTIVE, values, strict=True))


def _bounded_values(program: Program) -> dict[ArchiveVariable, Any]:
    """Return which pairs touch where their faces end, and the error of fixed contact points there; none unless some may."""
    if not program.method.is_bounded:
        return {}
    numbers = range(len(program.nominal.pairs))
    return {
        terms.BOUNDED: [k in program.meetings for k in numbers],
        terms.PLANE_ERROR: [program.trials[k].error if k in program.trials else np.nan for k in numbers],
    }


def _coordinate_values(nominal: Nominal) -> dict[ArchiveVariable, Any]:
    """Return the coordinate errors of files, which are added to gaps; none unless a file rounds coordinates."""
    errors = [pair.coordinate_error for pair in nominal.pairs]
    return {terms.COORDINATE_ERROR: errors} if any(errors) else {}


def _face_values(nominal: Nominal) -> dict[ArchiveVariable, Any]:
    """Return how the faces of features deviate, and which sides of pairs they are."""
    faces, count = nominal.faces, len(nominal.contributors)
    if not faces:
        return {}
    twists, heights = np.zeros((len(faces), 6, count)), np.zeros((len(faces), count))
    for number, face in enumerate(faces):
        twists[number][:, face.columns], heights[number, face.columns] = face.twist, face.height
    moving, reference = (
        [-1 if pair.deviating[side] is None else faces.index(pair.deviating[side]) for pair in nominal.pairs] for side in (0, 1)
    )
    return {
        terms.FEATURE_OF_FACE: [face.name for face in faces],
        terms.FACE_CENTRE: np.array([face.centre for face in faces]),
        terms.FREEDOM_LABEL: terms.FREEDOMS,
        terms.FACE_TWIST: twists,
        terms.FACE_HEIGHT: heights,
        terms.FACE_OF_MOVING: moving,
        terms.FACE_OF_REFERENCE: reference,
        terms.FACING: np.concatenate([np.zeros(0), *(pair.facing for pair in nominal.pairs)]),
    }


def _round_values(nominal: Nominal) -> dict[ArchiveVariable, Any]:
    """Return the values that determine where round faces touch, at any pose."""
    starts = np.cumsum([0, *(len(pair.P_m) for pair in nominal.pairs)])
    shapes = {k: pair.shapes for k, pair in enumerate(nominal.pairs) if pair.shapes is not None}
    if not shapes:
        return {}
    return {
        terms.POINT_OF_ROUND: np.concatenate([np.arange(starts[k], starts[k + 1]) for k in shapes]),
        **{v: np.concatenate([walls[name] for walls, _ in shapes.values()]) for name, v in terms.OF_WALL.items()},
        **{v: np.concatenate([points[name] for _, points in shapes.values()]) for name, v in terms.OF_ROUND.items()},
    }


def _write_sample(new: Definitions, group: netCDF4.Group, program: Program, *, deviations: bool) -> None:
    nominal, contributors = program.nominal, program.draws.contributors
    group.createDimension(terms.CONTRIBUTOR, len(contributors))
    group.createDimension(terms.LOCATOR, len(nominal.locators))
    if deviations:
        define(group, terms.DEVIATION)
    new.add(group, terms.CONTRIBUTOR_LABEL, [contributor.label for contributor in contributors])
    new.add(group, terms.CONTRIBUTOR_SOURCE, [contributor.source for contributor in contributors])
    new.add(group, terms.CONTRIBUTOR_UNITS, [contributor.units for contributor in contributors])
    new.add(group, terms.TOLERANCE_RANGE, [contributor.range for contributor in contributors])
    new.add(group, terms.DISTRIBUTION, [contributor.description for contributor in contributors])
    new.add(group, terms.MEAN_SHIFT, [contributor.mean_shift for contributor in contributors])
    if any(parts := [contributor.parts for contributor in contributors]):
        new.add(group, terms.PARTS, parts)
    locators = nominal.locators
    new.add(group, terms.LOCATOR_LABEL, locators.labels)
    new.add(group, terms.STIFFNESS, locators.stiffness)
    new.add(group, terms.ONE_SIDED, locators.one_sided)
    new.add(group, terms.LOCATOR_POINT, locators.points)
    new.add(group, terms.LOCATOR_DIRECTION, locators.directions)
    new.add(group, terms.FACE_OF_LOCATOR, _numbers(nominal, locators.faces))
    if any(locators.grounds):
        new.add(group, terms.GROUND_OF_LOCATOR, _numbers(nominal, locators.grounds))


def _numbers(nominal: Nominal, faces: Sequence[FaceDeviation | None]) -> list[int]:
    """Return the zero-based indices of the faces of features, -1 for None."""
    return [-1 if face is None else nominal.faces.index(face) for face in faces]
