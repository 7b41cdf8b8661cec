"""Tables of nodes: their numbers and positions in the part's frame [mm], from CSV or npz."""

from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.errors import GeometryFault
from tolcontact.tables import number, read_table


@dataclass(frozen=True, eq=False)
class NodeTable:
    """Nodes of a file; `numbers` is None if it states none."""

    path: Path
    positions: Float[Array, "node 3"]
    numbers: Int[Array, " node"] | None


def node_table(path: Path) -> NodeTable:
    """Return the nodes of a file. Raises GeometryFault if it cannot be read, or repeats a number."""
    try:
        numbers, positions = (_npz if path.suffix.lower() == ".npz" else _csv)(path)
    except (OSError, ValueError, BadZipFile) as error:
        raise GeometryFault(
            f'node file "{path}" cannot be read: {error}; expected .csv with columns x, y, z [mm], or number, x, y, z, below a '
            "heading, or .npz with the arrays nodes (node, 3) and, for DMIG and Abaqus, numbers (node,)"
        ) from error
    if positions.ndim != 2 or positions.shape[1:] != (3,) or len(positions) < 3 or not np.isfinite(positions).all():
        raise GeometryFault(f'node file "{path}" holds nodes {positions.shape}; expected three or more, finite, (node, 3)')
    if numbers is not None and len(np.unique(numbers)) < len(positions):
        raise GeometryFault(f'node file "{path}" holds a node number twice, or nodes without a number; number each once')
    return NodeTable(path, positions, numbers)


def _csv(path: Path) -> tuple[np.ndarray | None, np.ndarray]:
    table = read_table(path)
    lines = [(line, cells) for line, cells in table.rows if cells]
    width = len(table.heading)
    if width not in (3, 4):
        raise ValueError(f"its heading has {width} columns")
    cells = np.empty((len(lines), width))
    for row, (line, texts) in enumerate(lines):
        try:
            cells[row] = [number(text, has_decimal_commas=table.has_decimal_commas) for text in texts]
        except ValueError as fault:
            raise ValueError(f"line {line}: an entry {fault}") from fault
    return (cells[:, 0].astype(int) if width == 4 else None), cells[:, -3:]


def _npz(path: Path) -> tuple[np.ndarray | None, np.ndarray]:
    with np.load(path, allow_pickle=False) as content:
        if "nodes" not in content.files:
            raise ValueError(f"it holds {', '.join(content.files) or 'nothing'}, and no nodes")
        numbers = np.asarray(content["numbers"], dtype=int) if "numbers" in content.files else None
        return numbers, np.asarray(content["nodes"], dtype=float)
