"""The position of a hole that shifts without tilting."""

import numpy as np
from scipy import integrate, optimize, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
INSIDE = 0.9973


def solution():
    s = N.t / 2 / np.sqrt(-2 * np.log(1 - INSIDE))
    return s, np.exp(-((N.r / s) ** 2) / 2)


def check():
    def beyond(radius, s):  # one minus the mass of strips across the disk
        def strip(angle):
            half = radius * np.cos(angle)
            return stats.norm.pdf(radius * np.sin(angle), 0, s) * half * (2 * stats.norm.cdf(half / s) - 1)

        return 1 - integrate.quad(strip, -np.pi / 2, np.pi / 2, epsabs=1e-14)[0]

    s = optimize.brentq(lambda s: beyond(N.t / 2, s) - (1 - INSIDE), N.t / 20, N.t / 3, xtol=1e-14)
    return s, beyond(N.r, s)


def assembly():
    model = tc.Assembly("hole position")
    bore = parts.ring(model, 5, 20, "bore", tc.Position(N.t, "A|B", rule="translation"))
    for axis in "xy":
        model.measure(axis, bore.axis(1), along=axis)
    return model


def answers():
    results = an.simulated(assembly(), 200_000)
    x, y = (an.values(results, axis) for axis in "xy")
    return an.Answers([an.deviation(x), an.share(np.hypot(x, y) > N.r)], len(x))
