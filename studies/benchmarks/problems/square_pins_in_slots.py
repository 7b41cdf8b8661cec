"""Two square pins in two slots, all faces off and askew."""

import numpy as np
from scipy import integrate, stats

from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
CLEARANCE = (N.slot - N.pin) / 2
SIDE = 2 * N.t / 6  # standard deviation of a gap at one corner: two faces, offset and tilt


def solution():
    def density(m):  # of the least of four gaps
        return 4 * stats.norm.sf(m / SIDE) ** 3 * stats.norm.pdf(m / SIDE) / SIDE

    def below(m):
        return 1 - stats.norm.sf(m / SIDE) ** 4

    return (
        integrate.quad(lambda m: density(m) * below(-2 * CLEARANCE - m), -10 * SIDE, 10 * SIDE, epsabs=1e-14, limit=200)[0],
    )


def check():
    offset = np.sqrt(2) * N.t / 6
    nodes, weights = np.polynomial.legendre.leggauss(120)
    tilts = (nodes + 1) * 4.5 * offset
    weights = weights * 4.5 * offset * stats.halfnorm.pdf(tilts, scale=offset)

    def above(x):  # P(least gap of a pin > x)
        return stats.norm.sf((x[:, None] + tilts) / offset) @ weights

    x, step = np.linspace(-1.0, 1.0, 4001, retstep=True)
    density = 2 * above(x) * (stats.norm.pdf((x[:, None] + tilts) / offset) @ weights / offset)
    return (step * density @ (1 - above(-2 * CLEARANCE - x) ** 2),)


def assembly():
    return parts.pins_and_slots(off=N.t, tilt=N.t / 5, pin=N.pin, slot=N.slot, places=(N.x1, N.x2))


def answers():
    results = an.simulated(assembly(), 20_000)
    return an.Answers([an.share(an.not_assembled(results))], 20_000)
