"""The netCDF archive: written block by block with the netCDF4 library, read with xarray.

A file that is being extended breaks when its writer is killed at the wrong moment. So everything is laid out first, under
another name: header, and room for all rows, each with the status "unfinished". Once the file stands under its own name,
bytes are only overwritten in place, the status of a row after its data; whatever kills the writer, the file opens,
finished rows stay, and `resume` goes on after them.
"""

import contextlib
import datetime
import json
import platform
import shutil
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import netCDF4
import numpy as np
import xarray as xr

from tolcontact import vocabulary as words
from tolcontact.assembly import Assembly, Mesh
from tolcontact.assembly.document import from_document, to_document
from tolcontact.discretization import Nominal
from tolcontact.errors import ArchiveError
from tolcontact.simulation import Block
from tolcontact.statistics import FieldMoments
from tolcontact.symbolic import Program
from tolcontact.vocabulary import Variable

ROW_CHUNK = 1000
ROOM = 50 * ROW_CHUNK  # rows that are laid out at once
_LIBRARIES = ("tolcontact", "casadi", "numpy", "scipy", "trimesh", "xarray", "netCDF4")


class ArchiveWriter:
    """An archive being written. Use it as a context manager."""

    def __init__(self, path: Path, program: Program, *, seed: int, samples: int, keep: str) -> None:
        """Create the file with everything but its rows. `keep` says what it will hold of each realization (see `run`).

        Raises ArchiveError where it cannot be written.
        """
        with _replacing(path) as part, _opened(part, "w") as file:
            _write_header(file, program, _settings(program, seed, samples, keep))
            _make_room(file, 0, samples)
        self._go_on(path, program.nominal)

    @classmethod
    def resume(cls, path: Path, program: Program, *, seed: int, samples: int, keep: str) -> "ArchiveWriter":
        """Open an archive to go on after its last checkpoint, up to `samples`.

        Raises ArchiveError where the file is no archive, or holds another model or another run.
        """
        writer = cls.__new__(cls)
        with _replacing(path) as part:
            # Only the copy is opened: whoever reads the old file in this process may go on, HDF5 bears no file opened twice.
            shutil.copyfile(path, part)
            open_archive(part, shown=path).close()
            with _opened(part, "r+") as file:
                _check_same_run(file, path, program, _settings(program, seed, samples, keep))
                length = len(file.dimensions[words.REALIZATION])
                _make_room(file, length, samples)
                file.setncattr("samples", np.int64(max(samples, length)))
                rows = max(0, int(file[words.SUMMED_ROWS.name][:].max()))
                file.setncattr("history", f"{file.history}\n{_now()} resumed after {rows} realizations")
        writer._go_on(path, program.nominal)
        return writer

    def _go_on(self, path: Path, nominal: Nominal) -> None:
        """Open the file and take up the sums of its last checkpoint."""
        self._file = _opened(path, "r+")
        self._nominal = nominal
        self._moments = [[FieldMoments(part.vertices) for _ in words.STATES] for part in nominal.parts]
        summed = np.asarray(self._file[words.SUMMED_ROWS.name][:])
        self._slot = int(summed.argmax())
        self.rows = max(0, int(summed[self._slot]))
        if self.rows:
            for part, both in zip(nominal.parts, self._moments, strict=True):
                for state, moments in enumerate(both):
                    moments.state = np.asarray(self._file[f"field/{part.name}"][words.FIELD_SUMS.name][self._slot, state])

    def __enter__(self) -> "ArchiveWriter":
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()

    def append(self, block: Block) -> None:
        """Write the rows of a block, and see them to the disk."""
        rows = slice(block.start, block.start + len(block))
        R, t = block.poses[..., :9].reshape(*block.poses.shape[:3], 3, 3), block.poses[..., 9:]
        self._add_to_fields(R, t)
        values = {
            words.MEASURED: block.measured,
            words.TRANSLATION: t,
            words.ROTATION: R,
            words.GAP_MIN: block.gap_min,
            words.ACTIVE: block.active,
            words.CARRYING: block.carrying,
            words.REACTION: block.reaction,
            words.KKT_RESIDUAL: block.kkt_residual,
            words.ITERATIONS: block.iterations,
        }
        if words.DEVIATION.name in self._file["sample"].variables:
            self._file["sample"][words.DEVIATION.name][rows] = block.deviations
        for variable, data in values.items():
            if data.size and variable.name in self._file.variables:
                self._file[variable.name][rows] = data
        self._file.sync()
        self._file[words.STATUS.name][rows] = block.status
        self._file.sync()
        self.rows = rows.stop

    def _add_to_fields(self, R: np.ndarray, t: np.ndarray) -> None:
        for part, both in enumerate(self._moments):
            for state, moments in enumerate(both):
                moments.add(R[:, state, part], t[:, state, part])

    def check_point(self) -> None:
        """Write the sums so far, from which a killed run goes on. The last ones stay until these are on the disk."""
        self._slot = 1 - self._slot
        self._file[words.SUMMED_ROWS.name][self._slot] = -1
        self._file.sync()
        for part, both in zip(self._nominal.parts, self._moments, strict=True):
            sums = self._file[f"field/{part.name}"][words.FIELD_SUMS.name]
            for state, moments in enumerate(both):
                sums[self._slot, state] = moments.state
        self._file.sync()
        self._file[words.SUMMED_ROWS.name][self._slot] = self.rows
        self._file.sync()

    def write_fields(self) -> None:
        """Displacement fields of all parts, from the sums over all rows."""
        for part, both in zip(self._nominal.parts, self._moments, strict=True):
            group = self._file[f"field/{part.name}"]
            for state, moments in enumerate(both):
                group[words.FIELD_MEAN.name][state] = moments.mean()
                group[words.FIELD_SIX_SIGMA.name][state] = moments.six_sigma()
                group[words.FIELD_INTERVAL.name][state] = moments.magnitude_bounds()
        self._file.sync()


