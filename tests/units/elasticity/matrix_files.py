"""Writers of stiffness matrices as Nastran, Abaqus and CalculiX write them, from freedoms (row, 2) and a matrix."""

import numpy as np
from scipy import io, sparse


def npz(path, freedoms, matrix):
    np.savez(path, K=matrix)


def sparse_npz(path, freedoms, matrix):
    sparse.save_npz(path, sparse.csr_array(matrix))


def matrix_market(path, freedoms, matrix):
    with path.open("wb") as file:  # a path gets another suffix
        io.mmwrite(file, sparse.coo_array(matrix), symmetry="symmetric", precision=17)


def dmig(path, freedoms, matrix, digits=9, name="KAAX"):
    """Large fields, the lower triangle of a symmetric matrix; another matrix stands before it, as in files of superelements."""
    lines = ["$TITLE   = BLOCK", "DMIG    MAAX           0       6       2       0                      99"]
    lines += ["DMIG*   MAAX                           1               1", f"*       {1:16d}{1:16d}{0.5:16.9E}"]
    lines += [f"DMIG    {name:8s}       0       6       2       0                {len(matrix):8d}"]
    for j, (node, direction) in enumerate(freedoms):
        lines += [f"DMIG*   {name:16s}{node:16d}{direction:16d}"]
        for i in range(j, len(matrix)):
            if matrix[i, j]:
                value = f"{matrix[i, j]:16.{digits}E}".replace("E", "D")
                lines += [f"*       {freedoms[i][0]:16d}{freedoms[i][1]:16d}{value}"]
    path.write_text("\n".join([*lines, ""]))


def superelement(path, freedoms, matrix):
    """A punch file of an external superelement: grids before the matrices, and structural damping before the stiffness."""
    dmig(path, freedoms, matrix)
    grids = [f"GRID*   {node:16d}{0:16d}{0.0:16.9E}{0.0:16.9E}\n*       {0.0:16.9E}{0:16d}" for node in range(1, 800)]
    damping = ["DMIG    K4AAX          0       6       2       0                      99"]
    damping += ["DMIG*   K4AAX                          1               1", f"*       {1:16d}{1:16d}{0.5:16.9E}"]
    path.write_text("\n".join(["BEGIN SUPER      102", *grids, *damping, path.read_text()]))


def free_dmig(path, freedoms, matrix):
    """Free fields, a square matrix: one or two entries in a line, the second one continued."""
    lines = ["DMIG,KF,0,1,2,0,,,99"]
    for j, (node, direction) in enumerate(freedoms):
        used = [i for i in range(len(matrix)) if matrix[i, j]]
        entries = [f"{freedoms[i][0]},{freedoms[i][1]},{float(matrix[i, j])!r}" for i in used]
        lines += [f"DMIG,KF,{node},{direction},,{entry}," for entry in entries[:1]]
        lines += [f"+,{entry}," for entry in entries[1:]]
    path.write_text("\n".join(lines))


def abaqus(path, freedoms, matrix):
    """Nodes with equal freedoms; rows of the lower triangle wrap after four numbers, a comma at their ends."""
    nodes = list(dict.fromkeys(node for node, _ in freedoms))
    directions = [[d for node, d in freedoms if node == n] for n in nodes]
    lines = ["**", "** ABAQUS SUBSTRUCTURE", f"*USER ELEMENT, NODES={len(nodes):8d}, LINEAR", "** ELEMENT NODES"]
    lines += ["** " + ", ".join(map(str, chunk)) for chunk in _chunks(nodes, 8)]
    lines += [", ".join(map(str, directions[0]))]
    changes = [k for k in range(1, len(nodes)) if directions[k] != directions[k - 1]]
    lines += [", ".join(map(str, (k + 1, *directions[k]))) for k in changes]
    lines += ["*MATRIX,TYPE=STIFFNESS", *_triangle(matrix), "*MATRIX,TYPE=MASS", *_triangle(np.eye(len(matrix)))]
    path.write_text("\n".join([*lines, ""]))


def abaqus_with_modes(path, freedoms, matrix):
    """Internal nodes for the amplitudes of two modes, commas and spaces at the ends of lines, CRLF."""
    nodes = list(dict.fromkeys(node for node, _ in freedoms))
    whole = np.zeros((len(matrix) + 2,) * 2)
    whole[:-2, :-2], whole[-2:, -2:] = matrix, np.diag([3e7, 4e8])
    lines = [
        "**",
        "** GENERATION OF SUBSTRUCTURE Z1      ",
        f"*USER ELEMENT, NODES={len(nodes) + 2:10d}, LINEAR",
        "** ELEMENT NODES",
    ]
    lines += ["** " + "".join(f"{node:10d}, " for node in chunk) for chunk in _chunks([*nodes, -1, -2], 10)]
    lines += ["** NODE NUMBERS WHICH ARE NOT POSITIVE INDICATE Abaqus INTERNAL NODES.", "         1,         2,         3"]
    lines += [f"{len(nodes) + 1:10d},         1", "*MATRIX,TYPE=STIFFNESS", *_triangle(whole)]
    path.write_bytes("\r\n".join([*lines, ""]).encode())


def labels(path, freedoms, matrix):
    """*MATRIX OUTPUT, FORMAT=MATRIX INPUT: node and direction of row and column, the lower triangle."""
    entries = np.argwhere(np.tril(matrix))
    rows = ["{},{}, {},{}, {: .15e}".format(*freedoms[i], *freedoms[j], matrix[i, j]) for i, j in entries]
    path.write_text("\n".join([*rows, ""]))


def coordinate(path, freedoms, matrix):
    """*MATRIX OUTPUT, FORMAT=COORDINATE: numbers of row and column from 1, the whole matrix."""
    rows = [f"{i + 1}  {j + 1} {matrix[i, j]: .15e}" for i, j in np.argwhere(matrix)]
    path.write_text("\n".join([*rows, ""]))


def calculix(path, freedoms, matrix):
    """A node for each freedom, as its subroutine `writesubmatrix` does."""
    lines = ["**", "** GENERATION OF SUBSTRUCTURE", f"*USER ELEMENT,NODES= {len(freedoms):10d},LINEAR", "** ELEMENT NODES"]
    lines += ["**" + "".join(f"{node:10d}," for node, _ in chunk) for chunk in _chunks(freedoms, 10)]
    lines += [f"{freedoms[0][1]:10d}", *(f"{k:10d},{d:10d}" for k, (_, d) in enumerate(freedoms[1:], start=2))]
    path.write_text("\n".join([*lines, "*MATRIX,TYPE=STIFFNESS", *_triangle(matrix), ""]))


def _triangle(matrix):
    for row in range(len(matrix)):
        for chunk in _chunks(matrix[row, : row + 1], 4):
            yield "".join(f"{value:20.13E}," for value in chunk)


def _chunks(items, size):
    return [items[start : start + size] for start in range(0, len(items), size)]
