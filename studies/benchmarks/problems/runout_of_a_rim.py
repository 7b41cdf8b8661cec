"""The circular run-out of a rim."""

import numpy as np
from scipy import integrate, optimize, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
INSIDE = 0.9973


def solution():
    s = N.t / 2 / np.sqrt(-2 * np.log(1 - np.sqrt(INSIDE)))
    return 2 * s * np.sqrt(np.pi / 2), 2 * s * np.sqrt(-2 * np.log(0.05))


def check():
    square = stats.chi2(2)
    s = N.t / 2 / optimize.brentq(lambda k: square.cdf(k**2) ** 2 - INSIDE, 1, 6, xtol=1e-13)
    mean = integrate.quad(lambda e: square.sf(e**2), 0, 20, epsabs=1e-13)[0]
    return 2 * s * mean, 2 * s * np.sqrt(square.isf(0.05))


def assembly():
    model = tc.Assembly("run-out of a rim")
    rim = parts.ring(model, 10, 5, "rim", tc.CircularRunout(N.t, "B"))
    for axis in "xy":
        model.measure(axis, rim.axis(1), along=axis)
    return model


def answers():
    results = an.simulated(assembly(), 200_000)
    runout = 2 * np.hypot(an.values(results, "x"), an.values(results, "y"))
    return an.Answers([an.mean(runout), an.quantile(runout, 0.95)], len(runout))
