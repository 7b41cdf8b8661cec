"""The friction from which on a peg can wedge."""

import numpy as np
from scipy import optimize

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
