"""Inspection of a file before anything in it is trusted: it has to be an undamaged archive.

The netCDF library itself can fail on a damaged file, or never return. So a separate process inspects the file first (this
module, as a script), with limits on memory and time. It reads all but the realizations, whose checksums are checked when they
are read.
"""

import json
import math
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.checksums import crc32
from tolcontact.child import ChildDiedError, limit_resources, run_child
from tolcontact.errors import ArchiveError, shown
from tolcontact.vocabulary import ArchiveVariable, archive, variation

MAX_SECONDS, SECONDS_PER_GB = 20.0, 20.0  # of processor time
MEMORY = 1 << 30  # in addition to four times the size of the file
MAX_DEFLATION = 1032  # zlib compresses data no further
MAX_DECLARATION = 1 << 26  # bytes of a declared model
MAX_TEXT = 1 << 20  # letters of an attribute
SIZES = {
    terms.STATE: 2,
    terms.AXIS: 3,
    terms.BODY_AXIS: 3,
    terms.CORNER: 3,
    terms.COMPONENT: 4,
    terms.BOUND: 2,
    terms.LINE_END: 2,
}
GROUPS = ("model", "contact", "sample", "surface", "field")
LABELS = (terms.PART, terms.PAIR, terms.MEASURE, terms.ROW_VARIABLE)
CHANGES_VALUES = ("scale_factor", "add_offset", "missing_value", "_Unsigned", "calendar")  # when xarray reads them
TEXT_ATTRIBUTES = ("title", "history", "versions", "resolution", "objective", "active_set", "search")  # that a summary repeats
NEEDED = {  # variables of groups that summaries and models are read from
    "": (
        terms.MEASURE_NOMINAL, terms.MEASURE_TOLERANCE, terms.MEASURE_UNITS, terms.LOWER_LIMIT, terms.UPPER_LIMIT,
        terms.MEASURE_ACCURACY, terms.QUANTITY, terms.ROW_CHECKSUM, terms.ROW_VARIABLE_LABEL, terms.SUMMED_ROWS,
    ),
    "contact": (terms.MOVING_PART, terms.REFERENCE_PART, *terms.TOUCHING, terms.GROUP_CHECKSUM),
    "sample": (
        terms.CONTRIBUTOR_LABEL, terms.CONTRIBUTOR_SOURCE, terms.CONTRIBUTOR_UNITS, terms.TOLERANCE_RANGE, terms.DISTRIBUTION,
        terms.LOCATOR_LABEL, terms.LOCATOR_POINT, terms.LOCATOR_DIRECTION, terms.ONE_SIDED,
    ),
    "surface": (*terms.SURFACE, terms.GROUP_CHECKSUM),
    "model": (terms.DECLARATION,),
}  # fmt: skip
OF_FIELD = (terms.FIELD_VERTICES, terms.FIELD_FACES, *terms.FIELDS, terms.GROUP_CHECKSUM)
OF_MESH = (terms.MESH_VERTICES, terms.MESH_FACES)
CHECKED_GROUPS = ("", "model", "contact", "sample", "surface", "field", terms.STATIONS_GROUP)
VARIABLES = {  # by name; no two variables of an archive differ that have one name
    variable.name: variable
    for module in (archive, variation)
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


class DamagedError(Exception):
    """A fault of a file."""


def check_archive(path: Path) -> None:
    """Raise ArchiveError if there is no file at a path, or it fails the inspection."""
    if not path.is_file():
        raise ArchiveError(f'archive "{path}" does not exist; write one with: tolcontact run MODEL.py --out {path}')
    inspect(path)


def inspect(path: Path) -> None:
    """Raise ArchiveError if a file is not an archive, is damaged, or claims what it cannot hold."""
    check_name(path)
    seconds = math.ceil(MAX_SECONDS + SECONDS_PER_GB * path.stat().st_size / 1e9)
    try:
        fault = run_child(Path(__file__), os.fspath(path), str(seconds), seconds=seconds)
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
        groups = list(_groups(file))
        for group in groups:
            _check_group(group, path.stat().st_size)
        _check_archive(file, groups)
        for group in groups:
            _check_sums(group)
        _check_declaration(file)
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


def _groups(group: netCDF4.Dataset, depth: int = 0) -> Iterator[netCDF4.Dataset]:
    if depth > 4 or len(group.groups) > 2 * len(_top(group).dimensions.get(terms.PART, ())) + 64:
        raise DamagedError("is not an archive of tolcontact: its groups are nested too deeply, or too many")
    yield group
    for child in group.groups.values():
        yield from _groups(child, depth + 1)


def _top(group: netCDF4.Dataset) -> netCDF4.Dataset:
    return group if group.parent is None else _top(group.parent)


def _check_group(group: netCDF4.Dataset, size: int) -> None:
    for name in (*group.groups, *group.variables, *group.dimensions):
        _check_text("a name", name)
    _check_attributes(group)
    for name, variable in group.variables.items():
        where = f"{group.path.rstrip('/')}/{name}"
        is_compound = isinstance(variable.datatype, netCDF4.VLType | netCDF4.CompoundType | netCDF4.EnumType)
        if is_compound or not (variable.dtype is str or np.dtype(variable.dtype).kind in "iufS"):
            raise DamagedError(f"is not an archive of tolcontact: {where} holds neither numbers nor text")
        itemsize = 8 if variable.dtype is str else np.dtype(variable.dtype).itemsize
        is_packed = any((variable.filters() or {}).get(name) for name in ("zlib", "szip", "zstd", "bzip2", "blosc"))
        if math.prod(variable.shape) * itemsize > size * (MAX_DEFLATION if is_packed else 1):
            raise DamagedError(f"is damaged: {where} claims {_times(variable.shape)} values, more than the file can hold")
        _check_attributes(variable)


def _times(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape))


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
    if shown(text) != text:
        raise DamagedError(f"is damaged: {name} holds control characters ({shown(text)[:60]})")


