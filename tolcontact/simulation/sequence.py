"""Hand-over from station to station: raw states follow from raw states, corrected states from corrected states."""

from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.compilation import Program
from tolcontact.mechanics import ENTRIES


class Stage(NamedTuple):
    """A station in the sequence of a program; a program without stations has one stage, which places nothing again.

    number   its number among the stations
    groups   numbers of its contact groups
    """

    number: int
    groups: tuple[int, ...]


class Placed(NamedTuple):
    """The states in which contact of a station begins.

    rows      (row,) realizations that contact in earlier stations has changed
    poses     (realization, part, 12)
    relative  (realization, pair, 12): X_RM of the pairs
    """

    rows: Int[Array, " row"]
    poses: Float[Array, "realization part 12"]
    relative: Float[Array, "realization pair 12"]


def stages(program: Program) -> list[Stage]:
    """Return the stages of a program, in their order."""
    if not program.stations:
        return [Stage(0, tuple(range(len(program.groups))))]
    return [Stage(number, station.groups) for number, station in enumerate(program.stations)]


def hand_over(
    program: Program, stage: Stage, changed: np.ndarray, raw: Placed, corrected: np.ndarray, deviations: np.ndarray
) -> Placed:
    """Return the states in which contact of a station begins, and put their poses into the corrected state.

    changed     (row,) realizations that contact in earlier stations has changed
    raw         raw states
    corrected   (realization, part, 12): corrected poses of earlier stations, raw ones of this station
    deviations  (realization, contributor)
    """
    place = program.stations[stage.number].place if program.stations else None
    if place is None or not changed.size:
        return raw
    rows, parts = changed, program.stations[stage.number].parts
    placed = place(poses=corrected[rows], deviations=deviations[rows])["placed"].reshape(len(rows), len(parts), ENTRIES)
    corrected[rows[:, None], parts] = placed
    poses, relative = raw.poses.copy(), raw.relative.copy()
    poses[rows[:, None], parts] = placed
    observed = program.observe(poses=poses[rows], deviations=deviations[rows])["relative"]
    relative[rows] = observed.reshape(len(rows), *relative.shape[1:])
    return Placed(rows, poses, relative)
