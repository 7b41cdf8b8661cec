"""Stiffness matrices in the files of finite-element programs, by the content of the file.

A freedom is a pair: the number of a node, and 1 to 3 for its displacements x, y, z, or 4 to 6 for its rotations. Amplitudes of
modes are freedoms 0.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from scipy import io, sparse

from tolcontact.arrays import Array, Float, Int
from tolcontact.elasticity.abaqus_matrix import abaqus_matrix, listed_matrix, lists_entries
from tolcontact.elasticity.dmig import dmig_matrix
from tolcontact.errors import GeometryFault
from tolcontact.input_files import fault_of
from tolcontact.tables import text_of

MAX_BYTES, MAX_FREEDOMS = 1 << 30, 6000  # dense: 288 MB
START_BYTES = 1 << 24  # nodes and coordinate systems may stand before a matrix
_KINDS = "an .npz file with K, Matrix Market, Nastran DMIG, or a substructure or matrix output of Abaqus or CalculiX"
_BULK_DATA = rb"^(BEGIN (SUPER|BULK)|(GRID|SPOINT|CORD2R|EXTRN|DTI)\b)"


@dataclass(frozen=True, eq=False)
class StiffnessFile:
    """A stiffness matrix as its file states it.

    freedoms   node number and direction of each row; None if rows are x, y, z of each node in the order of the table
    """

    path: Path
    matrix: Float[Array, "row row"]
    freedoms: Int[Array, "row 2"] | None


def read_stiffness(path: Path) -> StiffnessFile:
    """Return the matrix in a file. Raises GeometryFault if it cannot be read, or is not square."""
    if fault := fault_of(path, MAX_BYTES):
        raise GeometryFault(f'stiffness file "{path}" {fault}; expected {_KINDS}')
    try:
        freedoms, matrix = _reader(path)(path)
    except (OSError, ValueError, IndexError, BadZipFile) as error:
        raise GeometryFault(f'stiffness file "{path}" cannot be read: {error}; expected {_KINDS}') from error
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not len(matrix):
        raise GeometryFault(f'stiffness file "{path}" holds a matrix {matrix.shape}; expected a square one')
    if not np.isfinite(matrix).all():
        raise GeometryFault(f'stiffness file "{path}" holds numbers that are not finite; export it again')
    return StiffnessFile(path, matrix, freedoms)


Content = tuple["np.ndarray | None", np.ndarray]


def _reader(path: Path) -> Callable[[Path], Content]:
    with path.open("rb") as file:
        start = file.read(START_BYTES)
    if start[:2] == b"PK":
        return _npz
    if start[:14].lower() == b"%%matrixmarket":
        return _matrix_market
    if re.search(rb"^DMIG", start, re.MULTILINE | re.IGNORECASE):
        return lambda path: dmig_matrix(text_of(path, MAX_BYTES), MAX_FREEDOMS)
    if re.search(rb"^\*USER ELEMENT", start, re.MULTILINE | re.IGNORECASE):
        return lambda path: abaqus_matrix(text_of(path, MAX_BYTES), MAX_FREEDOMS)
    if lists_entries(start):
        return lambda path: listed_matrix(text_of(path, MAX_BYTES), MAX_FREEDOMS)
    if re.search(_BULK_DATA, start, re.MULTILINE | re.IGNORECASE):
        raise ValueError(
            "it is bulk data of Nastran without a matrix; punch it with EXTSEOUT(STIFFNESS,DMIGPCH) or PARAM,EXTOUT,DMIGPCH"
        )
    raise ValueError("its kind is not recognized")


def _npz(path: Path) -> Content:
    with np.load(path, allow_pickle=False) as content:
        names = [name for name in content.files if name.upper() == "K"]
        if names:
            return None, np.array(content[names[0]], dtype=float)
        if "shape" not in content.files:
            raise ValueError(f"it holds {', '.join(content.files) or 'nothing'}, and no K")
    return None, _dense(sparse.load_npz(path))


def _matrix_market(path: Path) -> Content:
    rows, _, _, _, field, _ = io.mminfo(path)
    if field == "complex":
        raise ValueError("its numbers are complex")
    _check_size(rows)
    matrix = io.mmread(path)
    return None, _dense(matrix) if sparse.issparse(matrix) else np.asarray(matrix, dtype=float)


def _dense(matrix: "sparse.sparray") -> np.ndarray:
    _check_size(matrix.shape[0])
    return matrix.toarray().astype(float)


def _check_size(rows: int) -> None:
    if rows > MAX_FREEDOMS:
        raise ValueError(f"it has {rows} freedoms, at most {MAX_FREEDOMS} are supported: condense it to the nodes that matter")