def _check_archive(file: netCDF4.Dataset, groups: list[netCDF4.Dataset]) -> None:
    missing = [v.name for v in terms.ROWS if v not in terms.POSES and v.name not in file.variables]
    missing += [group for group in GROUPS if group not in file.groups]
    missing += [name for name in TEXT_ATTRIBUTES if not isinstance(getattr(file, name, None), str)]
    if missing:
        raise DamagedError(f"is not an archive of tolcontact: it has no {', '.join(missing)}")
    accuracy, samples = getattr(file, "solver_accuracy", None), getattr(file, "samples", None)
    if not (isinstance(accuracy, float | np.floating) and isinstance(samples, int | np.integer) and 0 <= samples < 2**63):
        raise DamagedError("is damaged: its attributes solver_accuracy and samples are not numbers")
    for group in groups:
        for stored, variable in _known_variables(group):
            _check_variable(group, stored, variable)
    for group in file["model"].groups["mesh"].groups.values() if "mesh" in file["model"].groups else ():
        _need(group, OF_MESH)
        _need_together(group, terms.KNOWN_SURFACES)
    for name in LABELS:
        if name in file.variables:
            labels = _texts(file[name])
            if len(set(labels)) < len(labels) or "" in labels:
                raise DamagedError(f"is damaged: its {name} names are empty, or not unique")
    rows = getattr(file, "block_rows", 0)
    if not (isinstance(rows, int | np.integer) and 0 < rows <= terms.BLOCK_ROWS):
        raise DamagedError(f"is damaged: its blocks have {rows!r} realizations")
    _check_needed(file)


def _known_variables(group: netCDF4.Dataset) -> list[tuple[netCDF4.Variable, ArchiveVariable]]:
    """Return the stored variables of a group that the vocabulary defines, except in groups of analyses."""
    if group.path.split("/")[1] not in CHECKED_GROUPS:
        return []
    return [(stored, VARIABLES[name]) for name, stored in group.variables.items() if name in VARIABLES]


def _check_variable(group: netCDF4.Dataset, stored: netCDF4.Variable, variable: ArchiveVariable) -> None:
    where = f"{group.path.rstrip('/')}/{variable.name}"
    text = stored.dtype is str or np.dtype(stored.dtype).kind == "S"
    dims = stored.dimensions[:-1] if text and stored.dtype is not str else stored.dimensions
    if dims != variable.dims or text != (variable.kind is str):
        raise DamagedError(f"is damaged: {where} does not have the dimensions and the type that it has in an archive")
    if text or variable is terms.NUMBERS:
        return
    wrong = [d for d, size in zip(dims, stored.shape, strict=True) if SIZES.get(d, size) != size]
    if wrong:
        raise DamagedError(f"is damaged: dimension {wrong[0]} of {where} has the wrong size")


def _check_needed(file: netCDF4.Dataset) -> None:
    """Check that everything is there that summaries and models are read from."""
    _need_together(file["contact"], terms.ROUND)
    if any(variable.name in file["contact"].variables for variable in terms.FEATURE_FACES):
        _need(file["contact"], terms.FEATURE_FACES)
    if any(variable.name in file["contact"].variables for variable in terms.FORMS):
        _need(file["contact"], terms.FORMS)
    if any(variable.name in file["contact"].variables for variable in terms.TANGENTS):
        _need(file["contact"], (*terms.FORMS, *terms.TANGENTS))
    for group, needed in NEEDED.items():
        _need(file[group] if group else file, needed)
    summed = np.ma.getdata(file[terms.SUMMED_ROWS.name][...])
    max_rows = len(file.dimensions[terms.BLOCK]) * int(file.block_rows)
    if (summed < terms.UNFINISHED).any() or (summed > max_rows).any():
        raise DamagedError("is damaged: its checkpoints cover more realizations than it has")
    if tuple(_texts(file[terms.STATE])) != terms.STATES:
        raise DamagedError("is damaged: its states are not raw and corrected")
    _check_stations(file)
    for part in _texts(file[terms.PART]):
        name = terms.group_of(part)
        if name not in file["field"].groups:
            raise DamagedError(f'is damaged: it has no field for part "{part}"')
        _need(file["field"][name], OF_FIELD)


