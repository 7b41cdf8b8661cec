"""The elements of one kind, evaluated together: where their numbers stand among those of the whole group."""

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

VALUES_OF_ALL = ("regularization_factor", "length", "count", "scale", "load")


class Elements:
    """Elements of one kind in a group.

    numbers    (element,) of each element among those of all kinds
    movers     (element, mover) numbers of the movers
    size       number of increments of an element
    rows       (element, row) of each element among the rows of the QP
    couplings  (element * coupling, 2) movers that an element couples
    """

    def __init__(self, elements: Sequence[Element], functions: Functions, rows: Int[Array, "element row"]) -> None:
        self.functions, self._elements = functions, elements
        self.rows, self.size = rows, elements[0].size
        self.numbers = np.array([element.number for element in elements])
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
        """Return what never changes (1, column)."""
        return {"constants": flat_row([element.constants for element in self._elements])}

    def points(self, constants: Mapping[str, Located], deviations: np.ndarray) -> Arrays:
        """Return those of its `constants` (realization, column) that deviations change."""
        del constants, deviations
        return {}

    def places(self) -> dict[str, Columns]:
        """Return the columns of what elements read from, or write into, the arrays of the whole group, by name."""
        count, own = len(self), np.arange(len(self))[:, None]
        return {
            **dict.fromkeys(("poses", "raw"), blocks(np.array([element.parts for element in self._elements]), ENTRIES)),
            "constants": blocks(own, len(self._elements[0].constants)),
            "slopes": blocks(own, self.row_count * self.size),
            **dict.fromkeys(VALUES_OF_ALL, np.zeros((count, 1), dtype=int)),
            **dict.fromkeys(("lower", "lam"), self.rows),
            "V": blocks(self.movers, BLOCK),
            **dict.fromkeys(("y", "step"), blocks(self.movers, FREEDOMS)),
            **dict.fromkeys(("residual", "energy"), self.numbers[:, None]),
        }


@dataclass(frozen=True, eq=False)
class ElementBatch:
    """The functions of a kind on the arrays of the whole group, by name; and arrays that are its own.

    elements   what they are
    own        arrays (1, column) that never change, by name
    """

    elements: Elements
    own: dict[str, Located]
    functions: Mapping[str, IndexedFunction]

    @classmethod
    def of(cls, elements: Elements, places: Mapping[str, Columns]) -> "ElementBatch":
        """Return the functions of elements, with the `places` of contributions to sums, and of entries of matrices."""
        places = {**elements.places(), **places}
        functions = {name: function.at(places) for name, function in elements.functions.items()}
        return cls(elements, located(elements.constants()), functions)

    def evaluate(self, name: str, count: int, arrays: Mapping[str, Located]) -> None:
        """Evaluate a function for `count` realizations; a kind without it contributes nothing."""
        if name in self.functions:
            self.functions[name](count, arrays)

    def arrays(self, deviations: np.ndarray) -> dict[str, Located]:
        """Return the arrays that are its own, (1, column) or (realization, column); `slopes` are to be computed."""
        slopes = np.empty((len(deviations), self.elements.rows.size * self.elements.size))
        return self.own | located({"slopes": slopes, **self.elements.points(self.own, deviations)})


def blocks(numbers: Int[Array, "element block"], size: int) -> Columns:
    """Return the columns (element, block * size) of blocks of `size` entries, by their numbers."""
    return (numbers[:, :, None] * size + np.arange(size)).reshape(len(numbers), numbers.shape[1] * size)


def flat_row(values: Sequence[np.ndarray]) -> Float[Array, "1 _"]:
    """Return equally many values of each element, one after the other."""
    return np.array(values, dtype=float).reshape(1, -1)
