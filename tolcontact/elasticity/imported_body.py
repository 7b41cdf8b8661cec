"""An elastic body from a stiffness matrix of another program. Forces act on its nodes, which are few: the matrix is dense.

The matrix has to be symmetric, free in space, and stiff against all but the six rigid motions. Its nodes have to lie on the
part: in other units or another frame, they do not.
"""

from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from scipy import linalg, sparse
from scipy.spatial import KDTree

from tolcontact.arrays import Array, Float, Int
from tolcontact.code_cache import digest
from tolcontact.declaration.geometry import UNITS
from tolcontact.elasticity.elastic_body import ElasticBody, rigid_motions
from tolcontact.elasticity.stiffness_files import read_stiffness
from tolcontact.errors import GeometryFault
from tolcontact.geometry.triangle_mesh import triangle_tree
from tolcontact.tables import number, read_table

MAX_OFFSET = 0.01  # [mm] of a node from the point at which a force acts
MIN_SPAN = 0.2  # of the part, by all nodes together: others may be in smaller units
SINGLE = 1e-6  # relative: numbers in single precision pass
ACCURACY = 0.01  # relative error of the softest stiffness that rounding in the file may cause
MOTIONS = ("x", "y", "z", "rotation about x", "rotation about y", "rotation about z")
MAX_LISTED = 5


def imported_body(
    stiffness: Path,
    nodes: Path,
    vertices: Float[Array, "vertex 3"] | None = None,
    faces: Int[Array, "face 3"] | None = None,
    tolerance: float = 1.0,
) -> ElasticBody:
    """Return the elastic body of a stiffness matrix of another program, condensed to the nodes where something acts.

    stiffness   file: .npz (K), Matrix Market .mtx, Nastran DMIG (.pch, .dmig, .bdf), Abaqus or CalculiX substructure .mtx
    nodes       file of the nodes in the part's frame [mm]: .csv (x, y, z, or number, x, y, z), or .npz (nodes, numbers)
    vertices, faces   the surface of the part, in its frame [mm], on which the nodes have to lie; None for no check
    tolerance         largest distance [mm] of a node from the surface: half the sheet thickness for shells

    Raises GeometryFault with the name of the file if it cannot be read, or is not the stiffness of this part, free in space.
    """
    positions, K = _free_stiffness(stiffness, nodes)
    if vertices is not None and faces is not None:
        _check_nodes(positions, nodes, vertices, faces, tolerance)
    shares = np.full(len(positions), 1 / len(positions))
    Q, _ = np.linalg.qr(rigid_motions(positions, shares))
    factor = linalg.cho_factor(K + np.abs(K).max() * (Q @ Q.T))  # the same as K for balanced forces
    tree = KDTree(positions)

    def pads(points: np.ndarray, directions: np.ndarray, radius: float | None) -> sparse.csc_array:
        distances, nearest = tree.query(points)
        if (distances > MAX_OFFSET).any():
            k = int(np.argmax(distances))
            raise GeometryFault(
                f'"{stiffness}" has no node at ({", ".join(f"{x:.6g}" for x in points[k])}), where something acts: the nearest '
                f"is {distances[k]:.3g} mm away; retain a node there, or move the point to the node"
            )
        rows = 3 * nearest[:, None] + np.arange(3)
        columns = np.broadcast_to(np.arange(len(points))[:, None], rows.shape)
        return sparse.csc_array((directions.ravel(), (rows.ravel(), columns.ravel())), shape=(len(K), len(points)))

    return ElasticBody(
        nodes=positions,
        shares=shares,
        mass=np.nan,
        pads=pads,
        balanced=lambda forces: linalg.cho_solve(factor, forces),
        restoring=lambda displacements: np.asarray(K @ displacements),
        key=digest(positions, K),
    )


