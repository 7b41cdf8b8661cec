"""The stations of a program: joints are placed again where contact in earlier stations has left their parts."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from tolcontact.compilation.functions import NamedFunction
from tolcontact.discretization import Nominal
from tolcontact.mechanics.group_equations import face_poses, facing_pose
from tolcontact.mechanics.groups import Group
from tolcontact.mechanics.placement import placed_poses
from tolcontact.mechanics.pose import ENTRIES, Pose, nearest_rotation, poses_of
from tolcontact.method import Method


@dataclass(frozen=True, eq=False)
class StationProgram:
    """A station: a range of the parts, and the contact groups among them.

    parts    (part,) indices of its parts, which are consecutive
    pairs    (pair,) indices of its pairs
    groups   indices of its contact groups
    sources  (source,) indices of the parts, in earlier stations, whose poses determine the poses of its joints
    place    poses (realization, 12 * source), deviations -> placed (realization, 12 * part) before contact in this station,
             relative (realization, 12 * pair): X_RM of its pairs there; None if it locates no joint
    """

    name: str
    parts: np.ndarray
    pairs: np.ndarray
    groups: tuple[int, ...]
    sources: np.ndarray
    place: NamedFunction | None


def station_programs(nominal: Nominal, groups: Sequence[Group], method: Method) -> Iterator[StationProgram]:
    """Yield the programs of the stations, in their order; none for an assembly without stations."""
    for scene in nominal.scenes:
        parts = np.array([index for index, part in enumerate(nominal.parts) if part.station == scene.station])
        pairs = np.array([k for k, pair in enumerate(nominal.pairs) if pair.moving in parts], dtype=int)
        station_groups = tuple(k for k, group in enumerate(groups) if set(group.parts) <= set(parts.tolist()))
        joints = [part.carried for part in nominal.parts if part.station == scene.station and part.carried is not None]
        sources = np.unique(np.array(joints, dtype=int))
        place = _place(nominal, scene.station, pairs, sources, method) if joints else None
        yield StationProgram(scene.station, parts, pairs, station_groups, sources, place)


def _rigid(X: Pose, vertices: np.ndarray) -> Pose:
    """Return the nearest rigid pose of a stretched part with vertices (vertex, 3) [mm]; it keeps the centre of the part."""
    centre, R = ca.DM((vertices.min(axis=0) + vertices.max(axis=0)) / 2), nearest_rotation(X.R)
    return Pose(R, X.t + (X.R - R) @ centre)


def _place(nominal: Nominal, station: str, pairs: np.ndarray, sources: np.ndarray, method: Method) -> NamedFunction:
    """Return the function that places the parts of a station; see StationProgram."""
    entries = ca.SX.sym("poses", ENTRIES * len(sources))
    deviations = ca.SX.sym("deviations", len(nominal.contributors))
    # The published step stretches parts slightly, but a joint keeps their shape.
    handed_over = poses_of(entries)
    if not method.is_exact:
        handed_over = [_rigid(X, nominal.parts[k].vertices) for X, k in zip(handed_over, sources.tolist(), strict=True)]
    earlier = dict(zip(sources.tolist(), handed_over, strict=True))
    placed = placed_poses(nominal, station, deviations, earlier)
    first = next(index for index, part in enumerate(nominal.parts) if part.station == station)
    relative = [
        facing_pose(pair, face_poses(pair, deviations), lambda part: placed[part - first]).vector()
        for pair in (nominal.pairs[k] for k in pairs)
    ]
    results = [ca.vertcat(*(X.vector() for X in placed)), ca.vertcat(*relative) if relative else ca.SX(0, 1)]
    return NamedFunction.dense(
        ca.Function("station_place", [entries, deviations], results, ["poses", "deviations"], ["placed", "relative"])
    )
