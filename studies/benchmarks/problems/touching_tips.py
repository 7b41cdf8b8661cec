"""Two elastic tips that may touch."""

import numpy as np
from scipy import integrate, optimize, stats

from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    share = N.k2 / (N.k1 + N.k2) * N.s
    return share / np.sqrt(2 * np.pi), share**2 * (0.5 - 1 / (2 * np.pi))


def check():
    def moved(gap):  # the force that closes the gap moves both tips
        force = optimize.brentq(lambda f: f / N.k1 + f / N.k2 + gap, 0, 100, xtol=1e-14)
        return force / N.k1

    density = stats.norm(0, N.s).pdf
    first, second = (
        integrate.quad(lambda g, k=k: density(g) * moved(g) ** k, -10 * N.s, -1e-12, epsabs=1e-13)[0] for k in (1, 2)
    )
    return first, second - first**2
