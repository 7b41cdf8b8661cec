"""The element of a contact pair, with the parts that its increments move."""

import pickle
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from tolcontact.compilation.contact_rows import compliance_of
from tolcontact.compilation.elements.element import Element, Extent
from tolcontact.discretization import ContactPoints, Nominal
from tolcontact.mechanics.groups import Group


@dataclass(frozen=True, eq=False)
class PairElement(Element):
    """A pair of a group; its number is the pair's position.

    sides      numbers of the sides of the pair
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
        """Whether changing points take the rows in turns."""
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
        """The rows that give way."""
        return np.flatnonzero(self.compliance).tolist()

    @cached_property
    def deviating(self) -> tuple[bool, bool]:
        """Whether the moving and the reference face turn or shift in their parts."""
        moving, reference = (face is not None and bool(face.twist.any()) for face in self.contact.deviating)
        return moving, reference

    @property
    def kind(self) -> Hashable:
        """What elements share whose functions are the same; round faces have their constants within their functions."""
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
    numbers = tuple(k for k, side in enumerate(group.sides) if side.pair == pair)
    sides = tuple(replace(group.sides[k], pair=0, part=extent.parts.index(group.sides[k].part)) for k in numbers)
    local = replace(extent.alone(group), pairs=(group.pairs[pair],), sides=sides)
    return PairElement(nominal, local, pair, extent.parts, extent.movers, numbers, points)