def open_archive(path: str | Path, *, shown: Path | None = None) -> xr.DataTree:
    """An archive as a tree of labelled datasets, read on demand.

    Raises ArchiveError where the file is missing, is not netCDF, or was not written by tolcontact; messages speak of
    `shown` where that is given.
    """
    source, path = Path(path), shown or Path(path)
    if not source.is_file():
        raise ArchiveError(f'archive "{path}" does not exist; write one with: tolcontact run MODEL.py --out {path}')
    try:
        tree = xr.open_datatree(source, engine="netcdf4")
    except (OSError, ValueError) as error:
        raise ArchiveError(f'"{path}" cannot be read as netCDF: {error}') from error
    missing = [v.name for v in words.ROWS if v not in words.POSES and v.name not in tree.ds] + [
        g for g in ("model", "sample") if g not in tree.children
    ]
    if missing:
        tree.close()
        raise ArchiveError(f'"{path}" is not an archive of tolcontact: it has no {", ".join(missing)}')
    return tree


def model_of(results: xr.DataTree) -> Assembly:
    """The declared assembly, rebuilt from an archive."""
    document = json.loads(str(results["model"][words.DECLARATION.name].values))
    meshes = {}
    if "mesh" in results["model"].children:
        for name, group in results["model/mesh"].children.items():
            triangles = group.to_dataset()
            meshes[name] = _Triangles(triangles[words.MESH_VERTICES.name].values, triangles[words.MESH_FACES.name].values)
    return from_document(document, meshes)


