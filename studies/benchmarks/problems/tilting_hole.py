"""A hole that shifts and tilts within its zone, and the tip of a pin in it."""

import numpy as np
from scipy import optimize, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
INSIDE = 0.9973


def solution():
    s = N.t / 2 / np.sqrt(-2 * np.log(1 - np.sqrt(INSIDE)))
    lever = N.reach / N.length
    return s, s * np.hypot(1 + lever, lever)


def check():
    factor = optimize.brentq(lambda k: stats.chi2.cdf(k**2, 2) ** 2 - INSIDE, 1, 6, xtol=1e-13)
    s = N.t / 2 / factor
    heights = np.array([0, N.length])
    middle, tilt = np.array([0.5, 0.5]), np.array([-1, 1]) / N.length
    weights = middle + tilt * (N.length + N.reach - heights.mean())
    return s, np.sqrt(weights @ (s**2 * np.eye(2)) @ weights)


def assembly():
    model = tc.Assembly("tilting hole")
    bore = parts.ring(model, 5, N.length, "bore", tc.Position(N.t, "A|B"))
    model.measure("end", bore.axis(1), along="x")
    # A straight axis: the tip is its upper end and reach / length times the difference of the ends.
    model.measure("low end", bore.axis(0), along="x")
    return model


def answers():
    results = an.simulated(assembly(), 200_000)
    high, low = an.values(results, "end"), an.values(results, "low end")
    return an.Answers([an.deviation(high), an.deviation(high + (high - low) * N.reach / N.length)], len(high))
