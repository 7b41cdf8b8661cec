"""The least zone of a saddle."""

import numpy as np
from scipy import optimize

from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return (2 * N.c * N.half**2,)


def check():
    side = np.linspace(-N.half, N.half, 21)
    x, y = (grid.ravel() for grid in np.meshgrid(side, side))
    plane, ones = np.column_stack([np.ones_like(x), x, y]), np.ones((len(x), 1))
    z = N.c * x * y
    rows = np.vstack([np.hstack([plane, -ones]), np.hstack([-plane, -ones])])  # |z - plane| <= half of the width
    return (2 * optimize.linprog([0, 0, 0, 1], rows, np.concatenate([z, -z]), bounds=[(None, None)] * 4).fun,)
