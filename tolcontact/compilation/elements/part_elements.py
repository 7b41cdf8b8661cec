"""The parts of one kind with forces and two-sided locators: where their numbers stand among those of the whole group."""

from collections.abc import Sequence

import numpy as np

from tolcontact.compilation.elements.element_batch import Columns, Elements
from tolcontact.compilation.elements.element_functions import Functions
from tolcontact.compilation.elements.part_element import PartElement


class PartElements(Elements):
    """Parts of one kind in a group; their equations follow the `rows` of its pairs."""

    def __init__(self, elements: Sequence[PartElement], functions: Functions, rows: int) -> None:
        firsts, equations = np.array([element.first for element in elements]), elements[0].equations
        super().__init__(elements, functions, rows + firsts[:, None] + np.arange(equations))
        self._steps = firsts[:, None] + np.arange(elements[0].locators)

    def places(self) -> dict[str, Columns]:
        """Return the columns of what elements read from, or write into, the arrays of the whole group, by name."""
        return super().places() | {"steps": self._steps, "astray": self.numbers[:, None]}
