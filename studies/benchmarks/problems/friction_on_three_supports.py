"""The least friction of three supports that holds a clamped block."""

import numpy as np

from studies.benchmarks.friction import least_coefficient
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    angles = np.radians(N.angles)
    return tuple(N.clamp * np.sin(angles) / (N.weight + N.clamp * np.cos(angles)))


def check():
    supports = [((x, y, 0), (0, 0, 1)) for x, y in ((10, 10), (90, 10), (50, 50))]

    def coefficient(angle):
        aside = np.sin(angle) * np.sqrt(0.5)
        clamp = -N.clamp * np.array([aside, aside, np.cos(angle)])
        return least_coefficient(supports, [((50, 30, 10), (0, 0, -N.weight)), ((50, 30, 20), clamp)])

    return tuple(map(coefficient, np.radians(N.angles)))
