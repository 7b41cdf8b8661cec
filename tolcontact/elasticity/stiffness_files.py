"""Stiffness matrices in the files of finite-element programs, by the content of the file.

A freedom is a pair: the number of a node, and 1 to 3 for its displacements x, y, z, or 4 to 6 for its rotations. Amplitudes of
modes are freedoms 0.
"""

import re
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from scipy import io, sparse

from tolcontact.arrays import Array, Float, Int
from tolcontact.errors import GeometryFault
from tolcontact.input_files import fault_of
from tolcontact.tables import text_of

MAX_BYTES, MAX_FREEDOMS = 1 << 30, 6000  # dense: 288 MB
START_BYTES = 1 << 24  # nodes and coordinate systems may stand before a matrix
SYMMETRIC, SQUARE = "6", "1"  # forms of DMIG
LABELS, ROWS = 5, 3  # numbers on a line of FORMAT=MATRIX INPUT, with nodes and directions, and of FORMAT=COORDINATE
HELD = 1e30  # Abaqus marks freedoms with a boundary condition by 1e36 on the diagonal
_KINDS = "an .npz file with K, Matrix Market, Nastran DMIG, or a substructure or matrix output of Abaqus or CalculiX"
_BULK_DATA = rb"^(BEGIN (SUPER|BULK)|(GRID|SPOINT|CORD2R|EXTRN|DTI)\b)"
_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]?([+-]\d+)|[eEdD](\d+))?")
_KEYWORD = re.compile(r"^\*(?!\*)", re.MULTILINE)
_LABELLED = re.compile(rb"\s*-?\d+\s*,\s*\d+\s*,\s*-?\d+\s*,\s*\d+\s*,\s*[-+\d.]+(?:[eEdD][-+]?\d+)?\s*")
_LISTED = re.compile(rb"\s*\d+[\s,]+\d+[\s,]+[-+]?\d*\.\d*(?:[eEdD][-+]?\d+)?\s*")
_NODES = re.compile(r"\*\*[\s\d,-]*\d[\s\d,-]*$")

# The node number and the direction of each row, or None if rows are x, y, z of each node in the order of the table; the matrix.
Content = tuple[Int[Array, "row 2"] | None, Float[Array, "row row"]]


def read_stiffness(path: Path) -> Content:
    """Return the freedoms and the matrix in a file. Raises GeometryFault if it cannot be read, or is not square."""
    if fault := fault_of(path, MAX_BYTES):
        raise GeometryFault(f'stiffness file "{path}" {fault}; expected {_KINDS}')
    try:
        freedoms, matrix = _content(path)
    except (OSError, ValueError, IndexError, BadZipFile) as error:
        raise GeometryFault(f'stiffness file "{path}" cannot be read: {error}; expected {_KINDS}') from error
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not len(matrix):
        raise GeometryFault(f'stiffness file "{path}" holds a matrix {matrix.shape}; expected a square one')
    if not np.isfinite(matrix).all():
        raise GeometryFault(f'stiffness file "{path}" holds numbers that are not finite; export it again')
    return freedoms, matrix


def _content(path: Path) -> Content:
    with path.open("rb") as file:
        start = file.read(START_BYTES)
    if start[:2] == b"PK":
        return _npz(path)
    if start[:14].lower() == b"%%matrixmarket":
        return _matrix_market(path)
    if re.search(rb"^DMIG", start, re.MULTILINE | re.IGNORECASE):
        return _dmig(text_of(path, MAX_BYTES))
    if re.search(rb"^\*USER ELEMENT", start, re.MULTILINE | re.IGNORECASE):
        return _user_element(text_of(path, MAX_BYTES))
    # Or the first line that is no comment is an entry of *MATRIX OUTPUT.
    first = next((line for line in start.split(b"\n") if line.strip() and not line.startswith(b"**")), b"")
    if _LABELLED.fullmatch(first) or _LISTED.fullmatch(first):
        return _matrix_output(text_of(path, MAX_BYTES))
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


