"""The element of a contact pair, with the parts that its increments move."""

import pickle
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Int
from tolcontact.compilation.conditioning import conditioned_rows, idle_row, openings
from tolcontact.compilation.contact_rows import RowPoints, compliance_of, contact_rows, slot_points
from tolcontact.compilation.elements.element import Element, Extent
from tolcontact.compilation.elements.element_batch import Arrays, Columns, Elements, blocks, flat_row
from tolcontact.compilation.elements.element_functions import (
    BLOCK,
    Functions,
    common_shapes,
    element_equations,
    function_of,
    symbols,
    term_functions,
    upper_blocks,
)
from tolcontact.compilation.functions import Located, NamedFunction
from tolcontact.compilation.outcome import reactions, row_residuals
from tolcontact.discretization import ContactPoints, Nominal
from tolcontact.mechanics.correction import linear
from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.groups import Group
from tolcontact.mechanics.pose import ENTRIES, poses_of
from tolcontact.method import Method

POINTS = ("P_m", "P_r", "n_r")


@dataclass(frozen=True, eq=False)
class PairElement(Element):
    """A pair of a group; its index is the position of the pair.

    sides      indices of the sides of the pair
    points     the contact points that always have a row, or the number of slots
    """

    sides: tuple[int, ...]
    points: np.ndarray | int

    @property
    def contact(self) -> ContactPoints:
        """The contact points of the pair."""
        return self.nominal.pairs[self.group.pairs[0]]

    @property
    def has_slots(self) -> bool:
        """Whether the rows are slots for changing points."""
        return isinstance(self.points, int)

    @property
    def rows(self) -> int:
        """The number of rows in the QP."""
        return self.points if isinstance(self.points, int) else len(self.points)

    @cached_property
    def compliance(self) -> np.ndarray:
        """The compliance (row,) [mm/N] of the rows; 0 for rigid ones."""
        return np.zeros(self.rows) if isinstance(self.points, int) else compliance_of(self.contact)[self.points]

    @cached_property
    def springs(self) -> list[int]:
        """The compliant rows."""
        return np.flatnonzero(self.compliance).tolist()

    @cached_property
    def deviating(self) -> tuple[bool, bool]:
        """Whether the moving and the reference face rotate or shift in their parts."""
        moving, reference = (face is not None and bool(face.twist.any()) for face in self.contact.deviating)
        return moving, reference

    @property
    def kind(self) -> Hashable:
        """The key under which elements share functions; functions of round faces contain their constants."""
        group, pair = self.group, self.contact
        round_points = () if pair.round is None else tuple(pickle.dumps(point) for point in pair.round)
        ends = group.position(pair.moving), None if pair.reference is None else group.position(pair.reference)
        return super().kind, self.rows, self.has_slots, tuple(self.springs), round_points, ends, self.deviating


def pair_elements(nominal: Nominal, group: Group, standing: Sequence[np.ndarray | int]) -> list[PairElement]:
    """Return the elements of the pairs of a group; see contact_qp for `standing`."""
    return [_element(nominal, group, pair, points) for pair, points in enumerate(standing)]


def _element(nominal: Nominal, group: Group, pair: int, points: np.ndarray | int) -> PairElement:
    contact = nominal.pairs[group.pairs[pair]]
    extent = Extent.around(group, [group.position(part) for part in (contact.moving, contact.reference) if part is not None])
    indices = tuple(k for k, side in enumerate(group.sides) if side.pair == pair)
    sides = tuple(replace(group.sides[k], pair=0, part=extent.parts.index(group.sides[k].part)) for k in indices)
    local = replace(extent.alone(group), pairs=(group.pairs[pair],), sides=sides)
    return PairElement(nominal, local, pair, extent.parts, extent.movers, indices, points)


