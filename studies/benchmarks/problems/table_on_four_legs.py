"""A rigid table on four legs of uneven length."""

import numpy as np
from scipy import optimize, stats

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)
LEGS = np.array([(0, 0), (100, 0), (100, 100), (0, 100)], dtype=float)


def solution():
    return N.s / np.sqrt(2 * np.pi), N.s * np.sqrt(0.5 - 1 / (2 * np.pi))


def check():
    plane = np.column_stack([np.ones(4), LEGS - 50])  # height of the middle and slopes, to heights of the corners

    def middle(legs):
        return optimize.linprog([1, 0, 0], -plane, -legs, bounds=[(None, None)] * 3).fun

    # The program is linear in twist w = z1 - z2 + z3 - z4 on either side of 0, and shifts with the mean: two solves suffice.
    up, down = (abs(middle(sign * np.array([1.0, -1, 1, -1]) / 4)) for sign in (1, -1))
    shift, tilt = middle(np.ones(4)), middle(np.array([1.0, 1, -1, -1]))
    w, step = np.linspace(-20 * N.s, 20 * N.s, 40_001, retstep=True)
    density = stats.norm.pdf(w, 0, 2 * N.s) * step
    by_twist = np.where(w > 0, up * w, -down * w)
    mean = density @ by_twist
    return mean + tilt, np.sqrt(density @ by_twist**2 - mean**2 + (shift * N.s / 2) ** 2)


def assembly():
    model = tc.Assembly("table", method=tc.Method(resolution="exact", objective="seating"))
    top = model.part("table", tc.Box(100, 100, 5))
    legs = [tc.Locator(f"leg {k}", (x, y, 0), "z", 6 * N.s, one_sided=True) for k, (x, y) in enumerate(LEGS.tolist())]
    guides = [
        tc.Locator("B1", (10, 0, 2), "y", 0.0),
        tc.Locator("B2", (90, 0, 2), "y", 0.0),
        tc.Locator("C", (0, 50, 2), "x", 0.0),
    ]
    model.locate(top, [*legs, *guides])
    model.force("weight", at=top.point(50, 50, 2.5), vector=(0, 0, -100))
    model.measure("middle", top.point(50, 50, 0), along="z")
    return model


def answers():
    middle = an.values(an.simulated(assembly(), 20_000), "middle")
    return an.Answers([an.mean(middle), an.deviation(middle)], len(middle))
