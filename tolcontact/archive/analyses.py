"""Analyses of a model in the archive of its run: each is a group statistics/NAME."""

import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

from tolcontact import vocabulary as terms
from tolcontact.archive.archive_lock import locked_archive
from tolcontact.archive.inspection import inspect
from tolcontact.archive.netcdf_library import open_netcdf
from tolcontact.archive.resuming import check_same_model
from tolcontact.archive.writer import replacing_archive
from tolcontact.compilation import Program
from tolcontact.errors import ArchiveError

if TYPE_CHECKING:
    import xarray as xr


def check_room_for(path: str | Path, record: terms.AnalysisRecord, program: Program) -> None:
    """Raise ArchiveError unless an archive is of the program's model and does not hold this analysis yet."""
    archive = Path(os.path.realpath(path))
    if not archive.is_file():
        raise ArchiveError(f'archive "{path}" does not exist; write one with: tolcontact run MODEL.py --out {path}')
    inspect(archive)
    with open_netcdf(archive, "r") as file:
        check_same_model(file, archive, program)
        if terms.ANALYSES_GROUP in file.groups and record.name in file[terms.ANALYSES_GROUP].groups:
            group = f"{terms.ANALYSES_GROUP}/{record.name}"
            raise ArchiveError(f'"{path}" already has {group}, which is not replaced; choose another archive')


def keep(path: str | Path, record: terms.AnalysisRecord, dataset: "xr.Dataset", program: Program) -> None:
    """Add an analysis to an archive of the same model (see `check_room_for`).

    The file is replaced only when all of the new one is written.
    """
    with locked_archive(path, resume=True) as archive:
        check_room_for(archive, record, program)
        with replacing_archive(archive) as part:
            shutil.copyfile(archive, part)
            stored = dataset.copy()
            for array in stored.variables.values():
                array.encoding = {"fletcher32": True} | ({"dtype": "S1"} if array.dtype.kind in "UO" else {})
            stored.to_netcdf(part, mode="a", group=f"{terms.ANALYSES_GROUP}/{record.name}", engine="netcdf4")
