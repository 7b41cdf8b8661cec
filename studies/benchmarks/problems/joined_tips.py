"""Two cantilevers joined at their tips."""

import numpy as np

from studies.benchmarks.beams import beam_stiffness, condensed
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def bending(thickness):
    return N.E * N.width * thickness**3 / 12


def solution():
    k1, k2 = (3 * bending(h) / N.length**3 for h in (N.h1, N.h2))
    place = (k1 * N.d1 + k2 * N.d2) / (k1 + k2)
    return place, k1 * (N.d1 - place)


def check():
    (k1,), (k2,) = (condensed(beam_stiffness(N.length, 7, bending(h))[2:, 2:], [12])[0] for h in (N.h1, N.h2))
    # Equilibrium of both tips with the multiplier of their tie.
    first, second, force = np.linalg.solve([[k1, 0, 1], [0, k2, -1], [1, -1, 0]], [k1 * N.d1, k2 * N.d2, 0])
    return (first + second) / 2, force
