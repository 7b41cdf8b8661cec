"""A shaft with three lobes in a round bore."""

import numpy as np
from scipy import optimize

from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return 2 * N.a, N.D / 2 - N.R - N.a


def check():
    t = np.linspace(0, 2 * np.pi, 721)
    section = (N.R + N.a * np.cos(3 * t)) * np.array([np.cos(t), np.sin(t)])

    def least(f):
        start = np.array([3e-3, -2e-3])
        return optimize.minimize(f, start, method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-13}).fun

    ring = least(lambda c: np.ptp(np.hypot(*(section - c[:, None]))))
    return ring, N.D / 2 - least(lambda c: np.hypot(*(section - c[:, None])).max())
