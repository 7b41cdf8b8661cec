"""The friction from which on a peg can wedge."""

import numpy as np
from scipy import optimize

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return (N.depth / N.d,)


def check():
    def wedges(mu):
        edges = [(x, y, nx, sign * mu) for x, y, nx in ((0, 0, 1), (N.d, N.depth, -1)) for sign in (1, -1)]
        balance = np.array([(fx, fy, x * fy - y * fx) for x, y, fx, fy in edges]).T
        rows = np.vstack([balance, np.ones(4)])  # their sum is 1: they are not all 0
        return optimize.linprog(np.zeros(4), A_eq=rows, b_eq=[0, 0, 0, 1]).status == 0

    low, high = 0.0, 3.0
    while high - low > 1e-9:
        middle = (low + high) / 2
        low, high = (low, middle) if wedges(middle) else (middle, high)
    return (high,)


def assembly():
    model = tc.Assembly("peg")
    peg = model.part("peg", tc.Box(N.d, 1, 3 * N.depth))
    planar = [tc.Locator(f"beside {k}", (x, 0, z), "y", 0.1) for k, (x, z) in enumerate([(0, 0), (N.d, 0), (0, N.depth)])]
    rims = [((0, 0, 0), "x"), ((N.d, 0, N.depth), "-x")]
    walls = [tc.Locator(f"rim {k}", point, into, 0.1, one_sided=True) for k, (point, into) in enumerate(rims)]
    model.locate(peg, [*planar, *walls, tc.Locator("bottom", (N.d / 2, 0, 0), "z", 0.1, one_sided=True)])
    model.force("push", at=peg.point(N.d / 2, 0, 3 * N.depth), vector=(0, 0, -1))
    model.measure("depth", peg.point(0, 0, 0), along="z")
    return model


def answers():
    return an.Answers([an.critical_friction(assembly(), "peg.bottom")], 0)
