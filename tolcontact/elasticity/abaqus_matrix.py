"""Stiffness matrices in the text of Abaqus, and of CalculiX, which writes a node for each retained freedom.

Substructures and elements are a *USER ELEMENT with a lower triangle; *MATRIX OUTPUT lists entries, by labels or by rows.
"""

import re

import numpy as np

LABELS, ROWS = 5, 3  # numbers on a line of FORMAT=MATRIX INPUT, with nodes and directions, and of FORMAT=COORDINATE
HELD = 1e30  # Abaqus marks freedoms with a boundary condition by 1e36 on the diagonal
_KEYWORD = re.compile(r"^\*(?!\*)", re.MULTILINE)
_LABELLED = re.compile(rb"\s*-?\d+\s*,\s*\d+\s*,\s*-?\d+\s*,\s*\d+\s*,\s*[-+\d.]+(?:[eEdD][-+]?\d+)?\s*")
_LISTED = re.compile(rb"\s*\d+[\s,]+\d+[\s,]+[-+]?\d*\.\d*(?:[eEdD][-+]?\d+)?\s*")
_NODES = re.compile(r"\*\*[\s\d,-]*\d[\s\d,-]*$")


def lists_entries(start: bytes) -> bool:
    """Return whether the first line of a file that is no comment is an entry of *MATRIX OUTPUT."""
    lines = (line for line in start.split(b"\n") if line.strip() and not line.startswith(b"**"))
    first = next(lines, b"")
    return any(kind.fullmatch(first) is not None for kind in (_LABELLED, _LISTED))


def listed_matrix(text: str, max_freedoms: int) -> tuple[np.ndarray | None, np.ndarray]:
    """Return freedoms (row, 2), None for FORMAT=COORDINATE, and the stiffness matrix (row, row) of a *MATRIX OUTPUT.

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
    if count > max_freedoms:
        raise ValueError(f"it has {count} freedoms, at most {max_freedoms} are supported: condense it to the nodes that matter")
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


def abaqus_matrix(text: str, max_freedoms: int) -> tuple[np.ndarray, np.ndarray]:
    """Return freedoms (row, 2) and the stiffness matrix (row, row) of a *USER ELEMENT with its *MATRIX, TYPE=STIFFNESS.

    Raises ValueError if there is no such matrix, or its numbers do not match its freedoms.
    """
    blocks = _KEYWORD.split(text)
    elements = [block for block in blocks if re.match(r"USER\s+ELEMENT", block, re.IGNORECASE)]
    matrices = [block for block in blocks if re.match(r"MATRIX\s*,\s*TYPE\s*=\s*STIFFNESS", block, re.IGNORECASE)]
    if len(elements) != 1 or len(matrices) != 1:
        raise ValueError(
            f"it has {len(elements)} *USER ELEMENT and {len(matrices)} *MATRIX, TYPE=STIFFNESS; expected one of each"
        )
    freedoms = _freedoms(elements[0])
    if len(freedoms) > max_freedoms:
        raise ValueError(f"it has {len(freedoms)} freedoms, at most {max_freedoms} are supported: retain fewer nodes")
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


def _freedoms(block: str) -> np.ndarray:
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
