"""Stiffness matrices of substructures in the text of Abaqus, and of CalculiX, which writes a node for each retained freedom."""

import re

import numpy as np

_KEYWORD = re.compile(r"^\*(?!\*)", re.MULTILINE)


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
    """Return the freedoms (row, 2) of a user element: comments list its nodes, and data lines the freedoms from a node on."""
    heading, *lines = block.split("\n")
    nodes = [int(n) for line in lines if re.match(r"\*\*[\s\d,]+$", line) for n in re.findall(r"\d+", line)]
    stated = re.search(r"NODES\s*=\s*(\d+)", heading, re.IGNORECASE)
    if stated is None or len(nodes) != int(stated[1]):
        raise ValueError(f'it lists {len(nodes)} nodes below "ELEMENT NODES", and states {stated[1] if stated else "none"}')
    data = [[int(n) for n in re.findall(r"\d+", line)] for line in lines if line.strip() and not line.startswith("*")]
    if not data:
        raise ValueError("its *USER ELEMENT has no line of freedoms")
    directions = [data[0]] * len(nodes)
    for first, *changed in data[1:]:
        directions[first - 1 :] = [changed] * (len(nodes) - first + 1)
    return np.array([(node, direction) for node, listed in zip(nodes, directions, strict=True) for direction in listed])
