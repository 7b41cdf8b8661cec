"""The elements of one kind, evaluated together, and their columns in the arrays of the whole group."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.compilation.elements.element import Element
from tolcontact.compilation.elements.element_functions import BLOCK, Functions
from tolcontact.compilation.functions import IndexedFunction, Located, located
from tolcontact.mechanics.correction import FREEDOMS
from tolcontact.mechanics.pose import ENTRIES

Arrays = dict[str, Float[Array, "_ _"]]
Columns = Int[Array, "element _"]

SHARED_VALUES = ("regularization_factor", "length", "count", "scale", "load")


class Elements:
    """Elements of one kind in a group.

    indices    (element,) index of each element among the elements of all kinds
    movers     (element, mover) indices of the movers
    size       number of increments of an element
    rows       (element, row) indices of each element's rows in the QP
    couplings  (element * coupling, 2) movers that an element couples
    """

    def __init__(self, elements: Sequence[Element], functions: Functions, rows: Int[Array, "element row"]) -> None:
        self.functions, self._elements = functions, elements
        self.rows, self.size = rows, elements[0].size
        self.indices = np.array([element.index for element in elements])
        self.movers = np.array([element.movers for element in elements])
        pairs_of_movers = [*itertools.combinations(range(self.movers.shape[1]), 2)]
        self.couplings = self.movers[:, np.array(pairs_of_movers, dtype=int).reshape(-1, 2)].reshape(-1, 2)

    def __len__(self) -> int:
        return len(self._elements)

    @property
    def row_count(self) -> int:
        """The number of rows of an element."""
        return self.rows.shape[1]

    def constants(self) -> Arrays:
        """Return the arrays (1, column) that never change, by name."""
        return {"constants": flat_row([element.constants for element in self._elements])}

    def points(self, constants: Mapping[str, Located], deviations: np.ndarray) -> Arrays:
        """Return the arrays (realization, column) of `constants` that depend on deviations."""
        del constants, deviations
        return {}

    def columns(self) -> dict[str, Columns]:
        """Return the columns of the group's arrays that elements read or write, by array name."""
        count, elements = len(self), np.arange(len(self))[:, None]
        return {
            **dict.fromkeys(("poses", "raw"), blocks(np.array([element.parts for element in self._elements]), ENTRIES)),
            "constants": blocks(elements, len(self._elements[0].constants)),
            "slopes": blocks(elements, self.row_count * self.size),
            **dict.fromkeys(SHARED_VALUES, np.zeros((count, 1), dtype=int)),
            **dict.fromkeys(("lower", "lam"), self.rows),
            "V": blocks(self.movers, BLOCK),
            **dict.fromkeys(("y", "step"), blocks(self.movers, FREEDOMS)),
            **dict.fromkeys(("residual", "energy"), self.indices[:, None]),
        }


@dataclass(frozen=True, eq=False)
class ElementBatch:
    """The functions of a kind of elements on the arrays of the whole group, by name; and the arrays of this kind.

    elements    the elements of this kind
    constants   arrays (1, column) that never change, by name
    """

    elements: Elements
    constants: dict[str, Located]
    functions: Mapping[str, IndexedFunction]

    @classmethod
    def of(cls, elements: Elements, columns: Mapping[str, Columns]) -> "ElementBatch":
        """Return the functions of elements, with the `columns` of their contributions to sums and matrices."""
        columns = {**elements.columns(), **columns}
        functions = {name: function.at(columns) for name, function in elements.functions.items()}
        return cls(elements, located(elements.constants()), functions)

    def evaluate(self, name: str, count: int, arrays: Mapping[str, Located]) -> None:
        """Evaluate a function for `count` realizations; a kind without it contributes nothing."""
        if name in self.functions:
            self.functions[name](count, arrays)

    def arrays(self, deviations: np.ndarray) -> dict[str, Located]:
        """Return the arrays of this kind, (1, column) or (realization, column); `slopes` are not yet computed."""
        slopes = np.empty((len(deviations), self.elements.rows.size * self.elements.size))
        return self.constants | located({"slopes": slopes, **self.elements.points(self.constants, deviations)})


def blocks(indices: Int[Array, "element block"], size: int) -> Columns:
    """Return the columns (element, block * size) of blocks of `size` entries, by block index."""
    return (indices[:, :, None] * size + np.arange(size)).reshape(len(indices), indices.shape[1] * size)


def flat_row(values: Sequence[np.ndarray]) -> Float[Array, "1 _"]:
    """Return the values of all elements, equally many of each, concatenated in one row."""
    return np.array(values, dtype=float).reshape(1, -1)
