"""Iterated search: linear steps, each about contact points that were projected anew, until the poses stay.

More than one step about the same points would let a round part roll on the planes that represent its counterpart. Linear
rows do not know how the surfaces curve: steps that neither shrink nor gain are taken with more caution.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tolcontact.contact.acceptance import Doubt
from tolcontact.contact.candidates import Candidates
from tolcontact.contact.linear_step import LinearStep
from tolcontact.contact.scan import least_gaps, undone
from tolcontact.contact.slots import Slots
from tolcontact.contact.state import State, Task, Unsettled

MOST_STEPS = 100
SHRINKS, CAUTION = 0.7, 10.0  # of the step before, or of the foreseen gain: what good steps reach; what others cost
UNWORTHY = 1e-6  # mm, in the norm of the objective: its square is what a step gains
SETTLED = 1e-8  # mm: a smaller step is the last one


def search(
    step: LinearStep,
    doubt: Doubt,
    candidates: Candidates,
    energy_of: Callable[[Task, State], np.ndarray],
    task: Task,
    state: State,
    stride: float,
    caution: float,
) -> None:
    """Take the steps of `state` to their end, from a certain `caution` on; `energy_of` is the objective (n,)."""
    left, wary = Unsettled(task, state), np.full(len(task), caution)
    before, energy = np.full(len(task), np.inf), energy_of(task, state)
    for _ in range(MOST_STEPS):
        for slots in left.state.slots:  # what carried before may now be beyond the rim
            slots.put(np.arange(len(left)), Slots.empty(*slots.points.shape))
        size, scaled = step.take(left.task, left.state, stride=stride, caution=wary)
        now = energy_of(left.task, left.state)
        share = (energy - now) / np.maximum(scaled**2 / 2, 1e-300)  # of the gain that the QP foresaw
        scans = candidates.scans(left.state.relative, anew=True)
        least = least_gaps(scans, left.state.relative, left.task.deviations)
        inside = undone(scans, least, left.state.relative, left.task.deviations, left.task.may_carry, left.state.slack).max(
            axis=1
        )
        sinks = inside > np.maximum((1 - SHRINKS) * np.minimum(size, scaled), SETTLED)  # what it gains is what it lost before
        idle = (size > SHRINKS * before) & (share < 1 - SHRINKS) | sinks
        wary = np.where(idle, np.maximum(CAUTION * wary, 1), np.where(share > SHRINKS, wary / CAUTION, wary))
        on = (size > SETTLED) & ~(idle & (scaled < UNWORTHY))
        lost = on & doubt.is_lost(left.task, left.state)
        left.state.residual[lost] = np.inf
        on &= ~lost
        left.settle(~on)
        wary, before, energy = wary[on], size[on], now[on]
        if not len(left):
            return
        left.task = replace(left.task, scans=[scan.take(np.flatnonzero(on)) for scan in scans])
    left.state.residual[:] = np.maximum(left.state.residual, before)
    left.settle(np.ones(len(left), dtype=bool))
