"""Linear steps, each about contact points that were projected again onto curved faces, until the poses converge.

More than one step about the same points would let a round part roll on the planes that represent its counterpart. Linear
rows neglect the curvature of the surfaces: steps that neither shrink nor gain are repeated with more caution, a weight on the
step itself.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tolcontact.contact.acceptance import LOST_SIZES, AcceptanceLimits
from tolcontact.contact.candidates import Candidates
from tolcontact.contact.fixed_search import Search
from tolcontact.contact.linear_step import LinearStep
from tolcontact.contact.scan import min_gaps, undone
from tolcontact.contact.slots import Slots
from tolcontact.contact.starts import Start
from tolcontact.contact.state import State, Task, Unsettled

MAX_STEPS = 100
GOOD_RATIO = 0.7  # a good step is at most this part of the step before, or gains at least this part of the predicted gain
CAUTION_FACTOR = 10.0  # growth of caution after a step that stalls, and its reduction after one that gains
MIN_SCALED_STEP = 1e-6  # mm, in the norm of the objective: its square is what a step gains
STEP_TOLERANCE = 1e-8  # mm: a smaller step is the last one


def search(
    step: LinearStep,
    limits: AcceptanceLimits,
    candidates: Candidates,
    energy_of: Callable[[Task, State], np.ndarray],
    task: Task,
    state: State,
    start: Start,
    caution: float,
) -> None:
    """Take the steps of `state` to their end, from the given `caution` on; `energy_of` returns the objective (n,)."""
    unsettled, cautions = Unsettled(task, state), np.full(len(task), caution)
    last_size, last_energy = np.full(len(task), np.inf), energy_of(task, state)
    for _ in range(MAX_STEPS):
        _empty_slots(unsettled.state)
        size, scaled = step.take(unsettled.task, unsettled.state, stride=start.stride, caution=cautions)
        energy = energy_of(unsettled.task, unsettled.state)
        gain_ratio = (last_energy - energy) / np.maximum(scaled**2 / 2, 1e-300)  # relative to the gain that the QP predicts
        scans = candidates.scans(unsettled.state.relative, unsettled.task.deviations, Search(start))
        # A step whose points are deeper inside afterwards only gains what is lost again later.
        sinks = _depth_left(scans, unsettled) > np.maximum((1 - GOOD_RATIO) * np.minimum(size, scaled), STEP_TOLERANCE)
        stalls = (size > GOOD_RATIO * last_size) & (gain_ratio < 1 - GOOD_RATIO) | sinks
        cautions = _adapted(cautions, stalls, gain_ratio)
        moves = (size > STEP_TOLERANCE) & ~(stalls & (scaled < MIN_SCALED_STEP))
        lost = moves & limits.have_drifted(unsettled.task, unsettled.state, LOST_SIZES)
        unsettled.state.kkt_residual[lost] = np.inf
        moves &= ~lost
        unsettled.settle(~moves)
        cautions, last_size, last_energy = cautions[moves], size[moves], energy[moves]
        if not len(unsettled):
            return
        unsettled.task = replace(unsettled.task, scans=[scan.take(np.flatnonzero(moves)) for scan in scans])
    residual = unsettled.state.kkt_residual
    residual[:] = np.maximum(residual, last_size)
    unsettled.settle(np.ones(len(unsettled), dtype=bool))


def _empty_slots(state: State) -> None:
    """Empty all slots: the points that were active before may now be beyond the rim."""
    for slots in state.slots:
        slots.put(np.arange(len(state)), Slots.empty(*slots.points.shape))


def _depth_left(scans: list, unsettled: Unsettled) -> np.ndarray:
    """Return the penetration beyond the slack (n,) [mm], among points projected at the poses reached."""
    task, state = unsettled.task, unsettled.state
    gaps = min_gaps(scans, state.relative, task.deviations)
    return undone(scans, gaps, state.relative, task.deviations, task.may_carry, state.slack).max(axis=1)


def _adapted(cautions: np.ndarray, stalls: np.ndarray, gain_ratio: np.ndarray) -> np.ndarray:
    """Return the cautions (n,) of the next step: more where a step stalled, less where it gained as predicted."""
    relaxed = np.where(gain_ratio > GOOD_RATIO, cautions / CAUTION_FACTOR, cautions)
    return np.where(stalls, np.maximum(CAUTION_FACTOR * cautions, 1), relaxed)
