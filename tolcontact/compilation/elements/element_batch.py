"""The elements of one kind, evaluated together: their numbers in the whole group, and their constants."""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.compilation.conditioning import idle_row
from tolcontact.compilation.elements.element import Element
from tolcontact.compilation.elements.element_functions import ElementFunctions
from tolcontact.compilation.functions import NamedFunction
from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.pose import ENTRIES, Number

Arrays = dict[str, np.ndarray]


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


class ElementBatch:
    """Elements of one kind in a group; arrays of theirs are (realization, element, ...).

    pairs      (element,) positions of the pairs
    parts, movers, sides, rows   (element, ...) numbers of what belongs to each element
    """

    def __init__(self, elements: Sequence[Element], functions: ElementFunctions, numbers: Numbers) -> None:
        self._elements, self._functions = elements, functions
        self.pairs = np.array([element.pair for element in elements])
        self.parts = np.array([element.parts for element in elements])
        self.movers = np.array([element.movers for element in elements])
        self.sides = np.array([element.sides for element in elements], dtype=int)
        self.size, self.row_count = elements[0].size, elements[0].rows
        self.rows = numbers.row[self.pairs][:, None] + np.arange(self.row_count)
        self._faces = numbers.face[self.pairs][:, None] + np.arange(sum(elements[0].deviating))
        self._slots = numbers.slot[self.pairs][:, None] + np.arange(self.row_count)
        self._bends = numbers.bend[self.pairs]
        self._constants = np.array([element.constants for element in elements])
        # Columns of a matrix stand one after the other in the arrays of CasADi.
        self._idle = np.array([
            np.array([idle_row(row, self.size).full().ravel() for row in rows]).T.ravel() for rows in self.rows.tolist()
        ])  # fmt: skip

    def terms(self, inputs: Arrays, shared: Arrays, *, newton: bool) -> Arrays:
        """Return the terms of all elements (realization, element, entry), if `newton` with curvature; and `filled` rows.

        `inputs` are those of contact_qp, (realization, entry); `shared` those of the elements that are computed once.
        """
        local = self._common(inputs, shared) | self._points(inputs)
        local["reactions"] = inputs["reactions"][:, self.rows]
        function = self._functions.newton if newton and self._functions.newton is not None else self._functions.terms
        terms = self._call(function, local)
        terms["filled"] = local.get("filled", np.ones((1, 1, 1)))
        return terms

    def conditioned(self, terms: Arrays, V: Float[Array, "n mover 36"], length: Number) -> Arrays:
        """Return a, opening, lower and row_length of the elements for V = U^-1 of all movers."""
        local = {name: terms[name] for name in ("slopes", "gaps", "filled")}
        local |= {"V": V[:, self.movers], "idle": self._idle[None], "length": np.full((1, 1, 1), length)}
        return self._call(self._functions.rows, local)

    def checked(self, local: Arrays) -> Arrays:
        """Return residual, force, slack_force and multipliers of the elements; see ElementFunctions."""
        return self._call(self._functions.check, local)

    def linearized(self, poses: np.ndarray, faces: np.ndarray, step: np.ndarray, length: Number) -> np.ndarray:
        """Return X_RM to first order (realization, element, 12) after steps (realization, mover, 6) from some poses."""
        local = {"poses": poses[:, self.parts], "faces": faces[:, self._faces], "step": step[:, self.movers]}
        local |= {"constants": self._constants[None], "length": np.full((1, 1, 1), length)}
        return self._call(self._functions.advance, local)["linearized"]

    def relative(self, poses: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """Return X_RM (realization, element, 12) at poses (realization, part, 12)."""
        local = {"poses": poses[:, self.parts], "faces": faces[:, self._faces]}
        return self._call(self._functions.relate, local)["relative"]

    def energy(self, inputs: Arrays, shared: Arrays) -> np.ndarray:
        """Return the objective of each element (realization, element, 1)."""
        return self._call(self._functions.energy, self._common(inputs, shared))["energy"]

    @cached_property
    def _standing(self) -> Arrays:
        """P_m, P_r and n_r (element, 3 * row) of points that always have a row."""
        return {
            name: np.array([getattr(e.contact, name)[e.points].ravel() for e in self._elements])
            for name in ("P_m", "P_r", "n_r")
        }

    def _points(self, inputs: Arrays) -> Arrays:
        """Return the inputs that hold contact points."""
        element = self._elements[0]
        if element.contact.round is not None:
            return {}
        if element.has_slots:
            points = {name: split(inputs[name], 3)[:, self._slots] for name in ("P_m", "P_r", "n_r")}
            bends = split(inputs["bend"], ENTRIES)[:, self._bends]
            return points | {"filled": inputs["filled"][:, self._slots], "bend": bends}
        points = {name: values[None] for name, values in self._standing.items()}
        if any(element.contact.offsets.columns.size for element in self._elements):
            points["P_r"] = points["P_r"] + self._raised(inputs["deviations"])
        return points

    def _raised(self, deviations: np.ndarray) -> np.ndarray:
        """Return by what deviations shift P_r along the normals (realization, element, 3 * row)."""
        shifts = np.empty((len(deviations), len(self._elements), self.row_count, 3))
        for k, element in enumerate(self._elements):
            points = np.broadcast_to(np.asarray(element.points), (len(deviations), self.row_count))
            heights = element.contact.offsets.heights(deviations, points)
            shifts[:, k] = heights[:, :, None] * element.contact.n_r[element.points]
        return shifts.reshape(len(deviations), len(self._elements), 3 * self.row_count)

    def _common(self, inputs: Arrays, shared: Arrays) -> Arrays:
        """Return the inputs that all functions of poses and objective share."""
        local = {name: split(inputs[name], ENTRIES)[:, self.parts] for name in ("poses", "raw")}
        local["moments"] = split(inputs["moments"], MOMENTS)[:, self.sides]
        local["faces"] = split(shared["faces"], ENTRIES)[:, self._faces]
        local["heights"] = split(shared["heights"], 2)[:, self.pairs]
        local["constants"] = self._constants[None]
        for name in ("scale", "load", "firmness", "length", "count"):
            if name in shared:
                local[name] = shared[name].reshape(-1, 1, 1)
        return local

    def _call(self, function: NamedFunction, local: Arrays) -> Arrays:
        """Evaluate a function for all elements of all realizations."""
        count = max(len(values) for values in local.values())
        return evaluated(function, local, (count, len(self._elements)))


def split(values: Float[Array, "n ..."], size: int) -> Float[Array, "n _ size"]:
    """Return arrays (n, group, entry) of groups of `size` entries."""
    return values.reshape(len(values), math.prod(values.shape[1:]) // size, size)


def evaluated(function: NamedFunction, arrays: Arrays, shape: tuple[int, ...]) -> Arrays:
    """Return the outputs (n, entry, ...) of a function for arrays that have this `shape` (n, entry), or 1 in its place."""
    rows = {}
    for name in function.names:
        values = arrays[name]
        size = math.prod(values.shape[2:])
        rows[name] = np.broadcast_to(values, shape + values.shape[2:]).reshape(shape[0] * shape[1], size)
    return {name: values.reshape(*shape, values.shape[1]) for name, values in function(**rows).items()}