def _check_stations(file: netCDF4.Dataset) -> None:
    """Check that the groups of stations name their parts, and that measures, pairs and parts belong to them."""
    if terms.STATIONS_GROUP not in file.groups:
        return
    _need(file, terms.OF_STATIONS)
    parts, names = set(_texts(file[terms.PART])), set[str]()
    for group in file[terms.STATIONS_GROUP].groups.values():
        _need(group, (terms.STATION_PART_LABEL, terms.STATION_STATUS))
        names.add(str(getattr(group, "station", "")))
        if not set(_texts(group[terms.STATION_PART])) <= parts:
            raise DamagedError(f"is damaged: group {group.path} has parts that the archive does not have")
    if any(not set(_texts(file[variable.name])) <= names for variable in terms.OF_STATIONS):
        raise DamagedError("is damaged: a measure, pair or part belongs to a station that the archive does not have")


def _need(group: netCDF4.Dataset, needed: tuple[ArchiveVariable, ...]) -> None:
    missing = [variable.name for variable in needed if variable.name not in group.variables]
    if missing:
        raise DamagedError(f"is damaged: group {group.path} has no {', '.join(missing)}")


def _need_together(group: netCDF4.Dataset, variables: tuple[ArchiveVariable, ...]) -> None:
    """Check that a group has all of these variables or none; the second variable holds kinds of surfaces."""
    if any(variable.name in group.variables for variable in variables):
        _need(group, variables)
        kinds = np.ma.getdata(group[variables[1].name][...])
        if ((kinds < -1) | (kinds >= len(terms.SURFACE_KINDS))).any():
            raise DamagedError(f"is damaged: group {group.path} has surfaces of unknown kinds")


def _texts(stored: netCDF4.Variable) -> list[str]:
    """Return the texts of a variable, one for each entry of its dimensions."""
    if stored.dtype is str:
        texts = [str(text) for text in np.ravel(stored[...])]
    else:
        stored.set_auto_chartostring(False)
        letters = np.ma.getdata(stored[...])
        rows = letters.reshape(math.prod(letters.shape[:-1]), letters.shape[-1])
        texts = [row.tobytes().rstrip(b"\0").decode("utf-8") for row in rows]
    for text in texts:
        _check_text(stored.name, text)
    return texts


def _check_sums(group: netCDF4.Dataset) -> None:
    """Check the stored checksums of variables that are written once, and of groups that are overwritten together."""
    kind = group.path.split("/")[1]
    for stored, variable in _known_variables(group):
        if terms.CHECKSUM in stored.ncattrs():
            values = _declaration(stored) if variable is terms.DECLARATION else _values(stored, variable)
            if crc32(variable, values) != int(stored.getncattr(terms.CHECKSUM)):
                raise DamagedError(f"is damaged: {group.path.rstrip('/')}/{variable.name} is not what was written")
    if terms.GROUP_CHECKSUM.name in group.variables:
        expected, checksum = int(group[terms.GROUP_CHECKSUM.name][...]), 0
        for variable in {"surface": terms.SURFACE, "contact": terms.TOUCHING}.get(kind, terms.FIELDS):
            checksum = crc32(variable, _values(group[variable.name], variable), checksum)
        if expected not in (terms.UNFINISHED, checksum):
            raise DamagedError(f"is damaged: group {group.path} does not hold what was written")


def _values(stored: netCDF4.Variable, variable: ArchiveVariable) -> Any:
    return _texts(stored) if variable.kind is str else np.ma.getdata(stored[...])


def _declaration(stored: netCDF4.Variable) -> str:
    if math.prod(stored.shape) > MAX_DECLARATION:
        raise DamagedError(f"is damaged: its declared model has {math.prod(stored.shape)} bytes")
    if stored.dtype is str:
        return str(stored[...])
    stored.set_auto_chartostring(False)
    return bytes(np.ma.getdata(stored[...]).tobytes().rstrip(b"\0")).decode("utf-8")


def _check_declaration(file: netCDF4.Dataset) -> None:
    try:
        declared = json.loads(_declaration(file["model"][terms.DECLARATION.name]))
    except (ValueError, RecursionError) as error:
        raise DamagedError(f"is damaged: its declared model is not JSON ({error})") from error
    if not isinstance(declared, dict):
        raise DamagedError("is damaged: its declared model is not a JSON object")


if __name__ == "__main__":
    _file = Path(sys.argv[1])
    limit_resources(MEMORY + 4 * _file.stat().st_size, seconds=int(sys.argv[2]))
    sys.stdout.write(_fault(_file))