def node_table(path: Path) -> tuple[Float[Array, "node 3"], Int[Array, " node"] | None]:
    """Return the positions [mm] of the nodes of a file, and their numbers; None if it states none.

    Raises GeometryFault if it cannot be read, or repeats a number.
    """
    try:
        numbers, positions = (_node_arrays if path.suffix.lower() == ".npz" else _node_rows)(path)
    except (OSError, ValueError, BadZipFile) as error:
        raise GeometryFault(
            f'node file "{path}" cannot be read: {error}; expected .csv with columns x, y, z [mm], or number, x, y, z, below a '
            "heading, or .npz with the arrays nodes (node, 3) and, for DMIG and Abaqus, numbers (node,)"
        ) from error
    if positions.ndim != 2 or positions.shape[1:] != (3,) or len(positions) < 3 or not np.isfinite(positions).all():
        raise GeometryFault(f'node file "{path}" holds nodes {positions.shape}; expected three or more, finite, (node, 3)')
    if numbers is not None and len(np.unique(numbers)) < len(positions):
        raise GeometryFault(f'node file "{path}" holds a node number twice, or nodes without a number; number each once')
    return positions, numbers


def _node_rows(path: Path) -> tuple[np.ndarray | None, np.ndarray]:
    table = read_table(path)
    lines = [(line, cells) for line, cells in table.rows if cells]
    width = len(table.heading)
    if width not in (3, 4):
        raise ValueError(f"its heading has {width} columns")
    cells = np.empty((len(lines), width))
    for row, (line, texts) in enumerate(lines):
        try:
            cells[row] = [number(text, decimal_marks=table.decimal_marks) for text in texts]
        except ValueError as fault:
            raise ValueError(f"line {line}: an entry {fault}") from fault
    return (cells[:, 0].astype(int) if width == 4 else None), cells[:, -3:]


def _node_arrays(path: Path) -> tuple[np.ndarray | None, np.ndarray]:
    with np.load(path, allow_pickle=False) as content:
        if "nodes" not in content.files:
            raise ValueError(f"it holds {', '.join(content.files) or 'nothing'}, and no nodes")
        numbers = np.asarray(content["numbers"], dtype=int) if "numbers" in content.files else None
        return numbers, np.asarray(content["nodes"], dtype=float)


def _check_nodes(nodes: np.ndarray, path: Path, vertices: np.ndarray, faces: np.ndarray, tolerance: float) -> None:
    """Raise GeometryFault unless `nodes` lie within `tolerance` [mm] of the part's surface.

    Nodes in smaller units lie close together, and may all be near the surface at the origin: those that span less than a fifth
    of the part must not fit it in other units.
    """
    distances = _distances(nodes, vertices, faces)
    span, size = np.linalg.norm(np.ptp(nodes, axis=0)), np.linalg.norm(np.ptp(vertices, axis=0))
    if distances.max() <= tolerance and span >= MIN_SPAN * size:
        return
    offsets = {unit: _distances(factor * nodes, vertices, faces).max() for unit, factor in UNITS.items() if unit != "mm"}
    fits = [unit for unit, offset in offsets.items() if offset <= tolerance and UNITS[unit] * span >= MIN_SPAN * size]
    if distances.max() <= tolerance and not fits:
        return  # all at one end of the part
    k = int(np.argmax(distances))
    unit = max(fits, key=lambda unit: UNITS[unit], default="")
    advice = (
        f"they do if they are in {unit}: convert them, and the stiffness, to mm and N/mm"
        if fits
        else "give them in mm in the part's own frame, or mend the tolerance"
    )
    raise GeometryFault(
        f'node file "{path}": its nodes do not lie on the part: node {k + 1} of {len(nodes)} is {distances[k]:.4g} mm from its '
        f"surface (at most {tolerance:g} mm is allowed), and they span {span:.4g} of {size:.4g} mm; {advice}"
    )


