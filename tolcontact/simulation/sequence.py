"""Hand-over from station to station: raw states follow from raw states, corrected states from corrected states."""

from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Float
from tolcontact.compilation import Program
from tolcontact.mechanics import ENTRIES


class Stage(NamedTuple):
    """A station in the sequence of a program; a program without stations has one stage, which places nothing again.

    number   its number among the stations
    groups   numbers of its contact groups
    """

    number: int
    groups: tuple[int, ...]


class Beginning(NamedTuple):
    """The states in which contact of stations begins.

    poses     (realization, part, 12)
    relative  (realization, pair, 12): X_RM of the pairs
    """

    poses: Float[Array, "realization part 12"]
    relative: Float[Array, "realization pair 12"]


def stages(program: Program) -> list[Stage]:
    """Return the stages of a program, in their order."""
    if not program.stations:
        return [Stage(0, tuple(range(len(program.groups))))]
    return [Stage(number, station.groups) for number, station in enumerate(program.stations)]


def hand_over(
    program: Program,
    stage: Stage,
    rows: np.ndarray,
    beginning: Beginning,
    corrected: Float[Array, "realization part 12"],
    deviations: Float[Array, "realization contributor"],
) -> bool:
    """Place the joints of a station again where contact in earlier stations has changed them, and return whether it did.

    rows        (row,) realizations that contact in earlier stations has changed
    beginning   raw states, of which those of this station are replaced
    corrected   corrected poses of earlier stations, raw ones of this station, which are replaced as well
    """
    station = program.stations[stage.number] if program.stations else None
    if station is None or station.place is None or not rows.size:
        return False
    placed = station.place(poses=corrected[rows[:, None], station.sources], deviations=deviations[rows])
    poses = placed["placed"].reshape(len(rows), len(station.parts), ENTRIES)
    corrected[rows[:, None], station.parts] = beginning.poses[rows[:, None], station.parts] = poses
    beginning.relative[rows[:, None], station.pairs] = placed["relative"].reshape(len(rows), len(station.pairs), ENTRIES)
    return True
