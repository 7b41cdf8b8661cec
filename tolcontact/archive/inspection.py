"""Inspection of a file before anything in it is trusted: it has to be an undamaged archive.

The netCDF library itself can fail on a damaged file, or never return. So a separate process inspects the file first (this
module, as a script), with limits on memory and time. It reads all but the realizations. The library compares the checksums of
what it reads.
"""

import json
import math
import os
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.child import ChildDiedError, run_child
from tolcontact.errors import ArchiveError
from tolcontact.input_files import fault_of, is_archive
from tolcontact.system import files
from tolcontact.system.machine import limit_resources
from tolcontact.texts import CONTROL_CHARACTERS, shown
from tolcontact.vocabulary import ArchiveVariable, archive, elastic, variation

MAX_SECONDS, SECONDS_PER_GB = 20.0, 20.0  # of processor time
MEMORY = 1 << 30  # in addition to four times the size of the file
MAX_DEFLATION = 1032  # zlib compresses data no further
MAX_DECLARATION = 1 << 26  # bytes of a declared model
MAX_TEXT = 1 << 20  # letters of an attribute or a label
MAX_DEPTH, MAX_GROUPS = 4, 64  # of groups in groups; and of groups in a group, in addition to two for each part
SIZES = {
    terms.STATE: 2, terms.AXIS: 3, terms.BODY_AXIS: 3, terms.CORNER: 3, terms.COMPONENT: 4, terms.BOUND: 2, terms.LINE_END: 2,
}  # fmt: skip
CHANGES_VALUES = ("scale_factor", "add_offset", "missing_value", "_Unsigned", "calendar")  # when xarray reads them
ATTRIBUTES = dict.fromkeys(("title", "history", "versions", *terms.METHOD_ATTRIBUTES, "search"), str) | {
    "solver_accuracy": np.floating, "samples": np.integer, "realizations": np.integer, "block_rows": np.integer,
}  # fmt: skip
NEEDED = {  # variables of groups that summaries and models are read from
    "": (
        *(v for v in terms.ROWS if v not in (*terms.POSES, terms.LOCATOR_OFFSET)), terms.MEASURE_NOMINAL,
        terms.MEASURE_TOLERANCE, terms.MEASURE_UNITS,
        terms.LOWER_LIMIT, terms.UPPER_LIMIT, terms.MEASURE_ACCURACY, terms.QUANTITY, terms.SUMMED_ROWS,
    ),
    "contact": (terms.MOVING_PART, terms.REFERENCE_PART, *terms.TOUCHING),
    "sample": (
        terms.CONTRIBUTOR_LABEL, terms.CONTRIBUTOR_SOURCE, terms.CONTRIBUTOR_UNITS, terms.TOLERANCE_RANGE, terms.DISTRIBUTION,
        terms.LOCATOR_LABEL, terms.LOCATOR_POINT, terms.LOCATOR_DIRECTION, terms.ONE_SIDED,
    ),
    "surface": terms.SURFACE,
    "model": (terms.DECLARATION,),
}  # fmt: skip
OF_FIELD = (terms.FIELD_VERTICES, terms.FIELD_FACES, *terms.FIELDS, terms.FIELD_SUMS)
TOGETHER = (
    terms.ROUND,
    terms.KNOWN_SURFACES,
    terms.FEATURE_FACES,
    terms.FORMS,
    terms.TANGENTS,
    terms.OF_STATIONS,
    terms.OF_ELASTIC,
)
KINDS_OF_SURFACES = (terms.ROUND[1], terms.KNOWN_SURFACES[1])
CHECKED_GROUPS = (
    "",
    "model",
    "contact",
    "sample",
    "surface",
    "field",
    terms.OBJECTIVES_GROUP,
    terms.STATIONS_GROUP,
    terms.ELASTIC_GROUP,
)
VARIABLES = {  # by name; no two variables of an archive differ that have one name
    variable.name: variable
    for module in (archive, elastic, variation)
    for item in vars(module).values()
    for variable in (item if isinstance(item, tuple) else (item,))
    if isinstance(variable, ArchiveVariable)
}


def check_name(path: Path) -> None:
    """Raise ArchiveError if the netCDF library could not take a file's name."""
    try:
        os.fsencode(path).decode(sys.getfilesystemencoding())
    except UnicodeError as error:
        raise ArchiveError(f'"{path}": its name is not text, so netCDF cannot use it; rename the file') from error


def check_ending(path: str | Path) -> None:
    """Raise ArchiveError unless the path of an archive to write has the extension of archives."""
    if not is_archive(path):
        raise ArchiveError(f'"{path}" is not the name of an archive; expected one that ends in .nc')


class DamagedError(Exception):
    """A fault of a file."""


def check_archive(path: Path) -> None:
    """Raise ArchiveError if there is no file at a path, or it fails the inspection."""
    if fault := fault_of(path):
        raise ArchiveError(f'archive "{path}" {fault}; write one with: tolcontact run MODEL.py --out {shlex.quote(str(path))}')
    inspect(path)


