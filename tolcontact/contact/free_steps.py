"""Steps of free bodies: each step ends before bodies penetrate, so that no constraints contradict each other."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.contact.acceptance import AcceptanceLimits
from tolcontact.contact.candidates import Candidates
from tolcontact.contact.fixed_search import Search
from tolcontact.contact.linear_step import LinearStep
from tolcontact.contact.scan import min_gaps
from tolcontact.contact.starts import FREE_WHERE_RAW, STRIDE
from tolcontact.contact.state import State, Task
from tolcontact.mechanics import Group

MAX_HALVINGS = 20
SINK_SHARE = 0.02  # of a step: accepted penetration of places, since they follow planes and rotations are curved
TOUCHING = 1e-9  # mm: bodies with at most this penetration touch
GAIN_SHARE = 1e-9  # of the objective: increase due to rounding
MAX_LIFTS = 30
LIFT_FACTOR = 1.1  # times the width of the common region of bodies: how far they are moved apart
MAX_TRIALS = 64  # poses that are tried at once


class _StepLimits(NamedTuple):
    """Limits of steps (n,), and how large these are.

    are_free    whether bodies do not interfere before the step
    objective   of which a shorter step may not have more
    depths      [mm] of places before the step
    motions     [mm]: how far contact points move
    sizes       [mm]
    """

    are_free: Bool[Array, " n"]
    objective: Float[Array, " n"]
    depths: Float[Array, " n"]
    motions: Float[Array, " n"]
    sizes: Float[Array, " n"]


class FreeSteps:
    """The steps that keep the bodies of a group free of interference, or free them.

    relate, energy   return X_RM of all pairs at some poses, and the objective of a task's state
    """

    def __init__(
        self,
        group: Group,
        candidates: Candidates,
        limits: AcceptanceLimits,
        relate: Callable[..., np.ndarray],
        energy: Callable[[Task, State], np.ndarray],
    ) -> None:
        self._group, self._candidates, self._limits = group, candidates, limits
        self._relate, self._energy = relate, energy
        self._centres = np.array([np.asarray(mobility.centre, dtype=float).ravel() for mobility in group.mobilities])

    def shorten(self, step: LinearStep, task: Task, before: State, state: State, size: Float[Array, " n"]) -> Bool[Array, " n"]:
        """Shorten steps from `before` to `state`, of a size (n,) [mm], so that bodies stay free; return which are short (n,).

        If a short step leaves penetration because rotations are curved, the smallest step that removes it follows.
        """
        is_short = self._hold_back(task, before, state, size)
        rows = np.flatnonzero(is_short)
        if rows.size:
            part, held = task.take(rows), state.take(rows)
            search = Search(FREE_WHERE_RAW, width=1.0)
            scans = self._candidates.scans(held.relative, part.deviations, search, slots=held.slots)
            part = replace(part, raw=held.poses, relative=held.relative, scans=scans)
            freed = held.take(np.arange(len(rows)))
            size_of_rows, _ = step.take(part, freed, stride=STRIDE)
            self._hold_back(part, held, freed, size_of_rows)
            state.poses[rows], state.relative[rows] = freed.poses, freed.relative
        return is_short

    def _hold_back(self, task: Task, before: State, state: State, size: Float[Array, " n"]) -> Bool[Array, " n"]:
        """Halve steps until no body penetrates another one and the objective is lower; return which are short (n,)."""
        task = replace(task, scans=())  # which are of the places before the step
        limits, halvings = self._limits_of(task, before, state, size), np.zeros(len(task), dtype=int)
        rows = np.flatnonzero(np.isfinite(before.poses).all(axis=(1, 2)) & np.isfinite(state.poses).all(axis=(1, 2)))
        trials, poses, relative = np.zeros(1, dtype=int), state.poses[rows][:, None], state.relative[rows][:, None]
        while rows.size:
            fails = self._fail(task, state, limits, rows, trials, poses, relative)
            picks = np.where(fails.all(axis=1), len(trials) - 1, fails.argmin(axis=1))
            picked = np.arange(len(rows)), picks
            state.poses[rows], state.relative[rows], halvings[rows] = poses[picked], relative[picked], trials[picks]
            rows = rows[fails[picked]]
            if trials[-1] == MAX_HALVINGS or not rows.size:
                break
            # Several shares of a few steps are tried at once, since this takes hardly longer than to try one of them.
            count = min(4 * len(trials), max(MAX_TRIALS // len(rows), 1), MAX_HALVINGS - int(trials[-1]))
            trials = trials[-1] + 1 + np.arange(count)
            poses = self._halved(before.poses[rows], state.poses[rows], count)
            deviations = np.repeat(task.deviations[rows], count, axis=0)
            relative = self._relate(poses=poses.reshape(-1, *poses.shape[2:]), deviations=deviations)
            relative = relative.reshape(len(rows), count, *relative.shape[1:])
        state.poses[rows], state.relative[rows] = before.poses[rows], before.relative[rows]
        return halvings > 0

    def _limits_of(self, task: Task, before: State, state: State, size: Float[Array, " n"]) -> _StepLimits:
        """Return the limits of steps from `before` to `state`."""
        depths = self._depths(task.deviations, before.relative, np.full(len(task), self._candidates.free_depth))
        is_free = ~self._candidates.interfere(before.relative, task.deviations)
        objective = self._energy(task, before) * (1 + GAIN_SHARE)
        objective[(depths > TOUCHING) | ~is_free] = np.inf
        return _StepLimits(is_free, objective, depths, self._limits.displacement(before.poses, state.poses), size)

    def _fail(
        self,
        task: Task,
        state: State,
        limits: _StepLimits,
        rows: Int[Array, " k"],
        halvings: Int[Array, " trial"],
        poses: Float[Array, "k trial part 12"],
        relative: Float[Array, "k trial pair 12"],
    ) -> Bool[Array, "k trial"]:
        """Return whether steps of some realizations, at the poses after some `halvings`, are too long (k, trial)."""
        rows_tried = np.repeat(rows, len(halvings))
        shares = np.tile(0.5**halvings, len(rows))
        poses, relative = (values.reshape(-1, *values.shape[2:]) for values in (poses, relative))
        fails = limits.are_free[rows_tried] & self._candidates.interfere(relative, task.deviations[rows_tried])
        # Places show penetration after small motions of the bodies, unless only the complete test detects it.
        left = np.flatnonzero(~fails & (shares > 0.5**MAX_HALVINGS))
        shortened = replace(state.take(rows_tried[left]), poses=poses[left], relative=relative[left])
        fails[left] = self._energy(task.take(rows_tried[left]), shortened) > limits.objective[rows_tried[left]]
        # Places deeper than the motion of the bodies are on the far side of a body. They take longest to find.
        left = left[~fails[left]]
        share, realization = shares[left], rows_tried[left]
        deepest = limits.depths[realization] + share * limits.motions[realization] + TOUCHING
        depths = self._depths(task.deviations[realization], relative[left], deepest)
        allowed = limits.depths[realization] * (1 - share) + SINK_SHARE * share * limits.sizes[realization]
        fails[left] = depths > TOUCHING + allowed
        return fails.reshape(len(rows), -1)

    def _halved(
        self, first: Float[Array, "k part 12"], second: Float[Array, "k part 12"], count: int
    ) -> Float[Array, "k trial part 12"]:
        """Return poses after 1 to `count` halvings of steps from one pose to another."""
        halved = [second]
        for _ in range(count):
            halved.append(_halfway(first, halved[-1], self._centres))
        return np.stack(halved[1:], axis=1)

    def lift(
        self, poses: Float[Array, "n part 12"], relative: Float[Array, "n pair 12"], deviations: Float[Array, "n contributor"]
    ) -> tuple[Float[Array, "n part 12"], Float[Array, "n pair 12"]]:
        """Return poses, and X_RM, after moving interfering bodies apart, along the narrowest extent of their common region."""
        poses, relative = poses.copy(), relative.copy()
        for _ in range(MAX_LIFTS):
            is_free = True
            for k, guard in self._candidates.guards.items():
                rows = np.flatnonzero(guard.interferes(relative[:, k], deviations))
                if not rows.size:
                    continue
                is_free, way, pair = False, guard.ways_out(relative[rows, k], deviations[rows]), self._candidates.pairs[k].pair
                assert pair.reference is not None
                sides = self._group.position(pair.moving), self._group.position(pair.reference)
                normals = np.einsum("nij,nj->ni", pose.rotation(poses[rows, sides[1]]), way.normals)
                shift = LIFT_FACTOR * way.widths[:, None] * normals
                movers = [self._group.mobilities[side].movers for side in sides]
                own = [set(movers[0]) - set(movers[1]), set(movers[1]) - set(movers[0])]
                for sense, moved in zip((1, -1), own, strict=True):
                    for part, mobility in enumerate(self._group.mobilities):
                        if moved & set(mobility.movers):
                            poses[rows, part, 9:] += sense * shift / (2 if all(own) else 1)
                relative[rows] = self._relate(poses=poses[rows], deviations=deviations[rows])
            if is_free:
                break
        return poses, relative

    def _depths(self, deviations: np.ndarray, relative: np.ndarray, deepest: np.ndarray) -> np.ndarray:
        """Return the largest penetration (n,) [mm] of the places that are not deeper than `deepest` (n,) [mm]."""
        scans = self._candidates.scans(relative, deviations, Search(FREE_WHERE_RAW, deepest=deepest))
        return np.maximum(-min_gaps(scans, relative, deviations).min(axis=1), 0)


def _halfway(
    first: Float[Array, "n part 12"], second: Float[Array, "n part 12"], centres: Float[Array, "part 3"]
) -> Float[Array, "n part 12"]:
    """Return poses halfway between two poses, where `centres` of parts move straight."""
    mean = (first + second) / 2
    U, _, Vt = np.linalg.svd(pose.rotation(mean))
    R = U @ Vt
    return pose.pose(R, np.einsum("npij,pj->npi", pose.rotation(mean) - R, centres) + pose.translation(mean))
