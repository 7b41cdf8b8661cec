"""The exact resolution: linear steps about the poses reached, with their true gaps, until these stay.

The first steps are like the paper's. What has not come to rest by then has freedoms that next to nothing holds, while the
curvature of gaps and objective counts: it goes on with Newton steps, and holds those freedoms firmly first.
"""

from typing import NamedTuple

import numpy as np

from tolcontact.contact.acceptance import Doubt
from tolcontact.contact.linear_step import PENETRATION, LinearStep
from tolcontact.contact.scan import least_gaps
from tolcontact.contact.state import State, Task, Unsettled

AT_REST = 1e-9  # mm: a smaller step is the last one
NOISE = 1e-10  # mm, in the norm of the objective: a smaller step is rounding, in freedoms that next to nothing holds
PRICE = 1e3  # of a locator that does not hold, beside penetration


class Kind(NamedTuple):
    """How firmly a step holds what the objective leaves open, and whether it counts curvature."""

    firmness: float
    newton: bool


STEPS = (
    *[Kind(1.0, newton=False)] * 8,
    *[Kind(1e4, newton=True)] * 6,
    *[Kind(1e2, newton=True)] * 6,
    *[Kind(1.0, newton=True)] * 80,
)


def repeat(step: LinearStep, doubt: Doubt, task: Task, state: State, stride: float) -> None:
    """Take the steps of `state` to their end. Without rest there is an answer only if the parts contradict each other."""
    left, best = Unsettled(task, state), None
    for kind in STEPS:
        last = step.take(left.task, left.state, stride=stride, firmness=kind.firmness, newton=kind.newton)
        knows_curvature = kind.newton or step.knows_walls
        moves = (kind.firmness > 1) | ((last.size > AT_REST) & ((last.scaled > NOISE) | (not knows_curvature)))
        # The smaller one tells: steps are large in freedoms that nothing holds, and in the norm of the objective if
        # Newton's curvature is stiff.
        unrest = np.minimum(last.size, last.scaled)
        residual = left.state.residual
        residual[~moves] = np.maximum(residual[~moves], unrest[~moves])
        lost = moves & doubt.is_lost(left.task, left.state)
        residual[lost] = np.inf
        on = moves & ~lost
        left.settle(~on)
        unrest, best = unrest[on], None if best is None else best.take(on)
        if not len(left):
            return
        if kind.newton:
            best = _better(best, left.task, left.state)
    now = left.state
    if best is not None:
        stuck = np.flatnonzero((now.slack > PENETRATION).any(axis=1))
        now.put_answer(stuck, best.take(stuck))
    now.residual[:] = np.maximum(now.residual, np.where(now.in_conflict, 0, unrest))
    left.settle(np.ones(len(left), dtype=bool))


def _better(best: State | None, task: Task, state: State) -> State:
    """The better of two states, realization by realization; `slack` is the true penetration of each pair in what it returns."""
    here = state.take(np.arange(len(task)))
    here.slack[:] = np.maximum(-least_gaps(task.scans, state.relative, task.deviations), 0)
    if best is None:
        return here
    better = np.flatnonzero(_wrong(here) < _wrong(best))
    best.put(better, here.take(better))
    return best


def _wrong(state: State) -> np.ndarray:
    return np.asarray(state.slack.max(axis=1) + PRICE * state.astray)