def _dmig(text: str) -> Content:
    """Return the only DMIG matrix of Nastran whose name begins with K; names that begin with K4 are structural damping.

    Raises ValueError if there is none, or if it is complex, rectangular or damaged.
    """
    headers, columns = dict[str, list[str]](), list[list[str]]()
    for fields in _dmig_entries(text):
        if fields[1] == "0":
            headers[fields[0]] = fields
        else:
            columns.append(fields)
    names = [name for name in headers if len(headers) == 1 or (name.startswith("K") and not name.startswith("K4"))]
    if len(names) != 1:
        raise ValueError(f"it has the DMIG matrices {', '.join(headers) or 'none'}; expected one whose name begins with K")
    form, kind = headers[names[0]][2:4]
    if form not in (SYMMETRIC, SQUARE) or kind not in ("1", "2"):
        raise ValueError(f"DMIG {names[0]} is of form {form} and type {kind}; expected 6 or 1, and real numbers (1 or 2)")
    entries = dict[tuple[tuple[int, int], tuple[int, int]], float]()
    for fields in columns:
        if fields[0] == names[0]:
            column = int(fields[1]), int(fields[2])
            for k in range(4, len(fields), 4):
                if fields[k]:
                    row = int(fields[k]), int(fields[k + 1])
                    entries[row, column] = _real(fields[k + 2])
    freedoms = sorted({freedom for pair in entries for freedom in pair})
    if len(freedoms) > MAX_FREEDOMS:
        raise ValueError(f"DMIG {names[0]} has {len(freedoms)} freedoms, at most {MAX_FREEDOMS} are supported: condense it")
    index = {freedom: k for k, freedom in enumerate(freedoms)}
    matrix = np.zeros((len(freedoms), len(freedoms)))
    for (row, column), value in entries.items():
        matrix[index[row], index[column]] = value
        if form == SYMMETRIC:
            matrix[index[column], index[row]] = value
    return np.array(freedoms), matrix


def _dmig_entries(text: str) -> list[list[str]]:
    """Return the fields of each DMIG entry after its keyword; the lines that continue an entry are joined to it."""
    entries, is_dmig = list[list[str]](), False
    for content in filter(None, (line.split("$")[0].rstrip() for line in text.split("\n"))):
        fields = _fields(content)
        if content[:1].isalpha():
            is_dmig = fields[0].rstrip("*").upper() == "DMIG"
            if is_dmig:
                entries.append(fields[1:])
        elif is_dmig:
            entries[-1] += fields[1:]
    return entries


def _fields(line: str) -> list[str]:
    """Return the fields of a line: its keyword or mark, and 4 large or 8 small ones."""
    if "," in line:
        fields = [field.strip() for field in line.split(",")]
        return [*fields, *[""] * (9 - len(fields))][:9]
    width = 16 if "*" in line[:8] else 8
    return [line[:8].strip(), *(line[start : start + width].strip() for start in range(8, 72, width))]


def _real(field: str) -> float:
    """Return a real number of Nastran, such as 1.5, 1.5D+3 or 1.5+3."""
    match = _REAL.fullmatch(field)
    if match is None:
        raise ValueError(f'DMIG has "{field}" in place of a real number')
    return float(f"{match[1]}e{match[2] or match[3] or 0}")


