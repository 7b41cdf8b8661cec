"""The poses of parts after the increments of the movers, part by part."""

from dataclasses import dataclass

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.compilation.elements.element_batch import evaluated
from tolcontact.compilation.elements.element_functions import advance_function
from tolcontact.compilation.functions import NamedFunction
from tolcontact.mechanics.groups import Group
from tolcontact.method import Method


@dataclass(frozen=True, eq=False)
class Chains:
    """The parts that chains of equally many movers move.

    function      of one part, see advance_function
    parts         (part,) positions of the parts
    movers        (part, mover) numbers of the movers, and the positions `mover_parts` of these
    centre        (part, 3) and `centres` (part, mover, 3): nominal centres of part and movers [mm]
    """

    function: NamedFunction
    parts: Int[Array, " part"]
    movers: Int[Array, "part mover"]
    mover_parts: Int[Array, "part mover"]
    centre: Float[Array, "part 3"]
    centres: Float[Array, "part mover 3"]


class CorrectedPoses:
    """The poses of all parts of a group after a step of its movers."""

    def __init__(self, group: Group, method: Method) -> None:
        kinds: dict[tuple[int, bool], list[int]] = {}
        for part, mobility in enumerate(group.mobilities):
            if mobility.movers:
                kinds.setdefault((len(mobility.movers), mobility.is_reference), []).append(part)
        of_movers = np.array([group.position(part) for part in group.free])
        centres = np.array([np.asarray(mobility.centre) for mobility in group.mobilities])
        self._length = group.length
        self._chains = []
        for parts in kinds.values():
            movers = np.array([group.mobilities[part].movers for part in parts])
            function, mover_parts = advance_function(group.mobilities[parts[0]], method), of_movers[movers]
            chains = Chains(function, np.array(parts), movers, mover_parts, centres[parts], centres[mover_parts])
            self._chains.append(chains)

    def __call__(self, poses: Float[Array, "n part 12"], step: Float[Array, "n mover 6"]) -> Float[Array, "n part 12"]:
        """Return the poses after steps [mm]."""
        corrected, length = poses.copy(), np.full((1, 1, 1), self._length)
        for chains in self._chains:
            arrays = {
                "pose": poses[:, chains.parts], "movers": poses[:, chains.mover_parts], "steps": step[:, chains.movers],
                "centre": chains.centre[None], "centres": chains.centres[None], "length": length,
            }  # fmt: skip
            corrected[:, chains.parts] = evaluated(chains.function, arrays, (len(poses), len(chains.parts)))["corrected"]
        return corrected
