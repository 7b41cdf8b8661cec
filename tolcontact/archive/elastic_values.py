"""The group `elastic` of an archive: from its loads and flexibility, gaps and measures of bent parts can be computed again."""

import hashlib
from collections.abc import Collection
from pathlib import Path

import netCDF4
import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.archive.variables import Definitions, define
from tolcontact.compilation import Program
from tolcontact.discretization import Nominal, NominalPart
from tolcontact.poses import AT_REST
from tolcontact.vocabulary import ArchiveVariable


def write_elastic(new: Definitions, group: netCDF4.Group, program: Program, kept: Collection[ArchiveVariable]) -> None:
    """Write the loads between elastic parts and their flexibility, and define the variables of realizations that are `kept`."""
    nominal, count = program.nominal, len(program.nominal.loads)
    group.createDimension(terms.LOADS, count)
    group.createDimension(terms.WELD_ROWS, nominal.input_count - len(nominal.contributors))
    for variable in terms.ELASTIC_ROWS:
        if variable in kept:
            define(group, variable)
    starts = np.cumsum([0, *(len(pair.P_m) for pair in nominal.pairs)])
    pairs, points = nominal.loads.T
    new.add(group, terms.POINT_OF_LOAD, starts[pairs] + points)
    new.add(group, terms.WELD_OF_LOAD, [_weld_row(nominal, k, point) for k, point in nominal.loads.tolist()])
    new.add(group, terms.HOLDS, [nominal.pairs[k].holds for k in pairs])
    C, opening = np.zeros((count, count)), np.zeros(count)
    for flexibility in (compiled.qp.flexibility for compiled in program.groups):
        if flexibility is not None:
            at, rows = flexibility.loads, flexibility.load_rows
            C[np.ix_(at, at)], opening[at] = flexibility.C[np.ix_(rows, rows)], flexibility.opening[rows]
    new.add(group, terms.FLEXIBILITY, C)
    new.add(group, terms.OPENING, opening)
    by_load, by_forces = _measured(program)
    new.add(group, terms.MEASURED_BY_LOAD, by_load.T)
    new.add(group, terms.MEASURED_BY_FORCES, by_forces)
    parts = [part for part in nominal.last_parts if part.part.elasticity is not None]
    new.add(group, terms.ELASTIC_LABEL, [part.name for part in parts])
    new.add(group, terms.ELASTIC_SOURCE, [str(part.part.elasticity) for part in parts])
    new.add(group, terms.ELASTIC_HASH, [_hash(part) for part in parts])


def _weld_row(nominal: Nominal, pair: int, point: int) -> int:
    """Return the number of the weld row whose gap a point of a pair keeps, -1 for none."""
    offsets, first = nominal.pairs[pair].offsets, len(nominal.contributors)
    column = offsets.columns[offsets.matrix[:, point] != 0]
    return int(column[0]) - first if column.size and column[0] >= first else -1


def changed_body(file: netCDF4.Dataset, program: Program) -> str:
    """Return the name of an elastic part whose stiffness differs from the one in the archive; empty if none does."""
    parts = [part for part in program.nominal.last_parts if part.part.elasticity is not None]
    stored = file[terms.ELASTIC_GROUP][terms.ELASTIC_HASH.name][...] if parts else []
    return next((part.name for part, was in zip(parts, stored, strict=True) if str(was) != _hash(part)), "")


def _measured(program: Program) -> tuple[np.ndarray, np.ndarray]:
    """Return the elastic change of measures by the unit of each load (load, measure), and by the constant forces (measure,)."""
    assert program.observe_bent is not None
    loads = np.concatenate([np.zeros((1, len(program.nominal.loads))), np.eye(len(program.nominal.loads))])
    poses = np.tile(AT_REST, (len(loads), len(program.nominal.parts)))
    deviations = np.zeros((len(loads), len(program.nominal.contributors)))
    values = program.observe_bent(poses=poses, deviations=deviations, loads=loads)["measured"]
    return values[1:] - values[0], values[0] - program.nominal_measures


def _hash(part: NominalPart) -> str:
    elastic = part.part.elasticity
    assert elastic is not None
    numbers = elastic.E, elastic.nu, elastic.density, elastic.pad
    digest = hashlib.sha256(repr(numbers if elastic.element_size is None else (*numbers, elastic.element_size)).encode())
    for file in (elastic.stiffness, elastic.nodes):
        digest.update(Path(file).read_bytes() if file is not None else np.asarray(part.mesh.vertices).tobytes())
    return digest.hexdigest()