def pair_functions(element: PairElement, method: Method, *, projects: bool) -> Functions:
    """Return the functions of the pairs of the same kind as `element`; see quadratic_terms for `projects`.

    They are the functions of term_functions, and the following, for p parts, r rows and z increments of the element's movers:

    terms     slopes (r, z), gaps (r)
    rows      slopes, gaps, filled, V (36, mover), idle (r, z), length, compliance, scale -> a (r, z), opening, lower,
              row_length (r)
    check     a, opening, lower, row_length, filled, y, slack (r), lam, scale -> residual, force (z), multipliers (r), and
              slack_force of the pair and of its springs
    advance   poses (12 p), faces, constants, length, step (z) -> linearized (12): X_RM, linear in the step
    relate    poses (12 p), faces -> relative (12)
    """
    inputs = _inputs(element)
    faces = iter(poses_of(ca.vec(inputs["faces"])))
    moving, reference = (next(faces) if deviates else None for deviates in element.deviating)
    heights = [inputs.get("heights", ca.SX(2, 1))]
    system = element_equations(element, method, inputs, moments=inputs["moments"], faces=[(moving, reference)], heights=heights)
    motion = system.motion(poses_of(inputs["poses"]))
    rows = contact_rows(system, [_row_points(element, inputs)], motion.poses, motion.by(linear), inputs["reactions"])
    results = {"slopes": rows.slopes, "gaps": rows.gaps}
    return {
        **term_functions(system, rows, motion, inputs, results, projects=projects),
        "rows": _rows_function(element, inputs),
        "check": _check_function(element, inputs),
        "advance": function_of("advance", inputs | {"step": system.z}, {"linearized": rows.relative}),
        "relate": function_of("relate", inputs, {"relative": system.relative(motion.poses)[0].vector()}),
    }


def _inputs(element: PairElement) -> dict[str, ca.SX]:
    """Return the inputs of `terms` by name: the inputs of contact_qp for the element's sides and rows, and some more.

    faces (12, face)     poses of the deviating faces in their parts
    heights (2)          growth of the moving and the reference face
    compliance           compliance of the compliant rows
    """
    rows = element.rows
    shapes = common_shapes(element) | {
        "moments": (MOMENTS, len(element.sides)),
        "reactions": (rows, 1),
        "faces": (ENTRIES, sum(element.deviating)),
        "compliance": (len(element.springs), 1),
    }
    if element.contact.round is not None:
        shapes["heights"] = (2, 1)
    else:
        shapes |= dict.fromkeys(("P_m", "P_r", "n_r"), (3, rows))
    if element.has_slots:
        shapes |= {"bend": (ENTRIES, 1), "filled": (rows, 1)}
    return symbols(shapes)


def _row_points(element: PairElement, inputs: Mapping[str, ca.SX]) -> RowPoints:
    compliance = _compliance(element, inputs)
    if element.contact.round is not None:
        return RowPoints([], compliance)
    points = list(slot_points({**inputs, "filled": _filled(element, inputs)}))
    return RowPoints(points, compliance, inputs["bend"] if element.has_slots else None)


def _compliance(element: PairElement, inputs: Mapping[str, ca.SX]) -> ca.SX:
    """Return the compliance (row, 1) of all rows."""
    compliance = ca.SX.zeros(element.rows)
    compliance[element.springs] = inputs["compliance"]
    return compliance


def _filled(element: PairElement, inputs: Mapping[str, ca.SX]) -> ca.SX:
    return inputs.get("filled", ca.SX.ones(element.rows))


def _rows_function(element: PairElement, inputs: Mapping[str, ca.SX]) -> NamedFunction:
    rows, size = element.rows, element.size
    shapes = {"slopes": (rows, size), "gaps": (rows, 1), "V": (BLOCK, len(element.movers)), "idle": (rows, size)}
    inputs = {**inputs, **symbols(shapes)}
    idle = [inputs["idle"][k, :].T for k in range(rows)]  # only used in slots that can be empty
    opening = openings(_compliance(element, inputs), inputs["scale"])
    A = ca.densify(inputs["slopes"] @ upper_blocks(inputs["V"]))
    result = conditioned_rows(A, inputs["gaps"], _filled(element, inputs), idle, inputs["length"], opening)
    names = ("a", "opening", "lower", "row_length")
    return function_of("rows", inputs, dict(zip(names, result, strict=True)))


