"""The group `elastic` of an archive: from its loads and flexibility, gaps and measures of bent parts can be computed again."""

import hashlib
from pathlib import Path

import netCDF4
import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.archive.contact_values import Values
from tolcontact.compilation import Program
from tolcontact.discretization import Nominal, NominalPart
from tolcontact.poses import AT_REST


def elastic_values(program: Program) -> Values:
    """Return the loads between elastic parts, and the flexibility of these parts."""
    nominal, count = program.nominal, len(program.nominal.loads)
    starts = np.cumsum([0, *(len(pair.P_m) for pair in nominal.pairs)])
    pairs, points = nominal.loads.T
    C, opening = np.zeros((count, count)), np.zeros(count)
    for flexibility in (compiled.qp.flexibility for compiled in program.groups):
        if flexibility is not None:
            at, load_rows = flexibility.loads, flexibility.load_rows
            C[np.ix_(at, at)], opening[at] = flexibility.C[np.ix_(load_rows, load_rows)], flexibility.opening[load_rows]
    by_load, by_forces = _measured(program)
    parts = _elastic_parts(nominal)
    return {
        terms.POINT_OF_LOAD: starts[pairs] + points,
        terms.WELD_OF_LOAD: [_weld_row(nominal, k, point) for k, point in nominal.loads.tolist()],
        terms.HOLDS: [nominal.pairs[k].holds for k in pairs],
        terms.FLEXIBILITY: C,
        terms.OPENING: opening,
        terms.MEASURED_BY_LOAD: by_load.T,
        terms.MEASURED_BY_FORCES: by_forces,
        terms.ELASTIC_LABEL: [part.name for part in parts],
        terms.ELASTIC_SOURCE: [str(part.part.elasticity) for part in parts],
        terms.ELASTIC_HASH: [_hash(part) for part in parts],
    }


def _weld_row(nominal: Nominal, pair: int, point: int) -> int:
    """Return the number of the weld row whose gap a point of a pair keeps, -1 for none."""
    offsets, first = nominal.pairs[pair].offsets, len(nominal.contributors)
    column = offsets.columns[offsets.matrix[:, point] != 0]
    return int(column[0]) - first if column.size and column[0] >= first else -1


def _measured(program: Program) -> tuple[np.ndarray, np.ndarray]:
    """Return the elastic change of measures by the unit of each load (load, measure), and by the constant forces (measure,)."""
    assert program.observe_bent is not None
    loads = np.concatenate([np.zeros((1, len(program.nominal.loads))), np.eye(len(program.nominal.loads))])
    poses = np.tile(AT_REST, (len(loads), len(program.nominal.parts)))
    deviations = np.zeros((len(loads), len(program.nominal.contributors)))
    values = program.observe_bent(poses=poses, deviations=deviations, loads=loads)["measured"]
    return values[1:] - values[0], values[0] - program.nominal_measures


def _elastic_parts(nominal: Nominal) -> list[NominalPart]:
    """Return the elastic parts in their last stations."""
    return [part for part in nominal.last_parts if part.part.elasticity is not None]


def changed_body(file: netCDF4.Dataset, program: Program) -> str:
    """Return the name of an elastic part whose stiffness differs from the one in the archive; empty if none does."""
    parts = _elastic_parts(program.nominal)
    stored = file[terms.ELASTIC_GROUP][terms.ELASTIC_HASH.name][...] if parts else []
    return next((part.name for part, was in zip(parts, stored, strict=True) if str(was) != _hash(part)), "")


def _hash(part: NominalPart) -> str:
    """Return a hash of what the stiffness of a part is computed from."""
    elastic = part.part.elasticity
    assert elastic is not None
    numbers = elastic.E, elastic.nu, elastic.density, elastic.pad
    digest = hashlib.sha256(repr(numbers if elastic.element_size is None else (*numbers, elastic.element_size)).encode())
    for file in (elastic.stiffness, elastic.nodes):
        digest.update(Path(file).read_bytes() if file is not None else np.asarray(part.mesh.vertices).tobytes())
    return digest.hexdigest()
