"""The poses of parts after the increments of the movers, part by part."""

import numpy as np

from tolcontact.arrays import Array, Float
from tolcontact.compilation.elements.element_batch import blocks
from tolcontact.compilation.elements.mover_functions import advance_function
from tolcontact.compilation.functions import IndexedFunction, located
from tolcontact.mechanics.correction import FREEDOMS
from tolcontact.mechanics.groups import Group
from tolcontact.mechanics.pose import ENTRIES
from tolcontact.method import Method


class CorrectedPoses:
    """The poses of all parts of a group after a step of its movers."""

    def __init__(self, group: Group, method: Method) -> None:
        kinds: dict[tuple[int, bool], list[int]] = {}
        for part, mobility in enumerate(group.mobilities):
            if mobility.movers:
                kinds.setdefault((len(mobility.movers), mobility.is_reference), []).append(part)
        self._centres = np.concatenate([np.asarray(mobility.centre).ravel() for mobility in group.mobilities])[None]
        self._length = np.full((1, 1), group.length)
        self._functions = [_of_parts(group, method, np.array(parts)) for parts in kinds.values()]

    def __call__(self, poses: Float[Array, "n _"], step: Float[Array, "n _"]) -> Float[Array, "n _"]:
        """Return the poses (n, 12 * part) after steps (n, 6 * mover) [mm]."""
        corrected = poses.copy()
        arrays = {
            "pose": poses, "movers": poses, "steps": step, "centre": self._centres, "centres": self._centres,
            "length": self._length, "corrected": corrected,
        }  # fmt: skip
        places = located(arrays)
        for function in self._functions:
            function(len(poses), places)
        return corrected


def _of_parts(group: Group, method: Method, parts: np.ndarray) -> IndexedFunction:
    """Return the function of parts that chains of equally many movers move."""
    movers = np.array([group.mobilities[part].movers for part in parts])
    mover_parts = np.array([group.position(part) for part in group.free])[movers]
    function, own = advance_function(group.mobilities[parts[0]], method), parts[:, None]
    return function.at({
        **dict.fromkeys(("pose", "corrected"), blocks(own, ENTRIES)),
        "movers": blocks(mover_parts, ENTRIES),
        "steps": blocks(movers, FREEDOMS),
        "centre": blocks(own, 3),
        "centres": blocks(mover_parts, 3),
        "length": np.zeros(own.shape, dtype=int),
    })  # fmt: skip
