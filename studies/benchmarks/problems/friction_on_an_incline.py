"""The least friction that holds a block on an incline."""

import numpy as np

from studies.benchmarks.friction import least_coefficient
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return (np.tan(np.radians(N.angle)),)


def check():
    angle = np.radians(N.angle)
    weight = N.weight * np.array([np.sin(angle), -np.cos(angle)])
    return (least_coefficient([((-N.half, 0), (0, 1)), ((N.half, 0), (0, 1))], [((0, N.height), weight)]),)
