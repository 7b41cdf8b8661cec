"""The positions of element contributions in sums over movers, and in the matrices of the whole QP."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.compilation.elements.element_batch import Columns, Elements, blocks
from tolcontact.compilation.elements.element_functions import BLOCK
from tolcontact.compilation.elements.mover_functions import mover_functions
from tolcontact.compilation.elements.pair_element import PairElements
from tolcontact.compilation.functions import IndexedFunction
from tolcontact.mechanics.correction import FREEDOMS


class BlockSum:
    """Sums of contributions by their targets, always in the same order, so that results do not depend on the block size.

    positions   (contribution,): position of each contribution in the array of all contributions, which is sorted by targets
    """

    def __init__(self, targets: Int[Array, " contribution"], count: int) -> None:
        self._count = count
        order = np.argsort(targets, kind="stable")
        self.positions = np.empty(len(order), dtype=int)
        self.positions[order] = np.arange(len(order))
        self._present, self._starts = np.unique(targets[order], return_index=True)

    def __call__(self, contributions: Float[Array, "n _"]) -> Float[Array, "n _"]:
        """Return the sums (n, target * entry) of (n, contribution * entry), zero for targets without contributions."""
        count, contribution = len(contributions), len(self.positions)
        if contribution == self._count == len(self._present):
            return contributions
        entries = contributions.shape[1] // max(contribution, 1)
        sums = np.zeros((count, self._count, entries))
        if contribution:
            sums[:, self._present] = np.add.reduceat(contributions.reshape(count, contribution, entries), self._starts, axis=1)
        return sums.reshape(count, self._count * entries)


class SparseLayout:
    """The stored entries of a matrix in CasADi's order, column by column.

    `positions` are the positions of the given entries, which must be distinct, among the stored entries.
    """

    def __init__(self, shape: tuple[int, int], rows: Int[Array, " entry"], columns: Int[Array, " entry"]) -> None:
        order = np.lexsort((rows, columns))
        self.positions = np.empty(len(order), dtype=int)
        self.positions[order] = np.arange(len(order))
        self.sparsity = ca.Sparsity.triplet(*shape, rows.tolist(), columns.tolist())

    def __len__(self) -> int:
        return len(self.positions)


@dataclass(frozen=True, eq=False)
class Movers:
    """The functions of movers on the arrays of the whole group, see MoverFunctions."""

    factor: IndexedFunction
    whiten: IndexedFunction
    couple: IndexedFunction
    coupling_forces: IndexedFunction
    step: IndexedFunction


class ElementLayout:
    """The layout of a QP of movers, with rows and slacks, that is assembled from elements of several kinds.

    elements        number of elements of all kinds

    mover_sum, coupling_sum, force_sum   sums of element contributions to movers, to pairs of coupled movers, and to forces
    columns         the columns of the contributions of each kind, by name
    matrices        h and a
    slot_rows       (slot,) the rows of the slots
    """

    def __init__(self, kinds: Sequence[Elements], *, movers: int, rows: int, slacks: int) -> None:
        self._movers, self._slacks, self.elements = movers, slacks, sum(map(len, kinds))
        couplings = np.concatenate([np.zeros((0, 2), dtype=int), *(kind.couplings for kind in kinds)])
        codes, indices = np.unique(couplings[:, 0] * movers + couplings[:, 1], return_inverse=True)
        self._coupled = np.column_stack(np.divmod(codes, movers))
        diagonal = np.concatenate([kind.movers.ravel() for kind in kinds])
        self.mover_sum = BlockSum(diagonal, movers)
        self.coupling_sum = BlockSum(indices.ravel(), len(codes))
        self.force_sum = BlockSum(np.concatenate([diagonal, *self._coupled.T]), movers)
        self._contributions = len(diagonal)
        pairs = [kind for kind in kinds if isinstance(kind, PairElements) and kind.slots.size]
        self.slot_rows = np.sort(np.concatenate([np.zeros(0, dtype=int), *(kind.rows.ravel() for kind in pairs)]))
        self.matrices = {"h": self._lay_out_h(), "a": self._lay_out_a(kinds, rows)}
        self.columns = self._columns_of(kinds)

    @property
    def sizes_of_terms(self) -> dict[str, int]:
        """The number of entries that all elements contribute, by name."""
        between = BLOCK * len(self.coupling_sum.positions)
        sizes = {"gradient": FREEDOMS * self._contributions, "augmented_gradient": FREEDOMS * self._contributions}
        for name in ("Q", "curvature", "proximal_hessian"):
            sizes |= {name: BLOCK * self._contributions, f"{name}_between": between}
        return sizes

    def of_movers(self) -> Movers:
        """Return the functions of movers."""
        functions, movers = mover_functions(), np.arange(self._movers)[:, None]
        single = {
            **dict.fromkeys(("Q", "curvature", "V"), blocks(movers, BLOCK)),
            **dict.fromkeys(("gradient", "g", "y", "step"), blocks(movers, FREEDOMS)),
            "convex": movers,
        }
        i, j = self._coupled[:, :1], self._coupled[:, 1:]
        count = len(self._coupled)
        upper, lower = self._coupling_positions.reshape(2, count, BLOCK)
        forces = self.force_sum.positions[self._contributions :].reshape(2, count, 1)
        pairs = {
            "Q": blocks(np.arange(count)[:, None], BLOCK), "V_i": blocks(i, BLOCK), "V_j": blocks(j, BLOCK),
            "H": upper, "mirrored": lower, "y_i": blocks(i, FREEDOMS), "y_j": blocks(j, FREEDOMS),
            "force_i": blocks(forces[0], FREEDOMS), "force_j": blocks(forces[1], FREEDOMS),
        }  # fmt: skip
        of_one = {name: getattr(functions, name).at(single) for name in ("factor", "whiten", "step")}
        return Movers(**of_one, **{name: getattr(functions, name).at(pairs) for name in ("couple", "coupling_forces")})

    def _lay_out_h(self) -> SparseLayout:
        freedoms = np.arange(FREEDOMS)
        i, j = (FREEDOMS * self._coupled.T)[:, :, None, None]
        row, column = (block.ravel() for block in np.broadcast_arrays(i + freedoms, j + freedoms[:, None]))
        size = FREEDOMS * self._movers + self._slacks
        ones = np.arange(size)
        h = SparseLayout((size, size), np.concatenate([row, column, ones]), np.concatenate([column, row, ones]))
        self._coupling_positions = h.positions[: 2 * row.size]
        return h

    def _lay_out_a(self, kinds: Sequence[Elements], row_count: int) -> SparseLayout:
        freedoms, slack = np.arange(FREEDOMS), FREEDOMS * self._movers
        entries = []
        for kind in kinds:
            z = (FREEDOMS * kind.movers[:, :, None] + freedoms).reshape(len(kind), -1)
            entries.append(np.broadcast_arrays(kind.rows[:, None, :], z[:, :, None]))
        entries += [(kind.rows, slack + kind.slacks) for kind in kinds if isinstance(kind, PairElements)]
        rows, columns = ([part.ravel() for part in parts] for parts in zip(*entries, strict=True))
        a = SparseLayout((row_count, slack + self._slacks), np.concatenate(rows), np.concatenate(columns))
        self._row_positions = np.split(a.positions, np.cumsum([part.size for part in rows])[:-1])
        return a

    def _columns_of(self, kinds: Sequence[Elements]) -> list[dict[str, Columns]]:
        """Return the columns of the contributions of each kind of elements."""
        columns_of_kinds, start, start_between = [], 0, 0
        openings = iter(self._row_positions[len(kinds) :])
        for k, kind in enumerate(kinds):
            count, movers = kind.movers.shape
            couplings = len(kind.couplings)
            on_diagonal = slice(start, start := start + count * movers)
            between = slice(start_between, start_between := start_between + couplings)
            diagonal, force = (_by_element(sums.positions[on_diagonal], count) for sums in (self.mover_sum, self.force_sum))
            coupled = _by_element(self.coupling_sum.positions[between], count)
            columns = {
                **dict.fromkeys(("Q", "curvature", "proximal_hessian"), blocks(diagonal, BLOCK)),
                **dict.fromkeys(("Q_between", "curvature_between", "proximal_hessian_between"), blocks(coupled, BLOCK)),
                **dict.fromkeys(("gradient", "augmented_gradient"), blocks(diagonal, FREEDOMS)),
                "force": blocks(force, FREEDOMS),
                "a": _by_element(self._row_positions[k], count),
            }
            if isinstance(kind, PairElements):
                columns |= {"opening": _by_element(next(openings), count), "slack": FREEDOMS * self._movers + kind.slacks}
            columns_of_kinds.append(columns)
        return columns_of_kinds


def _by_element(positions: Int[Array, " contribution"], elements: int) -> Int[Array, "element _"]:
    return positions.reshape(elements, len(positions) // elements)
