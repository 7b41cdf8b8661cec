"""A heavy strip that loses its table."""

import numpy as np
from scipy import integrate

from studies.benchmarks.problem import numbers

N = numbers(__file__)
BENDING = N.E * N.width * N.h**3 / 12


def solution():
    length = (24 * BENDING * N.H / N.q) ** 0.25
    return length, N.q * length / 2


def check():
    def slopes(x, y, p):  # x from 0 to 1 times the unknown length
        return np.vstack([p[0] * y[1], p[0] * y[2], p[0] * y[3], np.full_like(x, -p[0] * N.q / BENDING)])

    def ends(left, right, p):  # flat, without moment, on the table; lifted, without moment, at the end
        return np.array([left[0], left[1], left[2], right[0] - N.H, right[2]])

    x = np.linspace(0, 1, 50)
    start = np.vstack([N.H * x**3, 3 * N.H * x**2 / 150, 6 * N.H * x / 150**2, np.full_like(x, 6 * N.H / 150**3)])
    solution_on_length = integrate.solve_bvp(slopes, ends, x, start, p=[150.0], tol=1e-10)
    return solution_on_length.p[0], -BENDING * solution_on_length.y[3, -1]
