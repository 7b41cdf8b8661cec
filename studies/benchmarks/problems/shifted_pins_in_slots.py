"""Two square pins in two slots, faces off but not askew."""

import numpy as np
from scipy import integrate, stats

from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
CLEARANCE = N.slot - N.pin
SIDE = np.sqrt(2) * N.t / 6  # standard deviation of a gap: two faces


def solution():
    def density(m):  # of the lesser one of two gaps
        return 2 * stats.norm.sf(m / SIDE) * stats.norm.pdf(m / SIDE) / SIDE

    def below(m):
        return 1 - stats.norm.sf(m / SIDE) ** 2

    return (integrate.quad(lambda m: density(m) * below(-CLEARANCE - m), -12 * SIDE, 10 * SIDE, epsabs=1e-16, limit=200)[0],)


def check():
    # The lesser one is the mean less half of the difference; differences and means are independent.
    nodes, weights = np.polynomial.legendre.leggauss(200)
    half = (nodes + 1) * 6
    weights = 6 * weights * stats.halfnorm.pdf(half)
    lost = SIDE / np.sqrt(2) * half
    return (weights @ stats.norm.cdf((lost[:, None] + lost - CLEARANCE) / SIDE) @ weights,)


def assembly():
    return parts.pins_and_slots(off=N.t, tilt=None, pin=N.pin, slot=N.slot, places=(N.x1, N.x2))


def answers():
    return an.of_tails(assembly(), "not assemblable", 30_000)
