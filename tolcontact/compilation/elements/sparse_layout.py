"""Where the entries of elements stand in the sparse matrices of the whole QP, and sums over what they share."""

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Float, Int


class BlockSum:
    """Sums of contributions by their targets, always in the same order, so that results do not depend on the block size."""

    def __init__(self, targets: Int[Array, " contribution"], count: int) -> None:
        self._count = count
        self._order = np.argsort(targets, kind="stable")
        self._present, self._starts = np.unique(targets[self._order], return_index=True)

    def __call__(self, contributions: Float[Array, "n contribution entry"]) -> Float[Array, "n target entry"]:
        """Return the sums, zero for targets without contributions."""
        sums = np.zeros((len(contributions), self._count, contributions.shape[2]))
        if self._present.size:
            sums[:, self._present] = np.add.reduceat(contributions[:, self._order], self._starts, axis=1)
        return sums


class SparseLayout:
    """The stored entries of a matrix in CasADi's order, column by column.

    `places` tells for each of the given rows and columns, which must differ, which of the stored entries it is.
    """

    def __init__(self, shape: tuple[int, int], rows: Int[Array, " entry"], columns: Int[Array, " entry"]) -> None:
        order = np.lexsort((rows, columns))
        self.places = np.empty(len(order), dtype=int)
        self.places[order] = np.arange(len(order))
        self.sparsity = ca.Sparsity.triplet(*shape, rows.tolist(), columns.tolist())

    def __len__(self) -> int:
        return len(self.places)
