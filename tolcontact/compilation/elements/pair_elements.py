"""The pairs of one kind: where their numbers stand among those of the whole group."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Int
from tolcontact.compilation.conditioning import idle_row
from tolcontact.compilation.elements.element_batch import Arrays, Columns, Elements, blocks, flat_row
from tolcontact.compilation.elements.element_functions import Functions
from tolcontact.compilation.elements.pair_element import PairElement
from tolcontact.compilation.functions import Located
from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.pose import ENTRIES

POINTS = ("P_m", "P_r", "n_r")


class Numbers(NamedTuple):
    """The number of each pair's first row, deviating face, slot, bend and spring's slack among those of the group, (pair,)."""

    row: Int[Array, " pair"]
    face: Int[Array, " pair"]
    slot: Int[Array, " pair"]
    bend: Int[Array, " pair"]
    spring: Int[Array, " pair"]

    @classmethod
    def of(cls, elements: Sequence[PairElement]) -> "Numbers":
        """Return the numbers of all pairs of a group, in their order; slacks of springs follow those of the pairs."""
        counts = [(e.rows, sum(e.deviating), e.rows * e.has_slots, int(e.has_slots), len(e.springs)) for e in elements]
        row, face, slot, bend, spring = (np.cumsum([0, *column[:-1]]) for column in zip(*counts, strict=True))
        return cls(row, face, slot, bend, spring + len(elements))


class PairElements(Elements):
    """Pairs of one kind in a group.

    slacks  (element, row) slack of each row
    """

    def __init__(self, elements: Sequence[PairElement], functions: Functions, numbers: Numbers) -> None:
        self._pairs, self._numbers = elements, numbers
        pairs = np.array([element.number for element in elements])
        super().__init__(elements, functions, numbers.row[pairs][:, None] + np.arange(elements[0].rows))
        self._slots = numbers.slot[pairs][:, None] + np.arange(self.row_count)
        springs = elements[0].springs
        self._springs = numbers.spring[pairs][:, None] + np.arange(len(springs))
        self.slacks = np.tile(pairs[:, None], self.row_count)
        self.slacks[:, springs] = self._springs

    @property
    def slots(self) -> Int[Array, "element row"]:
        """The slots of its rows among those of the group; none if points always have a row."""
        return self._slots if self._pairs[0].has_slots else self._slots[:, :0]

    def constants(self) -> Arrays:
        """Return what never changes (1, column): constants, idle rows, and points that always have a row."""
        # Columns of a matrix stand one after the other in the arrays of CasADi.
        idle = [np.array([idle_row(row, self.size).full().ravel() for row in rows]).T for rows in self.rows.tolist()]
        constants = super().constants() | {
            "idle": flat_row(idle),
            "compliance": flat_row([element.compliance[element.springs] for element in self._pairs]),
        }
        if self._has_standing_points:
            constants |= {name: flat_row([getattr(e.contact, name)[e.points] for e in self._pairs]) for name in POINTS}
        return constants

    def points(self, constants: Mapping[str, Located], deviations: np.ndarray) -> Arrays:
        """Return P_r (realization, column) of points that always have a row, where deviations shift them along the normals."""
        if not self._has_standing_points or not any(element.contact.offsets.columns.size for element in self._pairs):
            return {}
        shifts = np.empty((len(deviations), len(self), self.row_count, 3))
        for k, element in enumerate(self._pairs):
            points = np.broadcast_to(np.asarray(element.points), (len(deviations), self.row_count))
            heights = element.contact.offsets.heights(deviations, points)
            shifts[:, k] = heights[:, :, None] * element.contact.n_r[element.points]
        return {"P_r": constants["P_r"].array + shifts.reshape(len(deviations), -1)}

    def places(self) -> dict[str, Columns]:
        """Return the columns of what elements read from, or write into, the arrays of the whole group, by name."""
        elements, own = self._pairs, np.arange(len(self))[:, None]
        pairs = self.numbers[:, None]
        faces = self._numbers.face[pairs] + np.arange(sum(elements[0].deviating))
        springs = len(elements[0].springs)
        places = super().places() | {
            "moments": blocks(np.array([element.sides for element in elements], dtype=int), MOMENTS),
            "faces": blocks(faces, ENTRIES),
            "heights": blocks(pairs, 2),
            "compliance": blocks(own, springs),
            "idle": blocks(own, self.row_count * self.size),
            **dict.fromkeys(("reactions", "gaps", "filled", "row_length", "multipliers"), self.rows),
            "slack_force": np.concatenate([pairs, self._springs], axis=1),
            **dict.fromkeys(("linearized", "relative"), blocks(pairs, ENTRIES)),
            "bend": blocks(self._numbers.bend[pairs], ENTRIES),
        }
        points = blocks(own, 3 * self.row_count) if self._has_standing_points else blocks(self._slots, 3)
        return places | dict.fromkeys(POINTS, points)

    @property
    def _has_standing_points(self) -> bool:
        return self._pairs[0].contact.round is None and not self._pairs[0].has_slots
