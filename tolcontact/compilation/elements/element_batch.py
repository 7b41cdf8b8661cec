"""The elements of one kind, evaluated together: where their numbers stand among those of the whole group."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.compilation.conditioning import idle_row
from tolcontact.compilation.elements.element import Element
from tolcontact.compilation.elements.element_functions import ElementFunctions
from tolcontact.compilation.functions import IndexedFunction, Located, located
from tolcontact.mechanics.correction import FREEDOMS
from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.pose import ENTRIES

Arrays = dict[str, Float[Array, "_ _"]]
Columns = Int[Array, "element _"]

BLOCK = FREEDOMS**2
VALUES_OF_ALL = ("firmness", "length", "count", "scale", "load")
POINTS = ("P_m", "P_r", "n_r")


class Numbers(NamedTuple):
    """The number of the first row, deviating face, slot and bend of each pair among those of the whole group, (pair,)."""

    row: Int[Array, " pair"]
    face: Int[Array, " pair"]
    slot: Int[Array, " pair"]
    bend: Int[Array, " pair"]

    @classmethod
    def of(cls, elements: Sequence[Element]) -> "Numbers":
        """Return the numbers of all pairs of a group, in their order."""
        counts = [(e.rows, sum(e.deviating), e.rows * e.has_slots, int(e.has_slots)) for e in elements]
        return cls(*(np.cumsum([0, *column[:-1]]) for column in zip(*counts, strict=True)))


class Elements:
    """Elements of one kind in a group.

    pairs      (element,) positions of the pairs
    parts, movers, sides, rows   (element, ...) numbers of what belongs to each element
    couplings  (element * coupling, 2) movers that an element couples
    """

    def __init__(self, elements: Sequence[Element], functions: ElementFunctions, numbers: Numbers) -> None:
        self.functions, self._elements = functions, elements
        self.pairs = np.array([element.pair for element in elements])
        self.movers = np.array([element.movers for element in elements])
        self.size, self.row_count = elements[0].size, elements[0].rows
        self.rows = numbers.row[self.pairs][:, None] + np.arange(self.row_count)
        pairs_of_movers = [*itertools.combinations(range(self.movers.shape[1]), 2)]
        self.couplings = self.movers[:, np.array(pairs_of_movers, dtype=int).reshape(-1, 2)].reshape(-1, 2)
        self.slots = numbers.slot[self.pairs][:, None] + np.arange(self.row_count)
        self._numbers = numbers

    @property
    def has_slots(self) -> bool:
        """Whether changing points take the rows in turns."""
        return self._elements[0].has_slots

    def constants(self) -> Arrays:
        """Return what never changes (1, column): constants, idle rows, and points that always have a row."""
        constants = {
            "constants": np.array([element.constants for element in self._elements]),
            # Columns of a matrix stand one after the other in the arrays of CasADi.
            "idle": np.array([
                np.array([idle_row(row, self.size).full().ravel() for row in rows]).T.ravel() for rows in self.rows.tolist()
            ]),
        }  # fmt: skip
        if self._has_standing_points:
            for name in POINTS:
                constants[name] = np.array([getattr(e.contact, name)[e.points].ravel() for e in self._elements])
        return {name: values.reshape(1, values.size) for name, values in constants.items()}

    def points(self, P_r: Float[Array, "1 _"] | None, deviations: np.ndarray) -> Arrays:
        """Return P_r (realization, column) of points that always have a row, where deviations shift them along the normals."""
        if P_r is None or not any(element.contact.offsets.columns.size for element in self._elements):
            return {}
        shifts = np.empty((len(deviations), len(self._elements), self.row_count, 3))
        for k, element in enumerate(self._elements):
            points = np.broadcast_to(np.asarray(element.points), (len(deviations), self.row_count))
            heights = element.contact.offsets.heights(deviations, points)
            shifts[:, k] = heights[:, :, None] * element.contact.n_r[element.points]
        return {"P_r": P_r + shifts.reshape(len(deviations), -1)}

    def places(self) -> dict[str, Columns]:
        """Return the columns of what elements read from, or write into, the arrays of the whole group, by name."""
        elements, count = self._elements, len(self._elements)
        parts = np.array([element.parts for element in elements])
        faces = self._numbers.face[self.pairs][:, None] + np.arange(sum(elements[0].deviating))
        pairs, own = self.pairs[:, None], np.arange(count)[:, None]
        places = {
            **dict.fromkeys(("poses", "raw"), blocks(parts, ENTRIES)),
            "moments": blocks(np.array([element.sides for element in elements], dtype=int), MOMENTS),
            "faces": blocks(faces, ENTRIES),
            "heights": blocks(pairs, 2),
            "constants": blocks(own, len(elements[0].constants)),
            "idle": blocks(own, self.row_count * self.size),
            "slopes": blocks(own, self.row_count * self.size),
            **dict.fromkeys(VALUES_OF_ALL, np.zeros((count, 1), dtype=int)),
            **dict.fromkeys(("reactions", "gaps", "filled", "lower", "row_length", "lam", "multipliers"), self.rows),
            "V": blocks(self.movers, BLOCK),
            **dict.fromkeys(("y", "step"), blocks(self.movers, FREEDOMS)),
            **dict.fromkeys(("residual", "slack_force", "energy"), pairs),
            **dict.fromkeys(("linearized", "relative"), blocks(pairs, ENTRIES)),
            "bend": blocks(self._numbers.bend[pairs], ENTRIES),
        }
        points = blocks(own, 3 * self.row_count) if self._has_standing_points else blocks(self.slots, 3)
        return places | dict.fromkeys(POINTS, points)

    @property
    def _has_standing_points(self) -> bool:
        return self._elements[0].contact.round is None and not self.has_slots


@dataclass(frozen=True, eq=False)
class ElementBatch:
    """The functions of a kind on the arrays of the whole group, see ElementFunctions; and arrays that are its own.

    elements   what they are
    own        arrays (1, column) that never change, by name
    """

    elements: Elements
    own: dict[str, Located]
    terms: IndexedFunction
    newton: IndexedFunction | None
    rows: IndexedFunction
    check: IndexedFunction
    advance: IndexedFunction
    relate: IndexedFunction
    energy: IndexedFunction

    @classmethod
    def of(cls, elements: Elements, places: Mapping[str, Columns]) -> "ElementBatch":
        """Return the functions of elements, with the `places` of contributions to sums, and of entries of matrices."""
        functions, places = elements.functions, {**elements.places(), **places}
        newton = functions.newton
        return cls(
            elements,
            located(elements.constants()),
            newton=None if newton is None else newton.at(places),
            **{name: getattr(functions, name).at(places) for name in ("terms", "rows", "check", "advance", "relate", "energy")},
        )

    def arrays(self, deviations: np.ndarray) -> dict[str, Located]:
        """Return the arrays that are its own, (1, column) or (realization, column); `slopes` are to be computed."""
        slopes = np.empty((len(deviations), self.elements.rows.size * self.elements.size))
        P_r = self.own["P_r"].array if "P_r" in self.own else None
        return self.own | located({"slopes": slopes, **self.elements.points(P_r, deviations)})


def blocks(numbers: Int[Array, "element block"], size: int) -> Columns:
    """Return the columns (element, block * size) of blocks of `size` entries, by their numbers."""
    return (numbers[:, :, None] * size + np.arange(size)).reshape(len(numbers), numbers.shape[1] * size)