def _matrix_output(text: str) -> Content:
    """Return the matrix of a *MATRIX OUTPUT of Abaqus or CalculiX; FORMAT=COORDINATE has no numbers of nodes.

    Raises ValueError if lines are damaged, or freedoms are held or internal.
    """
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("**")]
    cells = [re.split(r"[,\s]+", line.strip().rstrip(",").strip()) for line in lines]
    width = LABELS if len(cells[0]) == LABELS else ROWS
    odd = next((k for k, row in enumerate(cells) if len(row) != width), None)
    if odd is not None:
        raise ValueError(f'its entry "{lines[odd].strip()[:60]}" has {len(cells[odd])} numbers, and the first one {width}')
    values = np.array([float(row[-1].upper().replace("D", "E")) for row in cells])
    labels = np.array([[int(cell) for cell in row[:-1]] for row in cells]).reshape(2 * len(cells), -1)
    if width == LABELS and labels[:, 0].min() <= 0:
        raise ValueError(
            f"it has the internal node {labels[:, 0].min()} of Abaqus, such as a Lagrange multiplier, which is no "
            "displacement; export a substructure (*SUBSTRUCTURE GENERATE) instead"
        )
    freedoms, rows = np.unique(labels, axis=0, return_inverse=True)
    rows = rows.reshape(-1, 2) if width == LABELS else labels.reshape(-1, 2) - 1
    count = len(freedoms) if width == LABELS else int(rows.max()) + 1
    _check_size(count)
    matrix = np.zeros((count, count))
    matrix[rows[:, 0], rows[:, 1]] = values
    if (held := np.flatnonzero(np.diag(matrix) > HELD)).size:
        where = f"node {freedoms[held[0], 0]}" if width == LABELS else f"row {held[0] + 1}"
        raise ValueError(
            f"a boundary condition holds {where} and others, {held.size} freedoms in all; export it without supports"
        )
    if not (np.triu(matrix, 1).any() and np.tril(matrix, -1).any()):  # one triangle of a symmetric matrix
        matrix = matrix + matrix.T - np.diag(np.diag(matrix))
    return (freedoms if width == LABELS else None), matrix


def _user_element(text: str) -> Content:
    """Return the matrix of a *USER ELEMENT, which has a lower triangle; CalculiX writes a node for each retained freedom.

    Raises ValueError if there is no such matrix, or its numbers do not match its freedoms.
    """
    blocks = _KEYWORD.split(text)
    elements = [block for block in blocks if re.match(r"USER\s+ELEMENT", block, re.IGNORECASE)]
    matrices = [block for block in blocks if re.match(r"MATRIX\s*,\s*TYPE\s*=\s*STIFFNESS", block, re.IGNORECASE)]
    if len(elements) != 1 or len(matrices) != 1:
        raise ValueError(
            f"it has {len(elements)} *USER ELEMENT and {len(matrices)} *MATRIX, TYPE=STIFFNESS; expected one of each"
        )
    freedoms = _freedoms_of_element(elements[0])
    if len(freedoms) > MAX_FREEDOMS:
        raise ValueError(f"it has {len(freedoms)} freedoms, at most {MAX_FREEDOMS} are supported: retain fewer nodes")
    numbers = [
        cell for line in matrices[0].split("\n")[1:] if not line.startswith("*") for cell in re.split(r"[,\s]+", line) if cell
    ]
    count = len(freedoms)
    if len(numbers) != count * (count + 1) // 2:
        raise ValueError(
            f"its stiffness has {len(numbers)} numbers, and the lower triangle of {count} freedoms {count * (count + 1) // 2}"
        )
    matrix = np.zeros((count, count))
    matrix[np.tril_indices(count)] = [float(number.upper().replace("D", "E")) for number in numbers]
    return freedoms, matrix + np.tril(matrix, -1).T


def _freedoms_of_element(block: str) -> np.ndarray:
    """Return the freedoms (row, 2) of a user element: comments list its nodes, and data lines the freedoms from a node on.

    Internal nodes, whose numbers are not positive, are the amplitudes of modes.
    """
    heading, *lines = block.splitlines()
    nodes = [int(n) for line in lines if _NODES.match(line) for n in re.findall(r"-?\d+", line)]
    stated = re.search(r"NODES\s*=\s*(\d+)", heading, re.IGNORECASE)
    if stated is None or len(nodes) != int(stated[1]):
        raise ValueError(f'it lists {len(nodes)} nodes below "ELEMENT NODES", and states {stated[1] if stated else "none"}')
    data = [[int(n) for n in re.findall(r"\d+", line)] for line in lines if line.strip() and not line.startswith("*")]
    if not data:
        raise ValueError("its *USER ELEMENT has no line of freedoms")
    directions = [data[0]] * len(nodes)
    for first, *changed in data[1:]:
        directions[first - 1 :] = [changed] * (len(nodes) - first + 1)
    return np.array(
        [(node, direction if node > 0 else 0) for node, listed in zip(nodes, directions, strict=True) for direction in listed]
    )
