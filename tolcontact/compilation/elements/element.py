"""An element of a contact group: a share of the group whose terms are summed with the terms of other elements."""

from collections.abc import Hashable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import casadi as ca
import numpy as np

from tolcontact.discretization import Nominal
from tolcontact.mechanics.correction import FREEDOMS, Mobility
from tolcontact.mechanics.groups import Group


@dataclass(frozen=True, eq=False)
class Element:
    """A contact pair, or a part with its forces and its two-sided locators; positions refer to the whole group.

    group      the group of this element alone
    index      index among the elements of the whole group: pairs, then parts
    parts      positions of the element's parts
    movers     indices of the movers whose increments move these parts
    """

    nominal: Nominal
    group: Group
    index: int
    parts: tuple[int, ...]
    movers: tuple[int, ...]

    @property
    def size(self) -> int:
        """The number of increments."""
        return FREEDOMS * len(self.movers)

    @property
    def kind(self) -> Hashable:
        """The key under which elements share functions."""
        sides, loads = (tuple(entry.part for entry in entries) for entries in (self.group.sides, self.group.loads))
        bilateral = tuple(
            (locators.part, locators.owners, locators.parent, locators.is_placed) for locators in self.group.bilateral
        )
        return type(self), tuple(mobility.movers for mobility in self.group.mobilities), sides, loads, bilateral

    @cached_property
    def constants(self) -> np.ndarray:
        """The concatenated constants (see `symbolic`)."""
        return np.concatenate(list(self._constants()))

    def _constants(self) -> Iterator[np.ndarray]:
        group = self.group
        yield from (np.asarray(mobility.centre) for mobility in group.mobilities)
        yield from (np.asarray(values) for side in group.sides for values in (side.centre, side.all_moments))
        yield from (np.asarray(values) for load in group.loads for values in (load.point, load.vector))
        for locators in group.bilateral:
            yield from map(np.asarray, (*locators.points, *locators.directions))
            yield from (np.array([stiffness]) for stiffness in locators.stiffness)

    def symbolic(self, constants: ca.SX, length: ca.SX, count: ca.SX) -> Group:
        """Return the group with symbols in place of its constants, and with length and point count of the whole group.

        Constants are centres of the parts; centre and moments of each side; point and vector of each force; points, directions
        and stiffness of two-sided locators.
        """
        offsets = np.cumsum([0, *(values.size for values in self._constants())]).tolist()
        remaining = iter(ca.vertsplit(constants, offsets))

        def symbols_of(entries: Iterable) -> list[ca.SX]:
            return [next(remaining) for _ in entries]

        group = self.group
        return replace(
            group,
            mobilities=tuple(replace(mobility, centre=next(remaining)) for mobility in group.mobilities),
            sides=tuple(replace(side, centre=next(remaining), all_moments=next(remaining)) for side in group.sides),
            loads=tuple(replace(load, point=next(remaining), vector=next(remaining)) for load in group.loads),
            bilateral=tuple(
                replace(
                    locators,
                    points=symbols_of(locators.points),
                    directions=symbols_of(locators.directions),
                    stiffness=symbols_of(locators.stiffness),
                )
                for locators in group.bilateral
            ),
            length=length,
            count=count,
        )


@dataclass(frozen=True)
class Extent:
    """The parts of an element and the movers whose increments move them, by their positions in the whole group."""

    parts: tuple[int, ...]
    movers: tuple[int, ...]

    @classmethod
    def around(cls, group: Group, ends: Iterable[int]) -> "Extent":
        """Return the extent of an element whose equations contain the poses of `ends`."""
        movers = tuple(sorted({mover for part in ends for mover in group.mobilities[part].movers}))
        return cls(tuple(sorted({*ends, *(group.position(group.free[mover]) for mover in movers)})), movers)

    def alone(self, group: Group) -> Group:
        """Return the group of these parts, without pairs, forces and locators."""
        return replace(
            group,
            parts=tuple(group.parts[part] for part in self.parts),
            free=tuple(group.free[mover] for mover in self.movers),
            mobilities=tuple(self._local(group.mobilities[part]) for part in self.parts),
            pairs=(),
            sides=(),
            loads=(),
            bilateral=(),
        )

    def _local(self, mobility: Mobility) -> Mobility:
        return replace(mobility, movers=tuple(self.movers.index(mover) for mover in mobility.movers))