def _distances(nodes: np.ndarray, vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    vertices, faces = np.ascontiguousarray(vertices, dtype=float), np.ascontiguousarray(faces, dtype=np.int64)
    squares, _, _ = triangle_tree(vertices, faces).squared_distance(vertices, faces, np.ascontiguousarray(nodes))
    return np.asarray(np.sqrt(squares))


def _free_stiffness(stiffness: Path, nodes: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes (node, 3) [mm] of a matrix and its stiffness (3 node, 3 node) [N/mm], without rotations and modes.

    Nothing acts on rotations and modes, so they are condensed: K = K_uu - K_ur K_rr^-1 K_ru. Rounding of
    the file is evened out, so that K is symmetric, and K R = 0. Raises GeometryFault with the names of the files.
    """
    name = f'stiffness file "{stiffness}"'
    stated, K = read_stiffness(stiffness)
    freedoms, positions = _freedoms(stiffness, stated, len(K), nodes)
    _check_diagonal(name, K, freedoms)
    is_used = np.diag(K) > 0  # solids have empty rows for rotations
    freedoms, K = freedoms[is_used], K[np.ix_(is_used, is_used)]
    _check_symmetry(name, K, freedoms)
    K = (K + K.T) / 2
    order = np.lexsort((freedoms[:, 1], freedoms[:, 0]))
    freedoms, K = freedoms[order], K[np.ix_(order, order)]
    is_displacement = np.isin(freedoms[:, 1], (1, 2, 3))
    where = np.array([positions[int(node)] for node in freedoms[is_displacement][::3, 0]])
    _check_rigid_motions(name, K, freedoms, where, nodes)
    K = _condensed(name, K, np.flatnonzero(is_displacement), np.flatnonzero(~is_displacement))
    return where, _checked_spectrum(name, K, where)


def _freedoms(file: Path, stated: np.ndarray | None, rows: int, table: Path) -> tuple[np.ndarray, dict[int, np.ndarray]]:
    """Return the freedom of each row (row, 2), and the positions of nodes by number. Rows without numbers follow the table."""
    positions, numbers = node_table(table)
    count = len(positions)
    if stated is None:
        if rows != 3 * count:
            raise GeometryFault(
                f'stiffness file "{file}" has {rows} rows, and the {count} nodes of "{table}" have {3 * count} '
                "displacements; expected x, y, z of each node, in the order of the table, without rotations"
            )
        numbers = np.arange(count) if numbers is None else numbers
        freedoms = np.column_stack([numbers.repeat(3), np.tile([1, 2, 3], count)])
    elif numbers is None:
        raise GeometryFault(
            f'node file "{table}" has no numbers, and "{file}" refers to nodes by number; add a column with numbers '
            "before x, y, z"
        )
    else:
        freedoms = stated
    physical = freedoms[freedoms[:, 1] > 0]
    missing = np.setdiff1d(physical[:, 0], numbers)
    if len(missing):
        raise GeometryFault(f'node file "{table}" has no node {_listed(missing)}, which "{file}" has; add its position')
    listed, counts = np.unique(np.unique(physical[physical[:, 1] <= 3], axis=0)[:, 0], return_counts=True)
    held = np.setdiff1d(physical[:, 0], listed[counts == 3])
    if len(held):
        raise GeometryFault(
            f'stiffness file "{file}" lacks displacements of node {_listed(held)}; expected x, y and z of '
            "each: retain all three, and leave supports out; or the file is cut off"
        )
    return freedoms, dict(zip(map(int, numbers), positions, strict=True))


def _check_diagonal(name: str, K: np.ndarray, freedoms: np.ndarray) -> None:
    diagonal = np.diag(K)
    negative = freedoms[diagonal < 0]
    if len(negative):
        raise GeometryFault(f"{name} has negative stiffness at node {_listed(negative[:, 0])}; check its sign, export it again")
    is_empty = (diagonal == 0) & (np.isin(freedoms[:, 1], (1, 2, 3)) | (K != 0).any(axis=1))
    if is_empty.any():
        raise GeometryFault(
            f"{name} has no stiffness at node {_listed(freedoms[is_empty, 0])}; leave nodes out that hang on nothing, or "
            "the file is cut off"
        )


def _check_symmetry(name: str, K: np.ndarray, freedoms: np.ndarray) -> None:
    scale = np.sqrt(np.diag(K))
    error = np.abs(K - K.T) / (scale[:, None] * scale)
    if error.max() > SINGLE:
        pair = np.unravel_index(np.argmax(error), error.shape)
        left, right = (f"node {freedoms[k, 0]} direction {freedoms[k, 1]}" for k in pair)
        raise GeometryFault(
            f"{name} is not symmetric: its entries of {left} and {right} differ by {error.max():.1e} of the diagonal; "
            "export the whole matrix, without follower loads, damping or contact"
        )


def _check_rigid_motions(name: str, K: np.ndarray, freedoms: np.ndarray, where: np.ndarray, table: Path) -> None:
    """Raise GeometryFault unless K R = 0, row by row: forces of rigid motions vanish up to the rounding of their terms."""
    motions = rigid_motions(where, np.full(len(where), 1 / len(where))).reshape(-1, 3, 6)
    size = np.sqrt(((where - where.mean(axis=0)) ** 2).sum(axis=1).mean())
    turning = np.zeros((3, 6))
    turning[:, 3:] = np.eye(3) / size
    modes = np.zeros((len(where), 1, 6))
    full = np.concatenate([modes, motions, np.broadcast_to(turning, motions.shape)], axis=1)  # (node, freedom, motion)
    is_mode = freedoms[:, 1] == 0
    nodes = np.unique(freedoms[~is_mode, 0])
    R = full[np.where(is_mode, 0, np.searchsorted(nodes, freedoms[:, 0])), freedoms[:, 1]]
    forces, terms = np.abs(K @ R), (np.abs(K) @ np.abs(R)).max(axis=1, keepdims=True)
    errors = (forces / np.where(terms > 0, terms, 1)).max(axis=0)
    if errors.max() <= SINGLE:
        return
    worst = freedoms[int(np.argmax(forces.max(axis=1))), 0]
    resisted = ", ".join(f"{motion} ({error:.0e})" for motion, error in zip(MOTIONS, errors, strict=True) if error > SINGLE)
    if errors[:3].max() > SINGLE:
        cause = (
            f"a support or a spring to ground was left in, most of all at node {worst}; leave it out, or the file is cut off"
        )
    else:
        cause = (
            f'positions in "{table}" do not belong to the matrix, most of all at node {worst}; check order, numbers, units, '
            "coordinate systems, and springs between nodes that are apart"
        )
    raise GeometryFault(f"{name} resists rigid motions, relative to its entries: {resisted}: {cause}")


def _condensed(name: str, K: np.ndarray, moves: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return the stiffness of displacements if nothing acts on other freedoms."""
    stiffness = K[np.ix_(moves, moves)]
    if not len(others):
        return stiffness
    coupling = K[np.ix_(others, moves)]
    try:
        return stiffness - coupling.T @ linalg.solve(K[np.ix_(others, others)], coupling, assume_a="pos")
    except linalg.LinAlgError as error:
        raise GeometryFault(
            f"{name} has rotations of nodes, or modes, that meet no stiffness, or a negative one; retain displacements only"
        ) from error


def _checked_spectrum(name: str, K: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Return K with K R = 0 to the last digit. Raises GeometryFault if its other motions are not stiff."""
    Q, _ = np.linalg.qr(rigid_motions(where, np.full(len(where), 1 / len(where))))
    noise = 2 * np.linalg.norm(K @ Q) / np.sqrt(6)  # the spectral norm of the rounding of entries, as rigid motions show it
    K = K - Q @ (Q.T @ K)
    K = K - (K @ Q) @ Q.T
    K = (K + K.T) / 2
    stiffness = np.linalg.eigvalsh(K + np.abs(K).max() * len(K) * (Q @ Q.T))  # rigid motions are the stiffest
    softest, stiffest = stiffness[0], stiffness[-7] if len(K) > 6 else stiffness[-1]
    if softest < -max(SINGLE * stiffest, noise):
        raise GeometryFault(f"{name} has negative stiffness ({softest:.1e} N/mm in its softest motion); check its sign")
    floor = max(noise / ACCURACY, 1e-13 * stiffest)
    if softest < floor:
        count = int((stiffness < floor).sum())
        raise GeometryFault(
            f"{name} has {count} motions in addition to the six rigid ones whose stiffness ({softest:.1e} N/mm) is lost in the "
            f"rounding of its entries ({noise:.1e} N/mm): a node or a piece is not connected, or it was written in single "
            "precision; connect it, or export more digits"
        )
    return K


def _listed(numbers: np.ndarray) -> str:
    distinct = np.unique(numbers)
    others = f" and {len(distinct) - MAX_LISTED} more" if len(distinct) > MAX_LISTED else ""
    return ", ".join(map(str, distinct[:MAX_LISTED])) + others
