"""The friction at which a clamped block does not slide to its stop."""

import numpy as np

from studies.benchmarks.friction import least_coefficient
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    angle = np.radians(N.angle)
    return (N.clamp * np.sin(angle) / (N.weight + N.clamp * np.cos(angle)),)


def check():
    angle = np.radians(N.angle)
    clamp = -N.clamp * np.array([np.sin(angle), np.cos(angle)])
    return (least_coefficient([((10, 0), (0, 1)), ((90, 0), (0, 1))], [((50, 20), (0, -N.weight)), ((60, 40), clamp)]),)
