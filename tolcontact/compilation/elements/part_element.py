"""The element of a part with its forces and its two-sided locators, where the objective or equations contain them."""

import itertools
from collections.abc import Hashable
from dataclasses import dataclass, replace

from tolcontact.compilation.elements.element import Element, Extent
from tolcontact.discretization import Nominal
from tolcontact.mechanics.groups import Group, Hold
from tolcontact.method import Method


@dataclass(frozen=True, eq=False)
class PartElement(Element):
    """A part of a group.

    first       number of its first locator among those of all holds
    locators    number of its locators that do not give way
    equations   number of equations of its locators
    """

    first: int
    locators: int
    equations: int

    @property
    def kind(self) -> Hashable:
        """What elements share whose functions are the same."""
        return super().kind, self.equations


def part_elements(nominal: Nominal, group: Group, method: Method) -> list[PartElement]:
    """Return the elements of the parts of a group that forces press or locators hold; none if points are the objective."""
    if method.minimizes.counts_points:
        return []
    presses = method.minimizes.presses
    pressed = {load.part for load in group.loads} if presses else set()
    parts = sorted(pressed | {hold.part for hold in group.holds})
    return [_element(nominal, group, k, part, presses=presses) for k, part in enumerate(parts, start=len(group.pairs))]


def _element(nominal: Nominal, group: Group, number: int, part: int, *, presses: bool) -> PartElement:
    holds = [hold for hold in group.holds if hold.part == part]
    others = [other for hold in holds for other in (*hold.owners, hold.parent) if other is not None]
    extent = Extent.around(group, [part, *others])
    local = replace(
        extent.alone(group),
        loads=tuple(replace(load, part=extent.parts.index(part)) for load in group.loads if presses and load.part == part),
        holds=tuple(_local(hold, extent) for hold in holds),
    )
    locators = sum(len(hold.owners) for hold in holds)
    first = sum(len(hold.owners) for hold in itertools.takewhile(lambda hold: hold.part != part, group.holds))
    equations = locators if presses else 0
    return PartElement(nominal, local, number, extent.parts, extent.movers, first, locators, equations)


def _local(hold: Hold, extent: Extent) -> Hold:
    return replace(
        hold,
        part=extent.parts.index(hold.part),
        owners=tuple(extent.parts.index(owner) for owner in hold.owners),
        parent=None if hold.parent is None else extent.parts.index(hold.parent),
    )
