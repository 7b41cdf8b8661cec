"""Where the entries of elements stand in the sparse matrices of the whole QP, and sums over what they share."""

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Float, Int


class BlockSum:
    """Sums of contributions by their targets, always in the same order, so that results do not depend on the block size.

    places   (contribution,): the place that each contribution takes in an array of all, which is sorted by targets
    """

    def __init__(self, targets: Int[Array, " contribution"], count: int) -> None:
        self._count = count
        order = np.argsort(targets, kind="stable")
        self.places = np.empty(len(order), dtype=int)
        self.places[order] = np.arange(len(order))
        self._present, self._starts = np.unique(targets[order], return_index=True)

    def __call__(self, contributions: Float[Array, "n _"]) -> Float[Array, "n _"]:
        """Return the sums (n, target * entry) of (n, contribution * entry), zero for targets without contributions."""
        count, contribution = len(contributions), len(self.places)
        if contribution == self._count == len(self._present):
            return contributions
        entries = contributions.shape[1] // max(contribution, 1)
        sums = np.zeros((count, self._count, entries))
        if contribution:
            sums[:, self._present] = np.add.reduceat(contributions.reshape(count, contribution, entries), self._starts, axis=1)
        return sums.reshape(count, self._count * entries)


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
