"""What an imported stiffness matrix has to be: symmetric, free in space, and stiff against all but the six rigid motions."""

from pathlib import Path

import numpy as np
from scipy import linalg

from tolcontact.arrays import Array, Float, Int
from tolcontact.elasticity.elastic_body import rigid_motions
from tolcontact.elasticity.node_table import NodeTable
from tolcontact.elasticity.stiffness_files import StiffnessFile
from tolcontact.errors import GeometryFault

SINGLE = 1e-6  # relative: numbers in single precision pass
ACCURACY = 0.01  # relative error of the softest stiffness that rounding in the file may cause
MOTIONS = ("x", "y", "z", "rotation about x", "rotation about y", "rotation about z")
MAX_LISTED = 5


def free_stiffness(file: StiffnessFile, table: NodeTable) -> tuple[Float[Array, "node 3"], Float[Array, "force force"]]:
    """Return the nodes [mm] of a matrix and its stiffness (3 node, 3 node) [N/mm], without rotations and modes.

    Nothing acts on rotations and modes, so they are condensed: K = K_uu - K_ur K_rr^-1 K_ru. Rounding of
    the file is evened out, so that K is symmetric, and K R = 0. Raises GeometryFault with the names of the files.
    """
    name = f'stiffness file "{file.path}"'
    freedoms, positions = _freedoms(file, table)
    K = file.matrix
    _check_diagonal(name, K, freedoms)
    is_used = np.diag(K) > 0  # solids have empty rows for rotations
    freedoms, K = freedoms[is_used], K[np.ix_(is_used, is_used)]
    _check_symmetry(name, K, freedoms)
    K = (K + K.T) / 2
    order = np.lexsort((freedoms[:, 1], freedoms[:, 0]))
    freedoms, K = freedoms[order], K[np.ix_(order, order)]
    is_displacement = np.isin(freedoms[:, 1], (1, 2, 3))
    where = np.array([positions[int(node)] for node in freedoms[is_displacement][::3, 0]])
    _check_rigid_motions(name, K, freedoms, where, table.path)
    K = _condensed(name, K, np.flatnonzero(is_displacement), np.flatnonzero(~is_displacement))
    return where, _checked_spectrum(name, K, where)


def _freedoms(file: StiffnessFile, table: NodeTable) -> tuple[Int[Array, "row 2"], dict[int, np.ndarray]]:
    """Return the freedom of each row, and the positions of nodes by number. Rows without numbers follow the table."""
    count, rows = len(table.positions), len(file.matrix)
    if file.freedoms is None:
        if rows != 3 * count:
            raise GeometryFault(
                f'stiffness file "{file.path}" has {rows} rows, and the {count} nodes of "{table.path}" have {3 * count} '
                "displacements; expected x, y, z of each node, in the order of the table, without rotations"
            )
        numbers = np.arange(count) if table.numbers is None else table.numbers
        freedoms = np.column_stack([numbers.repeat(3), np.tile([1, 2, 3], count)])
    elif table.numbers is None:
        raise GeometryFault(
            f'node file "{table.path}" has no numbers, and "{file.path}" refers to nodes by number; add a column with numbers '
            "before x, y, z"
        )
    else:
        numbers, freedoms = table.numbers, file.freedoms
    physical = freedoms[freedoms[:, 1] > 0]
    missing = np.setdiff1d(physical[:, 0], numbers)
    if len(missing):
        raise GeometryFault(
            f'node file "{table.path}" has no node {_listed(missing)}, which "{file.path}" has; add its position'
        )
    listed, counts = np.unique(np.unique(physical[physical[:, 1] <= 3], axis=0)[:, 0], return_counts=True)
    held = np.setdiff1d(physical[:, 0], listed[counts == 3])
    if len(held):
        raise GeometryFault(
            f'stiffness file "{file.path}" lacks displacements of node {_listed(held)}; expected x, y and z of '
            "each: retain all three, and leave supports out; or the file is cut off"
        )
    return freedoms, dict(zip(map(int, numbers), table.positions, strict=True))


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