class _Triangles:
    def __init__(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        self.vertices, self.faces = vertices, faces


@contextlib.contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """A name beside `path` to write under; what was written takes the place of `path` when it is whole."""
    part = path.with_name(path.name + ".part")
    try:
        yield part
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _make_room(file: netCDF4.Dataset, start: int, stop: int) -> None:
    """Lay out rows `start` to `stop`: numbered, unfinished, and with their place in the file."""
    counts = (words.STATUS, words.ACTIVE, words.CARRYING, words.ITERATIONS)
    room: dict[Variable, float] = dict.fromkeys(counts, words.UNFINISHED)
    for variable in (*words.ROWS, words.DEVIATION):
        stored = (file["sample"] if variable is words.DEVIATION else file).variables.get(variable.name)
        if stored is None or 0 in stored.shape[1:]:
            continue
        for first in range(start, stop, ROOM):
            rows = min(ROOM, stop - first)
            stored[first : first + rows] = np.full((rows, *stored.shape[1:]), room.get(variable, np.nan))
    for first in range(start, stop, ROOM):
        last = min(first + ROOM, stop)
        file[words.REALIZATION][first:last] = np.arange(first, last)


def _opened(path: Path, mode: Literal["w", "r+"]) -> netCDF4.Dataset:
    try:
        return netCDF4.Dataset(path, mode, format="NETCDF4")
    except OSError as error:
        raise ArchiveError(f'archive "{path}" cannot be written: {error.strerror or error}') from error


def _settings(program: Program, seed: int, samples: int, keep: str) -> dict[str, Any]:
    """Global attributes that say how the rows came about; a resumed run must agree in all but `samples`."""
    method = program.method
    return {
        "solver": program.plugin.name,
        "solver_options": json.dumps(program.plugin.options),
        "solver_accuracy": program.plugin.accuracy,
        "resolution": method.resolution,
        "objective": method.objective,
        "weighting": method.objective if method.objective.endswith("points") else "none",
        "regularization": method.regularization,
        "eta": method.eta,
        "active_set": method.active_set,
        "activity": method.activity,
        "search": method.search,
        "sampler": "monte-carlo",
        "seed": np.int64(seed),
        "samples": np.int64(samples),
        "kept": keep,
    }


def _now() -> str:
    return datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _declaration(program: Program) -> str:
    return json.dumps(to_document(program.nominal.assembly, program.nominal.triangles, program.tapes))


def _check_same_run(there: netCDF4.Dataset, path: Path, program: Program, settings: Mapping[str, Any]) -> None:
    if there["model"][words.DECLARATION.name][...] != _declaration(program):
        raise ArchiveError(f'"{path}" holds another model than the one to be resumed; write to a new file')
    for part in program.nominal.parts:
        if not np.array_equal(there[f"field/{part.name}"][words.FIELD_VERTICES.name][...], part.vertices):
            raise ArchiveError(f'"{path}": part "{part.name}" had another shape (was its mesh replaced?); write to a new file')
    for word, value in settings.items():
        was = getattr(there, word, None)
        if word != "samples" and was != value:
            raise ArchiveError(
                f'"{path}" was run with {word} = {was}, now it is {value}; resume with the same, or write to a new file'
            )


def _write_header(file: netCDF4.Dataset, program: Program, settings: Mapping[str, Any]) -> None:
    nominal = program.nominal
    file.setncatts(
        {
            "Conventions": words.CONVENTIONS,
            "title": f"variation simulation of {nominal.assembly.name}",
            "source": "Monte-Carlo variation simulation of a rigid-body assembly with contact",
            "references": "Sadeghi Tabar, Lindkvist, Wärmefjord, Söderberg: "
            "Variation Simulation of Rigid Bodies with Contact Representation",
            "history": f"{_now()} created",
            "versions": ", ".join([f"python {platform.python_version()}", *(f"{lib} {version(lib)}" for lib in _LIBRARIES)]),
            **settings,
        }
    )
    labels = {
        words.STATE: words.STATES,
        words.PART: [part.name for part in nominal.parts],
        words.PAIR: [pair.name for pair in nominal.pairs],
        words.MEASURE: [measure.name for measure in nominal.measures],
        words.AXIS: words.AXES,
        words.BODY_AXIS: words.AXES,
    }
    file.createDimension(words.REALIZATION, None)
    for name, values in labels.items():
        file.createDimension(name, len(values))
    for coordinate in words.COORDINATES:
        if coordinate.name in labels:
            _write(file, coordinate, labels[coordinate.name])
        else:
            _define(file, coordinate)
    for variable in words.ROWS:
        if settings["kept"] != "measures" or variable not in words.POSES:
            _define(file, variable)
    file.createDimension(words.CHECKPOINT, 2)
    _write(file, words.SUMMED_ROWS, [-1, -1])
    file[words.REACTION.name].units = "mm" if program.method.objective.endswith("points") else "N"
    units = [measure.units for measure in nominal.measures]
    if set(units) != {"mm"}:
        file[words.MEASURED.name].units = "1" if len(set(units)) > 1 else units[0]
    _write(file, words.MEASURE_NOMINAL, program.nominal_measures)
    _write(file, words.MEASURE_TOLERANCE, [np.nan if m.tolerance is None else m.tolerance for m in nominal.measures])
    _write(file, words.MEASURE_UNITS, units)
    _write_model(file.createGroup("model"), nominal, _declaration(program))
    _write_contact(file.createGroup("contact"), nominal)
    _write_sample(file.createGroup("sample"), nominal, deviations=settings["kept"] == "all")
    for part in nominal.parts:
        group = file.createGroup(f"field/{part.name}")
        for name, size in ((words.VERTEX, len(part.vertices)), (words.FACE, len(part.faces)), (words.CORNER, 3)):
            group.createDimension(name, size)
        sums = FieldMoments(part.vertices).state.size
        for name, size in ((words.COMPONENT, len(words.COMPONENTS)), (words.BOUND, len(words.BOUNDS)), (words.NUMBER, sums)):
            group.createDimension(name, size)
        _write(group, words.COMPONENT_LABEL, words.COMPONENTS)
        _write(group, words.FIELD_VERTICES, part.vertices)
        _write(group, words.FIELD_FACES, part.faces)
        for variable in (words.FIELD_MEAN, words.FIELD_SIX_SIGMA):
            _write(group, variable, np.full([len(words.STATES), len(part.vertices), len(words.COMPONENTS)], np.nan))
        _write(group, words.BOUND_LABEL, words.BOUNDS)
        _write(group, words.FIELD_INTERVAL, np.full([len(words.STATES), len(part.vertices), len(words.BOUNDS)], np.nan))
        _write(group, words.FIELD_SUMS, np.full([2, len(words.STATES), sums], np.nan))


def _write_model(group: netCDF4.Group, nominal: Nominal, declaration: str) -> None:
    _write(group, words.DECLARATION, declaration)
    for part in nominal.parts:
        if isinstance(part.part.geometry, Mesh):
            mesh = group.createGroup(f"mesh/{part.name}")
            mesh.createDimension(words.VERTEX, len(part.mesh.vertices))
            mesh.createDimension(words.FACE, len(part.mesh.faces))
            mesh.createDimension(words.CORNER, 3)
            _write(mesh, words.MESH_VERTICES, part.mesh.vertices)
            _write(mesh, words.MESH_FACES, part.mesh.faces)


def _write_contact(group: netCDF4.Group, nominal: Nominal) -> None:
    pairs = nominal.pairs
    group.createDimension(words.POINT, sum(len(pair.P_m) for pair in pairs))
    _write(group, words.MOVING_PART, [pair.moving for pair in pairs])
    _write(group, words.REFERENCE_PART, [-1 if pair.reference is None else pair.reference for pair in pairs])
    if pairs:
        _write(group, words.PAIR_OF_POINT, np.repeat(np.arange(len(pairs)), [len(pair.P_m) for pair in pairs]))
        _write(group, words.MOVING_POINT, np.vstack([pair.P_m for pair in pairs]))
        _write(group, words.REFERENCE_POINT, np.vstack([pair.P_r for pair in pairs]))
        _write(group, words.REFERENCE_NORMAL, np.vstack([pair.n_r for pair in pairs]))
        none = [np.full(len(pair.P_m), -1) if pair.locators is None else pair.locators for pair in pairs]
        _write(group, words.LOCATOR_OF_POINT, np.concatenate(none))


def _write_sample(group: netCDF4.Group, nominal: Nominal, *, deviations: bool) -> None:
    group.createDimension(words.LOCATOR, len(nominal.locator_labels))
    if deviations:
        _define(group, words.DEVIATION)
    _write(group, words.LOCATOR_LABEL, nominal.locator_labels)
    _write(group, words.TOLERANCE_RANGE, [np.nan if t.range is None else t.range for t in nominal.tolerances])
    _write(
        group,
        words.DISTRIBUTION,
        [t.distribution if isinstance(t.distribution, str) else t.distribution.dist.name for t in nominal.tolerances],
    )
    _write(group, words.STIFFNESS, np.concatenate([part.stiffness for part in nominal.parts]))
    _write(group, words.ONE_SIDED, np.concatenate([part.one_sided for part in nominal.parts]))
    _write(group, words.LOCATOR_POINT, np.vstack([part.locator_points for part in nominal.parts]))
    _write(group, words.LOCATOR_DIRECTION, np.vstack([part.locator_directions for part in nominal.parts]))


def _define(group: netCDF4.Dataset, variable: Variable) -> None:
    """A variable of numbers, without values yet."""
    options: dict[str, Any] = {}
    if words.REALIZATION in variable.dims:
        # netCDF's own choice, one row per chunk, reads some fifty times slower.
        sizes = [len(_dimension(group, d)) for d in variable.dims if d != words.REALIZATION]
        options["chunksizes"] = [ROW_CHUNK, *(max(size, 1) for size in sizes)]
    created = group.createVariable(variable.name, variable.kind, variable.dims, **options)
    attributes = variable.all_attributes
    if "flag_values" in attributes:
        attributes["flag_values"] = np.array(attributes["flag_values"], dtype=variable.kind)
    created.setncatts(attributes)


def _dimension(group: netCDF4.Dataset, name: str) -> netCDF4.Dimension:
    """A dimension of the group, or of the groups above it."""
    if name in group.dimensions or group.parent is None:
        return group.dimensions[name]
    return _dimension(group.parent, name)


def _write(group: netCDF4.Dataset, variable: Variable, values: Any) -> None:
    if variable.kind is str:
        _write_text(group, variable, values)
        return
    _define(group, variable)
    if np.size(values):
        group[variable.name][...] = values


def _write_text(group: netCDF4.Dataset, variable: Variable, values: Any) -> None:
    """Text as characters. The netCDF library crashes where text of variable length is read through two open handles."""
    text = np.char.encode(np.array(values, dtype=str), "utf-8")
    length = group.createDimension(f"{variable.name}_length", max(text.dtype.itemsize, 1))
    created = group.createVariable(variable.name, "S1", (*variable.dims, length.name))
    if text.size:
        created[...] = text.reshape(*text.shape, 1).view("S1") if text.dtype.itemsize else ""
    created.setncatts({**variable.all_attributes, "_Encoding": "utf-8"})
