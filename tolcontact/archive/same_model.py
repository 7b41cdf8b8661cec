"""Whether an archive is of the same model and the same run, for a run that continues it or an analysis that is added to it."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.archive.contact_values import contact_values
from tolcontact.archive.elastic_values import changed_body
from tolcontact.archive.settings import declaration
from tolcontact.compilation import Program
from tolcontact.errors import ArchiveError

# When a run is resumed: another version may have other second solvers, or words for correlations, which the model determines.
MAY_CHANGE = ("samples", "solver_second", terms.CORRELATIONS)
POINT_TOLERANCE = 1e-9  # mm: points may differ by rounding from one machine to the next


def check_same_run(file: netCDF4.Dataset, path: Path, program: Program, settings: Mapping[str, Any], surfaces: int) -> None:
    """Raise ArchiveError if the archive `file`, in the file `path`, is of another model or another run."""
    if not file.dimensions[terms.REALIZATION].isunlimited():
        raise ArchiveError(f'"{path}" is a copy that cannot grow; resume the archive that tolcontact wrote')
    check_same_model(file, path, program)
    _check_same_distributions(file, path, program)
    for name, value in settings.items():
        was = getattr(file, name, None)
        if name not in MAY_CHANGE and was != value:
            raise ArchiveError(
                f'"{path}" was run with {name} = {was}, now it is {value}; resume with the same, or write to a new file'
            )
    room = len(file["surface"].dimensions[terms.CHECKED])
    if room != surfaces:
        raise ArchiveError(f'"{path}" was begun with surfaces = {room}, now it is {surfaces}; resume with the same')


def check_same_model(file: netCDF4.Dataset, path: Path, program: Program) -> None:
    """Raise ArchiveError if the archive `file`, in the file `path`, is of another model."""
    if _comparable(str(file["model"][terms.DECLARATION.name][...])) != _comparable(declaration(program)):
        raise ArchiveError(f'"{path}" contains another model than this one; write to a new file')
    for part in program.nominal.last_parts:
        if not _is_equal(file[f"field/{terms.group_of(part.name)}"][terms.FIELD_VERTICES.name], part.vertices):
            raise ArchiveError(f'"{path}": part "{part.name}" had another shape (was its mesh replaced?); write to a new file')
    if changed := changed_body(file, program):
        raise ArchiveError(f'"{path}": the stiffness of part "{changed}" was another one; write to a new file')
    for variable, values in contact_values(program).items():
        if variable in (terms.BOUNDED, terms.PLANE_ERROR):  # they follow from the method, which is compared separately
            continue
        stored = file["contact"].variables.get(variable.name)
        if stored is None or not (variable.kind is str or _is_equal(stored, values)):  # texts are in the declaration
            raise ArchiveError(f'"{path}": its contact points differ (it was written by {file.versions}); write to a new file')


def _check_same_distributions(file: netCDF4.Dataset, path: Path, program: Program) -> None:
    """Raise ArchiveError if the archive `file`, in the file `path`, describes a distribution otherwise than this version."""
    for contributor, was in zip(program.draws.contributors, file["sample"][terms.DISTRIBUTION.name][...], strict=True):
        if str(was) != contributor.description:
            raise ArchiveError(
                f'"{path}": contributor "{contributor.label}" was drawn as "{was}", now as "{contributor.description}"; '
                "write to a new file"
            )


def _comparable(declared: str) -> Any:
    """Return a declaration without what does not affect results: the lines of the script, and the title block."""
    ignored = ("declared_at", "title_block")
    return json.loads(declared, object_hook=lambda item: {key: item[key] for key in item if key not in ignored})


def _is_equal(stored: netCDF4.Variable, values: Any) -> bool:
    return stored.shape == np.shape(values) and np.allclose(stored[...], values, rtol=0, atol=POINT_TOLERANCE, equal_nan=True)
