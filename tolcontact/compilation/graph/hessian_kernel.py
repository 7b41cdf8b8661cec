"""Compiled block Cholesky factor of H = C C', which transforms a QP so that H is the identity: its rows become C^-1 a."""

import numpy as np

from tolcontact.compiled import inlined_inner, inner


@inlined_inner
def _cholesky(block):  # type: ignore[no-untyped-def]
    """Replace a block (6, 6) by its Cholesky factor; return whether it is positive definite."""
    for i in range(6):
        for j in range(i + 1):
            value = block[i, j]
            for c in range(j):
                value -= block[i, c] * block[j, c]
            if j < i:
                block[i, j] = value / block[j, j]
            elif value > 0.0:
                block[i, i] = np.sqrt(value)
            else:
                return False
    return True


@inlined_inner
def _divide(block, triangle):  # type: ignore[no-untyped-def]
    """Replace a block by its product with the inverse transpose of a lower triangle."""
    for i in range(6):
        for j in range(6):
            value = block[i, j]
            for c in range(j):
                value -= block[i, c] * triangle[j, c]
            block[i, j] = value / triangle[j, j]


@inlined_inner
def _subtract(block, left, right):  # type: ignore[no-untyped-def]
    """Subtract left right' from a block."""
    for i in range(6):
        for j in range(6):
            value = block[i, j]
            for c in range(6):
                value -= left[i, c] * right[j, c]
            block[i, j] = value


@inner
def load_hessian(layout, nonzeros, k, blocks):  # type: ignore[no-untyped-def]
    """Write the factor of problem k into `blocks`; return whether H is positive definite."""
    blocks[:] = 0.0
    for entry in range(layout.hessian_entries.size):
        if layout.hessian_entries[entry] >= 0:
            block, offset = divmod(layout.hessian_entries[entry], 36)
            blocks[block, offset // 6, offset % 6] = nonzeros[k, entry]
    starts, columns, block_of = layout.starts, layout.columns, layout.block_of
    for body in range(starts.size - 1):
        diagonal = starts[body + 1] - 1
        for b in range(starts[body], diagonal):
            column = columns[b]
            for e in range(starts[body], b):
                if block_of[column, columns[e]] >= 0:
                    _subtract(blocks[b], blocks[e], blocks[block_of[column, columns[e]]])
            _divide(blocks[b], blocks[starts[column + 1] - 1])
            _subtract(blocks[diagonal], blocks[b], blocks[b])
        if not _cholesky(blocks[diagonal]):
            return False
    return True


@inlined_inner
def _forward(triangle, vector):  # type: ignore[no-untyped-def]
    """Solve with a lower triangle, in place."""
    for i in range(6):
        value = vector[i]
        for c in range(i):
            value -= triangle[i, c] * vector[c]
        vector[i] = value / triangle[i, i]


@inner
def vectors_to_unit(layout, blocks, vectors):  # type: ignore[no-untyped-def]
    """Multiply vectors (body, 6) by C^-1, in place."""
    starts, columns = layout.starts, layout.columns
    for body in range(starts.size - 1):
        diagonal = starts[body + 1] - 1
        for b in range(starts[body], diagonal):
            for i in range(6):
                for c in range(6):
                    vectors[body, i] -= blocks[b, i, c] * vectors[columns[b], c]
        _forward(blocks[diagonal], vectors[body])


@inner
def from_unit(layout, blocks, vectors):  # type: ignore[no-untyped-def]
    """Multiply vectors (body, 6) by C'^-1, in place."""
    starts, columns = layout.starts, layout.columns
    for body in range(starts.size - 2, -1, -1):
        diagonal = starts[body + 1] - 1
        for i in range(5, -1, -1):
            value = vectors[body, i]
            for c in range(i + 1, 6):
                value -= blocks[diagonal, c, i] * vectors[body, c]
            vectors[body, i] = value / blocks[diagonal, i, i]
        for b in range(starts[body], diagonal):
            for i in range(6):
                for c in range(6):
                    vectors[columns[b], c] -= blocks[b, i, c] * vectors[body, i]


@inner
def rows_to_unit(layout, blocks, slopes):  # type: ignore[no-untyped-def]
    """Multiply the slopes (row, block, 6) of all rows by C^-1, in place."""
    starts = layout.starts
    for row in range(slopes.shape[0]):
        for q in range(layout.blocks[row, 0]):
            body = layout.blocks[row, q + 1]
            _forward(blocks[starts[body + 1] - 1], slopes[row, q])
            for p in range(q + 1, layout.blocks[row, 0]):
                b = layout.block_of[layout.blocks[row, p + 1], body]
                if b >= 0:
                    for i in range(6):
                        for c in range(6):
                            slopes[row, p, i] -= blocks[b, i, c] * slopes[row, q, c]
