"""The exact resolution: linear steps about the poses reached, with their true gaps, until the poses converge.

The first steps are like the paper's. Realizations that still move then have freedoms that are almost unconstrained, while the
curvature of gaps and objective counts: they continue with Newton steps, which hold those freedoms firmly at first.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Bool, Float
from tolcontact.contact.acceptance import LOST_SIZES, AcceptanceLimits
from tolcontact.contact.candidates import Candidates
from tolcontact.contact.fixed_search import Search
from tolcontact.contact.free_steps import FreeSteps
from tolcontact.contact.linear_step import LinearStep, Step
from tolcontact.contact.progress import Progress
from tolcontact.contact.scan import PENETRATION, min_gaps
from tolcontact.contact.starts import Start
from tolcontact.contact.state import State, Task, Unsettled

STEP_TOLERANCE = 1e-9  # mm: a smaller step is the last one
ROUNDING = 1e-10  # mm, in the norm of the objective: a smaller step is rounding, in freedoms that are almost unconstrained
NEARLY_AT_REST = 1e-3  # mm: after a smaller step, places do not stay beyond sharp edges
MAX_IDLE = 3  # steps in a row that end where they begin, because bodies would penetrate: the next ones hardly ever differ
OUTLOOK = 4.0  # steps: places with larger gaps are not looked for, since the next step is hardly ever larger than the last
CLOSED_SHARE = 1e-4  # of a step: two steps that end this close to where they began repeat themselves
SMALLEST_STEP = 1e-5  # mm, and of rotation matrices: smaller ones are not compared


class Phase(NamedTuple):
    """A phase of the schedule: a number of steps, and how they are taken.

    newton     whether they count curvature
    firmness   weight of the regularization of freedoms that the objective leaves open
    width      how wide edges are taken (see Search)
    sharp      whether edges are sharp after a step, for realizations that have nearly converged
    """

    steps: int
    newton: bool = False
    firmness: float = 1.0
    width: float = 1.0
    sharp: bool = False


WIDE = 32.0
FIRM = Phase(6, newton=True, firmness=1e4), Phase(6, newton=True, firmness=1e2)
USUAL = Phase(8), *FIRM, Phase(80, newton=True)
# Places between the points of planes with form are added step by step: a few realizations need more steps for that.
WITH_FORM = Phase(16), *USUAL[1:]
# Where faces end, places appear and vanish. Newton's curvature belongs to places that stay, so steps like the paper's come
# first. Damped, they come again later, with places that stay longer, and do not alternate between places. Beyond its edge, a
# place separates bodies that would touch nearby at a lower objective. So places only stay while steps are large, unless
# convergence takes too long.
WHERE_FACES_END = (
    Phase(12, sharp=True),
    Phase(12),
    *(phase._replace(width=WIDE) for phase in FIRM),
    *(Phase(steps, firmness=firmness, width=WIDE) for steps, firmness in ((30, 10.0), (20, 3.0), (30, 1.0))),
    Phase(50, newton=True, width=WIDE),
)
OF_FREE_BODIES = Phase(60), Phase(30, newton=True)
FROM_ANSWERS = (Phase(12, sharp=True),)  # which stay if these steps do not converge


def _schedule(candidates: Candidates, start: Start) -> Sequence[Phase]:
    if start.free:
        return OF_FREE_BODIES
    if start.sloped:
        return FROM_ANSWERS
    return WHERE_FACES_END if candidates.bounded else WITH_FORM if candidates.change else USUAL


def repeat(
    step: LinearStep,
    limits: AcceptanceLimits,
    candidates: Candidates,
    free_steps: FreeSteps,
    task: Task,
    state: State,
    start: Start,
) -> None:
    """Take steps from `state` until they converge, as `start` specifies, or until they end in a conflict or no longer move."""
    unsettled, trail = Unsettled(task, state), list[np.ndarray]()
    progress: Progress | None = None
    if not len(task):
        return
    asleep, idle = np.zeros(len(task), dtype=bool), np.zeros(len(task), dtype=int)
    steps = ((phase, number == 0) for phase in _schedule(candidates, start) for number in range(phase.steps))
    for phase, is_first in steps:
        asleep &= not is_first
        if asleep.all():
            continue
        before = unsettled.state.take(np.arange(len(unsettled))) if start.free else None
        size, scaled = _take(step, unsettled, np.flatnonzero(~asleep), phase, start.stride)
        is_short = np.zeros(len(unsettled), dtype=bool)
        if before is not None:
            is_short = free_steps.shorten(step, unsettled.task, before, unsettled.state, size) & (size > STEP_TOLERANCE)
            stays = limits.displacement(before.poses, unsettled.state.poses) <= STEP_TOLERANCE
            idle = np.where(is_short & stays, idle + 1, 0)
        rounding_counts = phase.newton or step.knows_walls or step.bends or start.balances
        moves = is_short | (phase.firmness > 1) | ((size > STEP_TOLERANCE) & ((scaled > ROUNDING) | (not rounding_counts)))
        if phase.width > 1:
            moves |= ~candidates.hold(unsettled.task, unsettled.state, start)
        # The smaller size counts: steps are large in unconstrained freedoms, and in the norm of the objective if
        # Newton's curvature is stiff.
        unrest, residual = np.minimum(size, scaled), unsettled.state.kkt_residual
        residual[~moves] = np.maximum(residual[~moves], unrest[~moves])
        lost = moves & (limits.have_drifted(unsettled.task, unsettled.state, LOST_SIZES) | (idle >= MAX_IDLE))
        goes_round = moves & ~asleep & _goes_round(trail, unsettled.state)
        trail = [*trail[-1:], unsettled.state.poses.copy()] if candidates.bounded and not phase.newton else []
        lost |= goes_round & (phase.width > 1)
        waits = (goes_round | asleep) & (phase.width == 1)  # for the next phase
        residual[lost] = np.inf
        moves = (moves | waits) & ~lost
        unsettled.settle(~moves)
        # Realizations that converge while steps are damped need no further damping; steps that go round may be damped.
        asleep = waits[moves] | ((size[moves] <= STEP_TOLERANCE) & (phase.width > 1))
        unrest, idle, trail = unrest[moves], idle[moves], [poses[moves] for poses in trail]
        progress = None if progress is None else progress.take(moves)
        if not len(unsettled):
            return
        if candidates.change:
            _find_places(candidates, unsettled, phase, size[moves], start)
        if phase.newton:
            progress = progress or Progress.start(unsettled.state)
            progress.look(unsettled.state, _penetration(step, unsettled), unrest, is_held=phase.firmness > 1)
            ends = progress.is_over(_is_stuck(unsettled.state))
            if ends.any():
                _end(unsettled, progress, unrest, ends)
                asleep, idle, unrest, progress = asleep[~ends], idle[~ends], unrest[~ends], progress.take(~ends)
                trail = [poses[~ends] for poses in trail]
    _end(unsettled, progress, unrest, np.ones(len(unsettled), dtype=bool))


def _find_places(candidates: Candidates, unsettled: Unsettled, phase: Phase, size: Float[Array, " n"], start: Start) -> None:
    """Find the contact places at the poses of unsettled realizations, after steps of a size (n,) [mm]."""
    task = unsettled.task
    ceilings = None if start.free else candidates.ceiling + OUTLOOK * size
    search = Search(start, phase.width, at_rest=(size < NEARLY_AT_REST) & phase.sharp, ceilings=ceilings)
    scans = candidates.scans(unsettled.state.relative, task.deviations, search, slots=unsettled.state.slots, earlier=task.scans)
    unsettled.task = replace(task, scans=scans)


def _end(unsettled: Unsettled, progress: Progress | None, unrest: Float[Array, " n"], ends: Bool[Array, " n"]) -> None:
    """End realizations that do not converge (n,): conflicting parts at the poses of their smallest penetration."""
    state = unsettled.state
    if progress is not None:
        stuck = np.flatnonzero(ends & _is_stuck(state))
        state.put_answer(stuck, progress.best.take(stuck))
    residual = np.maximum(state.kkt_residual, np.where(state.in_conflict, 0, unrest))
    state.kkt_residual[ends] = residual[ends]
    unsettled.settle(ends)


def _take(step: LinearStep, unsettled: Unsettled, rows: np.ndarray, phase: Phase, stride: float) -> Step:
    """Take a step of some realizations; the others stay where they are."""
    if len(rows) == len(unsettled):
        return step.take(unsettled.task, unsettled.state, stride=stride, firmness=phase.firmness, newton=phase.newton)
    task, state = unsettled.task.take(rows), unsettled.state.take(rows)
    size, scaled = np.zeros((2, len(unsettled)))
    size[rows], scaled[rows] = step.take(task, state, stride=stride, firmness=phase.firmness, newton=phase.newton)
    unsettled.state.put(rows, state)
    return Step(size, scaled)


def _goes_round(trail: Sequence[np.ndarray], state: State) -> Bool[Array, " n"]:
    """Return whether parts without conflict are nearly back at their poses of two steps ago (n,)."""
    if len(trail) < 2:
        return np.zeros(len(state), dtype=bool)
    two, one = (np.abs(state.poses - poses).reshape(len(state), -1).max(axis=1) for poses in trail)
    return (two < CLOSED_SHARE * one) & (one > SMALLEST_STEP) & ~_is_stuck(state)


def _is_stuck(state: State) -> Bool[Array, " n"]:
    """Return whether parts contradict each other (n,)."""
    return np.any(state.slack > PENETRATION, axis=1)


def _penetration(step: LinearStep, unsettled: Unsettled) -> Float[Array, "n pair"]:
    """Return the penetration of each pair at the poses reached (n, pair) [mm]."""
    task, state = unsettled.task, unsettled.state
    return state.slack if step.bends else np.maximum(-min_gaps(task.scans, state.relative, task.deviations), 0)
