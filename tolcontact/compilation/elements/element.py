"""An element of a contact group: one of its pairs, with the parts that its increments move, and the constants of both."""

import pickle
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from tolcontact.discretization import ContactPoints, Nominal
from tolcontact.mechanics.correction import FREEDOMS, Mobility
from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.groups import Group

CENTRE = 3  # entries of a nominal centre


@dataclass(frozen=True, eq=False)
class Element:
    """A pair of a group; positions are those in the whole group.

    group      the group of this pair alone
    pair       position of the pair
    parts      positions of the element's parts
    movers     numbers of the movers whose increments move them
    sides      numbers of the sides of the pair
    points     the contact points that always have a row, or the number of slots
    """

    nominal: Nominal
    group: Group
    pair: int
    parts: tuple[int, ...]
    movers: tuple[int, ...]
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

    @property
    def size(self) -> int:
        """The number of increments."""
        return FREEDOMS * len(self.movers)

    @cached_property
    def deviating(self) -> tuple[bool, bool]:
        """Whether the moving and the reference face turn or shift in their parts."""
        moving, reference = (face is not None and bool(face.twist.any()) for face in self.contact.deviating)
        return moving, reference

    @cached_property
    def kind(self) -> Hashable:
        """What elements share whose functions are the same; round faces have their constants within their functions."""
        group, pair = self.group, self.contact
        round_points = () if pair.round is None else tuple(pickle.dumps(point) for point in pair.round)
        mobilities = tuple(mobility.movers for mobility in group.mobilities)
        ends = group.position(pair.moving), None if pair.reference is None else group.position(pair.reference)
        sides = tuple(side.part for side in group.sides)
        return self.rows, self.has_slots, round_points, mobilities, ends, sides, self.deviating

    @cached_property
    def constants(self) -> np.ndarray:
        """The constants: centres of the parts, then centre and moments of each side (see `symbolic`)."""
        centres = [np.asarray(mobility.centre) for mobility in self.group.mobilities]
        sides = [np.asarray(values) for side in self.group.sides for values in (side.centre, side.all_moments)]
        return np.concatenate([*centres, *sides])

    def symbolic(self, constants: ca.SX, length: ca.SX, count: ca.SX) -> Group:
        """Return the group with symbols in place of its constants, the length and the number of points of the whole group."""
        remaining = iter(ca.vertsplit(constants, self._offsets))
        mobilities = tuple(replace(mobility, centre=next(remaining)) for mobility in self.group.mobilities)
        sides = tuple(replace(side, centre=next(remaining), all_moments=next(remaining)) for side in self.group.sides)
        return replace(self.group, mobilities=mobilities, sides=sides, length=length, count=count)

    @property
    def _offsets(self) -> list[int]:
        sizes = [CENTRE] * len(self.group.mobilities) + [CENTRE, MOMENTS] * len(self.group.sides)
        return [0, *np.cumsum(sizes).tolist()]


def elements_of(nominal: Nominal, group: Group, standing: Sequence[np.ndarray | int]) -> list[Element]:
    """Return the elements of a group, one for each of its pairs; see contact_qp for `standing`."""
    return [_element(nominal, group, pair, points) for pair, points in enumerate(standing)]


def _element(nominal: Nominal, group: Group, pair: int, points: np.ndarray | int) -> Element:
    contact = nominal.pairs[group.pairs[pair]]
    ends = [group.position(part) for part in (contact.moving, contact.reference) if part is not None]
    movers = tuple(sorted({mover for part in ends for mover in group.mobilities[part].movers}))
    parts = tuple(sorted({*ends, *(group.position(group.free[mover]) for mover in movers)}))
    sides = tuple(k for k, side in enumerate(group.sides) if side.pair == pair)
    local = Group(
        parts=tuple(group.parts[part] for part in parts),
        pairs=(group.pairs[pair],),
        free=tuple(group.free[mover] for mover in movers),
        mobilities=tuple(_local(group.mobilities[part], movers) for part in parts),
        sides=tuple(replace(group.sides[k], pair=0, part=parts.index(group.sides[k].part)) for k in sides),
        length=group.length,
        count=group.count,
    )
    return Element(nominal, local, pair, parts, movers, sides, points)


def _local(mobility: Mobility, movers: tuple[int, ...]) -> Mobility:
    return replace(mobility, movers=tuple(movers.index(mover) for mover in mobility.movers))