def inspect(path: Path) -> None:
    """Raise ArchiveError if a file is not an archive, is damaged, or claims what it cannot hold."""
    check_name(path)
    size = path.stat().st_size
    seconds = math.ceil(MAX_SECONDS + SECONDS_PER_GB * size / 1e9)
    try:
        fault = run_child(Path(__file__), files.plain_path(path), memory=MEMORY + 4 * size, seconds=seconds)
    except OSError as error:
        raise ArchiveError(f'"{path}" cannot be read: {error.strerror}') from error
    except ChildDiedError as error:
        raise ArchiveError(f'"{path}" is damaged, or not an archive of tolcontact: {error}') from error
    if fault:
        raise ArchiveError(f'"{path}" {fault}')


def _fault(path: Path) -> str:
    """Return the fault of a file; an empty text if it is an undamaged archive."""
    try:
        file = netCDF4.Dataset(path)
    except (OSError, RuntimeError, ValueError, AttributeError) as error:
        return f"cannot be read as netCDF: {error}; expected an undamaged archive, as tolcontact run writes it"
    try:
        _check_format(file)
        file.set_auto_maskandscale(False)
        file.set_auto_chartostring(False)
        groups = {group.path.strip("/"): group for group in _groups(file)}
        for group in groups.values():
            _check_claims(group, path.stat().st_size)
        _check_needed(file, groups)
        for name, group in groups.items():
            if name.partition("/")[0] in CHECKED_GROUPS:
                _check_values(group)
        _check_stations(file)
    except DamagedError as error:
        return str(error)
    except Exception as error:  # a damaged file may raise anything in the library that reads it
        return f"is damaged: {type(error).__name__}: {error}"
    return ""


def _check_format(file: netCDF4.Dataset) -> None:
    if "format" not in file.ncattrs():
        raise DamagedError("is not an archive of tolcontact: it states no format")
    number = file.getncattr("format")
    if not isinstance(number, int | np.integer) or number < 1:
        raise DamagedError(f"is damaged: its format is {number!r}")
    if number != terms.FORMAT:
        raise DamagedError(
            f"has format {number}, and this version of tolcontact reads format {terms.FORMAT}; run the model again, or use the "
            "version that wrote it"
        )


def _groups(group: netCDF4.Dataset, depth: int = 0, parts: int = 0) -> Iterator[netCDF4.Dataset]:
    parts = parts or len(group.dimensions.get(terms.PART, ()))
    if depth > MAX_DEPTH or len(group.groups) > MAX_GROUPS + 2 * parts:
        raise DamagedError("is not an archive of tolcontact: its groups are nested too deeply, or too many")
    yield group
    for child in group.groups.values():
        yield from _groups(child, depth + 1, parts)


def _check_claims(group: netCDF4.Dataset, size: int) -> None:
    """Check the names, attributes, types and sizes of everything in a group, before any values are read."""
    for name in (*group.groups, *group.dimensions):
        _check_text("a name", name)
    _check_attributes(group)
    for name, stored in group.variables.items():
        where = f"{group.path.rstrip('/')}/{name}"
        _check_text("a name", name)
        _check_attributes(stored)
        if not isinstance(stored.datatype, np.dtype) or stored.datatype.kind not in "iufS":
            raise DamagedError(f"is not an archive of tolcontact: {where} holds neither numbers nor characters")
        claim = math.prod(stored.shape) * stored.datatype.itemsize
        if claim > size * MAX_DEFLATION or (claim > size and not _is_packed(stored)):
            count = " x ".join(map(str, stored.shape))
            raise DamagedError(f"is damaged: {where} claims {count} values, more than the file can hold")


def _is_packed(stored: netCDF4.Variable) -> bool:
    """Return whether a variable is compressed. On Windows the library loads all its plugins for that, which takes long."""
    return any((stored.filters() or {}).get(name) for name in ("zlib", "szip", "zstd", "bzip2", "blosc"))


def _check_attributes(thing: Any) -> None:
    for name in thing.ncattrs():
        _check_text("a name", name)
        value = thing.getncattr(name)
        if isinstance(value, str):
            _check_text(name, value)
        if name in CHANGES_VALUES:
            raise DamagedError(f"is not an archive of tolcontact: attribute {name} of {thing.name} would change values")


def _check_text(name: str, text: str) -> None:
    if len(text) > MAX_TEXT:
        raise DamagedError(f"is damaged: {name} has {len(text)} characters")
    if CONTROL_CHARACTERS.search(text):
        raise DamagedError(f"is damaged: {name} holds control characters ({shown(text)[:60]})")


