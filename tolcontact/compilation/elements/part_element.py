"""The element of a part with its forces and its two-sided locators, where the objective or equations contain them."""

import itertools
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from tolcontact.compilation.contact_rows import contact_rows
from tolcontact.compilation.elements.element import Element, Extent
from tolcontact.compilation.elements.element_batch import Columns, Elements
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
from tolcontact.discretization import Nominal
from tolcontact.mechanics.correction import linear
from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.groups import BilateralLocators, Group
from tolcontact.mechanics.placement import misfit
from tolcontact.mechanics.pose import poses_of
from tolcontact.method import Method


@dataclass(frozen=True, eq=False)
class PartElement(Element):
    """A part of a group.

    first       index of its first locator among the bilateral locators of the group
    locators    number of its rigid two-sided locators
    equations   number of equations of its locators
    """

    first: int
    locators: int
    equations: int

    @property
    def kind(self) -> Hashable:
        """The key under which elements share functions."""
        return super().kind, self.equations


def part_elements(nominal: Nominal, group: Group, method: Method) -> list[PartElement]:
    """Return the elements of the parts with forces or bilateral locators; none if points are the objective."""
    if method.minimizes.counts_points:
        return []
    presses = method.minimizes.presses
    pressed = {load.part for load in group.loads} if presses else set()
    parts = sorted(pressed | {locators.part for locators in group.bilateral})
    return [_element(nominal, group, k, part, presses=presses) for k, part in enumerate(parts, start=len(group.pairs))]


def _element(nominal: Nominal, group: Group, index: int, part: int, *, presses: bool) -> PartElement:
    bilateral = [locators for locators in group.bilateral if locators.part == part]
    others = [other for locators in bilateral for other in (*locators.owners, locators.parent) if other is not None]
    extent = Extent.around(group, [part, *others])
    local = replace(
        extent.alone(group),
        loads=tuple(replace(load, part=extent.parts.index(part)) for load in group.loads if presses and load.part == part),
        bilateral=tuple(_local(locators, extent) for locators in bilateral),
    )
    locator_count = sum(len(locators.owners) for locators in bilateral)
    preceding = itertools.takewhile(lambda locators: locators.part != part, group.bilateral)
    first = sum(len(locators.owners) for locators in preceding)
    equations = locator_count if presses else 0
    return PartElement(nominal, local, index, extent.parts, extent.movers, first, locator_count, equations)


def _local(locators: BilateralLocators, extent: Extent) -> BilateralLocators:
    return replace(
        locators,
        part=extent.parts.index(locators.part),
        owners=tuple(extent.parts.index(owner) for owner in locators.owners),
        parent=None if locators.parent is None else extent.parts.index(locators.parent),
    )


def part_functions(element: PartElement, method: Method, *, projects: bool) -> Functions:
    """Return the functions of the parts of the same kind as `element`; see quadratic_terms for `projects`.

    They are the functions of term_functions, and the following if there are equations, for e equations and z increments of the
    element's movers:

    terms              slopes (e, z), lower (e)
    rows               slopes, V (36, mover) -> a (e, z)
    check              a, y, lower, lam -> residual, force (z)
    locator_residual   poses, raw, steps (e), constants -> locator_residual: the largest misfit
    """
    size, count = element.size, element.equations
    inputs = symbols(common_shapes(element) | {"steps": (element.locators, 1)})
    steps = [inputs["steps"]] * len(element.group.bilateral)
    system = element_equations(element, method, inputs, moments=ca.SX(MOMENTS, 0), steps=steps)
    motion = system.motion(poses_of(inputs["poses"]))
    moved = motion.by(linear)
    rows = contact_rows(system, [], motion.poses, moved, ca.SX(0, 1))
    if not count:
        return term_functions(system, rows, motion, inputs, {}, projects=projects)
    error = misfit(system, moved, linear=True)
    results = {"slopes": system.slope(error), "lower": -system.at_rest(error)}
    equations = symbols({
        "a": (count, size), "slopes": (count, size), "V": (BLOCK, len(element.movers)), "y": (size, 1),
        **dict.fromkeys(("lower", "lam"), (count, 1)),
    })  # fmt: skip
    excess = equations["a"] @ equations["y"] - equations["lower"]
    check = {"residual": ca.norm_inf(excess), "force": equations["a"].T @ equations["lam"]}
    return {
        **term_functions(system, rows, motion, inputs, results, projects=projects),
        "rows": function_of("rows", equations, {"a": equations["slopes"] @ upper_blocks(equations["V"])}),
        "check": function_of("check", equations, check),
        "locator_residual": function_of(
            "locator_residual", inputs, {"locator_residual": ca.norm_inf(misfit(system, motion.poses))}
        ),
    }


class PartElements(Elements):
    """Parts of one kind in a group; their equations follow the `rows` of its pairs."""

    def __init__(self, elements: Sequence[PartElement], functions: Functions, rows: int) -> None:
        firsts, equations = np.array([element.first for element in elements]), elements[0].equations
        super().__init__(elements, functions, rows + firsts[:, None] + np.arange(equations))
        self._steps = firsts[:, None] + np.arange(elements[0].locators)

    def columns(self) -> dict[str, Columns]:
        """Return the columns of the group's arrays that elements read or write, by array name."""
        return super().columns() | {"steps": self._steps, "locator_residual": self.indices[:, None]}
