"""What was asked of a model beside its run, kept in the archive: group statistics/NAME."""

import os
import shutil
from pathlib import Path

import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.archive.archive_lock import taken
from tolcontact.archive.inspection import inspect
from tolcontact.archive.resuming import check_same_model
from tolcontact.archive.writer import opened_locked, replacing
from tolcontact.checksums import crc32
from tolcontact.compilation import Program
from tolcontact.errors import ArchiveError

CHECKED = {variable.name: variable for variable in terms.ANALYZED}


def check_room_for(path: str | Path, name: str, program: Program) -> None:
    """Raise ArchiveError unless an archive is of that model, and has no analysis of that name yet."""
    real = Path(os.path.realpath(path))
    if not real.is_file():
        raise ArchiveError(f'archive "{path}" does not exist; write one with: tolcontact run MODEL.py --out {path}')
    inspect(real)
    with opened_locked(real, "r") as file:
        check_same_model(file, real, program)
        if terms.ANALYSES in file.groups and name in file[terms.ANALYSES].groups:
            raise ArchiveError(f'"{path}" has {terms.ANALYSES}/{name} already, which is not replaced; choose another archive')


def keep(path: str | Path, name: str, found: xr.Dataset, program: Program) -> None:
    """Add an analysis to an archive of the same model; see check_room_for. The file is as it was until all of it is written."""
    with taken(path, resume=True) as real:
        check_room_for(real, name, program)
        with replacing(real) as part:
            shutil.copyfile(real, part)
            stored = found.copy()
            for variable in stored.variables.values():
                variable.encoding = {"dtype": "S1"} if variable.dtype.kind in "UO" else {}
            for each in stored.data_vars:
                stored[each].attrs[terms.CHECKSUM] = crc32(CHECKED[str(each)], stored[each].values)
            stored.to_netcdf(part, mode="a", group=f"{terms.ANALYSES}/{name}", engine="netcdf4")
