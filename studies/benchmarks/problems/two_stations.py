"""Three parts that are joined in one station and measured in the next."""

import numpy as np
from scipy import integrate, stats

from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    step = np.sqrt(2) * N.s
    mean, variance = step / np.sqrt(2 * np.pi), step**2 * (0.5 - 1 / (2 * np.pi))
    lever = (N.x3 - N.x2) / (N.x2 - N.x1)
    return mean, variance, lever * mean, N.s**2 * ((1 + lever) ** 2 + lever**2 + 1) + lever**2 * variance


def check():
    # The joint's height h and slope m: h + m x1 = p1 on A, h + m x2 + step = p2 on B; columns are p1, p2 and the step.
    places = np.linalg.solve([[1, N.x1], [1, N.x2]], [[1, 0, 0], [0, 1, -1]])
    flush = -np.array([1, N.x3]) @ places - [0, 0, 1]
    density = stats.norm(0, np.sqrt(2) * N.s).pdf
    first, second = (integrate.quad(lambda g, k=k: g**k * density(g), 0, 12 * N.s, epsabs=1e-15)[0] for k in (1, 2))
    variance = second - first**2
    return first, variance, flush[2] * first, N.s**2 * (flush[0] ** 2 + flush[1] ** 2 + 1) + flush[2] ** 2 * variance
