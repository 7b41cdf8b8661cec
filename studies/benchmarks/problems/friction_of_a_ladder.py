"""The least friction that holds a ladder."""

import numpy as np
from scipy import optimize

from studies.benchmarks.friction import least_coefficient
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    tan = np.tan(np.radians(N.angle))
    return 1 / (2 * tan), np.sqrt(1 + tan**2) - tan


def check():
    angle = np.radians(N.angle)
    foot, top = (N.length * np.cos(angle), 0.0), (0.0, N.length * np.sin(angle))
    load = [((foot[0] / 2, top[1] / 2), (0, -N.weight))]

    def smooth(mu):  # moment about the foot: the wall's force, equal to friction at the foot, and the weight
        return mu * N.weight * top[1] - N.weight * foot[0] / 2

    rough = least_coefficient([(foot, (0, 1)), (top, (1, 0))], load)
    return optimize.brentq(smooth, 0, 5, xtol=1e-13), rough
