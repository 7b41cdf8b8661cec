"""The stations of a program: where contact in earlier stations leaves the parts that a station places again."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from tolcontact.compilation.functions import NamedFunction
from tolcontact.discretization import Nominal
from tolcontact.mechanics.groups import Group
from tolcontact.mechanics.placement import placed_poses
from tolcontact.mechanics.pose import ENTRIES, Pose, nearest_rotation, poses_of
from tolcontact.method import Method


@dataclass(frozen=True, eq=False)
class StationProgram:
    """A station: a stretch of the parts, and the contact groups among them.

    parts    (part,) indices of its parts, which follow each other
    groups   numbers of its contact groups
    place    poses (realization, 12 * part of all stations), deviations -> poses (realization, 12 * part of the station) before
             contact in this station; None if it locates no joint, so that earlier stations do not change them
    """

    name: str
    parts: np.ndarray
    groups: tuple[int, ...]
    place: NamedFunction | None


def station_programs(nominal: Nominal, groups: Sequence[Group], method: Method) -> Iterator[StationProgram]:
    """Yield the programs of the stations, in their order; none for an assembly without stations."""
    entries = ca.SX.sym("poses", ENTRIES * len(nominal.parts))
    deviations = ca.SX.sym("deviations", len(nominal.contributors))
    poses = poses_of(entries)
    for scene in nominal.scenes:
        parts = np.array([index for index, part in enumerate(nominal.parts) if part.station == scene.station])
        own_groups = tuple(number for number, group in enumerate(groups) if set(group.parts) <= set(parts.tolist()))
        place = None
        if any(nominal.parts[index].carried for index in parts):
            # The published step stretches parts a little, and a joint keeps their shape.
            earlier = poses if method.is_exact else [Pose(nearest_rotation(X.R), X.t) for X in poses]
            placed = ca.vertcat(*(X.vector() for X in placed_poses(nominal, scene.station, deviations, earlier)))
            names = ["poses", "deviations"], ["placed"]
            place = NamedFunction.dense(ca.Function("station_place", [entries, deviations], [placed], *names))
        yield StationProgram(scene.station, parts, own_groups, place)