def _check_function(element: PairElement, inputs: Mapping[str, ca.SX]) -> NamedFunction:
    rows, size = element.rows, element.size
    shapes = {"a": (rows, size), "y": (size, 1), **dict.fromkeys(("opening", "lower", "row_length", "lam", "slack"), (rows, 1))}
    inputs = {**inputs, "filled": ca.SX.sym("filled", rows), **symbols(shapes)}
    a, opening, length, lam = (inputs[name] for name in ("a", "opening", "row_length", "lam"))
    excess = a @ inputs["y"] + opening * inputs["slack"] - inputs["lower"]
    by_row = opening * lam
    rigid = [row for row in range(rows) if row not in element.springs]
    outputs = {
        "residual": ca.norm_inf(row_residuals(excess, lam, length)),
        "force": a.T @ lam,
        "slack_force": ca.vertcat(ca.sum1(by_row[rigid]), by_row[element.springs]),
        "multipliers": reactions(lam, length, inputs["filled"], inputs["scale"]),
    }
    return function_of("check", inputs, outputs)


class FirstIndices(NamedTuple):
    """The group-wide index (pair,) of each pair's first row, deviating face, slot, bend, and slack of a spring."""

    row: Int[Array, " pair"]
    face: Int[Array, " pair"]
    slot: Int[Array, " pair"]
    bend: Int[Array, " pair"]
    spring: Int[Array, " pair"]

    @classmethod
    def of(cls, elements: Sequence[PairElement]) -> "FirstIndices":
        """Return the indices of all pairs of a group, in their order; slacks of springs follow the slacks of the pairs."""
        counts = [(e.rows, sum(e.deviating), e.rows * e.has_slots, int(e.has_slots), len(e.springs)) for e in elements]
        row, face, slot, bend, spring = (np.cumsum([0, *column[:-1]]) for column in zip(*counts, strict=True))
        return cls(row, face, slot, bend, spring + len(elements))


class PairElements(Elements):
    """Pairs of one kind in a group.

    slacks  (element, row) slack of each row
    """

    def __init__(self, elements: Sequence[PairElement], functions: Functions, firsts: FirstIndices) -> None:
        self._pairs, self._firsts = elements, firsts
        pairs = np.array([element.index for element in elements])
        super().__init__(elements, functions, firsts.row[pairs][:, None] + np.arange(elements[0].rows))
        self._slots = firsts.slot[pairs][:, None] + np.arange(self.row_count)
        springs = elements[0].springs
        self._springs = firsts.spring[pairs][:, None] + np.arange(len(springs))
        self.slacks = np.tile(pairs[:, None], self.row_count)
        self.slacks[:, springs] = self._springs

    @property
    def slots(self) -> Int[Array, "element row"]:
        """The group-wide slot of each row; empty if points always have a row."""
        return self._slots if self._pairs[0].has_slots else self._slots[:, :0]

    def constants(self) -> Arrays:
        """Return the arrays (1, column) that never change: constants, idle rows, and points that always have a row."""
        # CasADi stores matrices column by column.
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

    def columns(self) -> dict[str, Columns]:
        """Return the columns of the group's arrays that elements read or write, by array name."""
        elements, indices = self._pairs, np.arange(len(self))[:, None]
        pairs = self.indices[:, None]
        faces = self._firsts.face[pairs] + np.arange(sum(elements[0].deviating))
        springs = len(elements[0].springs)
        columns = super().columns() | {
            "moments": blocks(np.array([element.sides for element in elements], dtype=int), MOMENTS),
            "faces": blocks(faces, ENTRIES),
            "heights": blocks(pairs, 2),
            "compliance": blocks(indices, springs),
            "idle": blocks(indices, self.row_count * self.size),
            **dict.fromkeys(("reactions", "gaps", "filled", "row_length", "multipliers"), self.rows),
            "slack_force": np.concatenate([pairs, self._springs], axis=1),
            **dict.fromkeys(("linearized", "relative"), blocks(pairs, ENTRIES)),
            "bend": blocks(self._firsts.bend[pairs], ENTRIES),
        }
        points = blocks(indices, 3 * self.row_count) if self._has_standing_points else blocks(self._slots, 3)
        return columns | dict.fromkeys(POINTS, points)

    @property
    def _has_standing_points(self) -> bool:
        return self._pairs[0].contact.round is None and not self._pairs[0].has_slots
