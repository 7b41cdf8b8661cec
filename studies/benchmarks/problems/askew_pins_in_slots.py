"""Two square pins in two slots, faces askew but not off."""

import numpy as np
from scipy import integrate, signal, special, stats

from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
CLEARANCE = N.slot - N.pin
SIDE = np.sqrt(2) * N.t / 6  # standard deviation of what the tilts of two faces take at one corner


def solution():
    def within(x):
        return stats.halfnorm.cdf(x, scale=SIDE)

    def lost(x):  # density of the larger one of two losses
        return 2 * within(x) * stats.halfnorm.pdf(x, scale=SIDE)

    both = integrate.quad(lambda x: lost(x) * (1 - within(CLEARANCE - x) ** 2), 0, CLEARANCE, epsabs=1e-16)[0]
    return (both + 1 - within(CLEARANCE) ** 2,)


def check():
    step = CLEARANCE / 20_000
    edges = np.arange(60_001) * step
    mass = np.diff(special.erf(edges / SIDE / np.sqrt(2)) ** 2)  # of each cell
    total = signal.fftconvolve(mass, mass)  # of sums, centred at edges 1, 2, ...
    at_limit = round(CLEARANCE / step) - 1
    return (total[at_limit + 1 :].sum() + total[at_limit] / 2,)


def assembly():
    return parts.pins_and_slots(off=None, tilt=N.t / 5, pin=N.pin, slot=N.slot, places=(N.x1, N.x2))


def answers():
    return an.of_tails(assembly(), "not assemblable", 40_000)