def _check_needed(file: netCDF4.Dataset, groups: dict[str, netCDF4.Dataset]) -> None:
    """Check that everything is there that summaries and models are read from."""
    missing = [name for name, kind in ATTRIBUTES.items() if not isinstance(getattr(file, name, None), kind)]
    missing += [name for name in NEEDED if name not in groups]
    missing += [variable.name for variable in NEEDED[""] if variable.name not in file.variables]
    if missing:
        raise DamagedError(f"is not an archive of tolcontact: it has no valid {', '.join(missing)}")
    if not (0 <= file.realizations <= file.samples and 0 < file.block_rows <= terms.BLOCK_ROWS):
        raise DamagedError("is damaged: its attributes realizations, samples and block_rows contradict each other")
    fields = [terms.field_of(part) for part in _texts(file[terms.PART])]
    stations = [path for path in groups if path.startswith(f"{terms.STATIONS_GROUP}/")]
    needed = NEEDED | dict.fromkeys(fields, OF_FIELD)
    needed |= dict.fromkeys(stations, (terms.STATION_PART_LABEL, terms.STATION_STATUS))
    needed |= {path: (terms.MESH_VERTICES, terms.MESH_FACES) for path in groups if path.startswith("model/mesh/")}
    for path, variables in needed.items():
        if path not in groups:
            raise DamagedError(f"is damaged: it has no group {path}")
        names = groups[path].variables
        together = [v for whole in TOGETHER if any(v.name in names for v in whole) for v in whole]
        if absent := [v.name for v in (*variables, *together) if v.name not in names]:
            raise DamagedError(f"is damaged: group /{path} has no {', '.join(absent)}")
    if tuple(_texts(file[terms.STATE])) != terms.STATES:
        raise DamagedError("is damaged: its states are not raw and corrected")
    for name in (terms.PART, terms.PAIR, terms.MEASURE):
        labels = _texts(file[name])
        if len(set(labels)) < len(labels) or "" in labels:
            raise DamagedError(f"is damaged: its {name} names are empty, or not unique")


def _check_values(group: netCDF4.Dataset) -> None:
    """Check the dimensions and types of the variables of an archive in a group, and read all but the realizations."""
    for name, stored in group.variables.items():
        variable = VARIABLES.get(name)
        if variable is None:
            continue
        where, is_text = f"{group.path.rstrip('/')}/{name}", stored.dtype.kind == "S"
        dims = stored.dimensions[:-1] if is_text else stored.dimensions
        if dims != variable.dims or is_text != (variable.kind is str):
            raise DamagedError(f"is damaged: {where} does not have the dimensions and the type that it has in an archive")
        if any(SIZES.get(dim, size) != size for dim, size in zip(dims, stored.shape[: len(dims)], strict=True)):
            raise DamagedError(f"is damaged: a dimension of {where} has the wrong size")
        if variable is terms.DECLARATION:
            _check_declaration(stored)
        elif is_text:
            _texts(stored)
        elif terms.REALIZATION not in dims:
            values = stored[...]
            if variable in KINDS_OF_SURFACES and not np.isin(values, range(-1, len(terms.SURFACE_KINDS))).all():
                raise DamagedError(f"is damaged: group {group.path} has surfaces of unknown kinds")
            if variable is terms.SUMMED_ROWS and not 0 <= values <= group.realizations:
                raise DamagedError("is damaged: its sums cover more realizations than it has")


def _check_stations(file: netCDF4.Dataset) -> None:
    """Check that the groups of stations name their parts, and that measures, pairs and parts belong to them."""
    groups = file[terms.STATIONS_GROUP].groups.values() if terms.STATIONS_GROUP in file.groups else ()
    parts, names = set(_texts(file[terms.PART])), {str(getattr(group, "station", "")) for group in groups}
    for group in groups:
        if not set(_texts(group[terms.STATION_PART])) <= parts:
            raise DamagedError(f"is damaged: group {group.path} has parts that the archive does not have")
    if any(not set(_texts(file[variable.name])) <= names for variable in terms.OF_STATIONS if groups):
        raise DamagedError("is damaged: a measure, pair or part belongs to a station that the archive does not have")


def _texts(stored: netCDF4.Variable) -> list[str]:
    """Return the texts of a variable, one for each entry of its dimensions."""
    letters = stored[...]
    texts = [row.tobytes().rstrip(b"\0").decode("utf-8") for row in letters.reshape(-1, letters.shape[-1])]
    for text in texts:
        _check_text(stored.name, text)
    return texts


def _check_declaration(stored: netCDF4.Variable) -> None:
    if stored.size > MAX_DECLARATION:
        raise DamagedError(f"is damaged: its declared model has {stored.size} bytes")
    try:
        declared = json.loads(stored[...].tobytes().rstrip(b"\0"))
    except (ValueError, RecursionError) as error:
        raise DamagedError(f"is damaged: its declared model is not JSON ({error})") from error
    if not isinstance(declared, dict):
        raise DamagedError("is damaged: its declared model is not a JSON object")


if __name__ == "__main__":
    limit_resources(int(sys.argv[2]), seconds=int(sys.argv[3]))
    sys.stdout.write(_fault(Path(sys.argv[1])))
