"""Floating and fixed fasteners, with and without a projected tolerance zone."""

import numpy as np
from scipy import optimize

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return N.f + N.t, N.f + 2 * N.t, N.f + N.t + N.t * (1 + 2 * N.p / N.d)


def check():
    # In one direction: how far the axis of the screw may be from that of the clearance hole, from bounds of ends of axes.
    def offset(top, bottom, at):
        # the axis of the thread through its ends at heights `bottom` and `top`; of the clearance hole, at its two ends
        share = (at - bottom) / (top - bottom)
        return -optimize.linprog([-share, share - 1, 1.0], bounds=[(-N.t / 2, N.t / 2)] * 3).fun

    # A floating screw only has to share both holes: each clears it by half of hole less screw, on either side.
    floating = optimize.linprog([1, 0, 0], [[-1, 1, -1], [-1, -1, 1]], [0, 0], bounds=[(0, None), *[(N.t / 2, N.t / 2)], *[(-N.t / 2,) * 2]])
    projected = max(offset(N.p, 0.0, at) for at in (0.0, N.p))
    tilted = max(offset(0.0, -N.d, at) for at in (0.0, N.p))
    return N.f + floating.x[0], N.f + 2 * projected, N.f + 2 * tilted


def assembly(projected=None):
    """Return a plate with a threaded hole, measured where the screw leaves the other plate."""
    model = tc.Assembly("smallest holes")
    position = tc.Position(N.t, "A|B") if projected is None else tc.Position(N.t, "A|B", projected=projected)
    thread = parts.ring(model, N.f / 2, N.d, "bore", position)
    return model, thread
