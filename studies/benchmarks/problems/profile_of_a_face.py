"""The profile of a rectangular face that shifts and leans."""

import numpy as np
from scipy import integrate, optimize, signal, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
INSIDE = 0.9973


def solution():
    def inside(reach):  # P(|z| + |A| + |B| <= reach) in standard deviations
        nodes, weights = np.polynomial.legendre.leggauss(60)
        x = (nodes + 1) / 2

        def given(a):
            remainder = (reach - a) * x
            return (reach - a) / 2 * weights @ (stats.halfnorm.pdf(remainder) * stats.halfnorm.cdf(reach - a - remainder))

        return integrate.quad(lambda a: stats.halfnorm.pdf(a) * given(a), 0, reach, epsabs=1e-13)[0]

    factor = optimize.brentq(lambda k: inside(k) - INSIDE, 3, 10, xtol=1e-12)
    return N.t / 2 / factor, np.sqrt(3) * N.t / 2 / factor


def check():
    step = 5e-4
    x = np.arange(30_000) * step
    weights = np.ones_like(x)
    weights[0] = 0.5  # trapezoids
    density = 2 * stats.norm.pdf(x) * weights
    three = density
    for _ in range(2):
        three = signal.fftconvolve(three, density)[: len(x)] * step
    below = np.cumsum(three) * step - three * step / 2
    k = np.searchsorted(below, INSIDE)
    factor = x[k - 1] + step * (INSIDE - below[k - 1]) / (below[k] - below[k - 1])
    s = N.t / 2 / factor
    return s, np.sqrt(np.ones(3) @ np.full(3, s**2))


def assembly():
    model = tc.Assembly("profile of a face")
    top = parts.block(model, (N.length, N.width, 10), tc.Profile(N.t, "A|B|C"))
    model.measure("middle", top.point(N.length / 2, N.width / 2, 10), along="z")
    model.measure("corner", top.point(N.length, N.width, 10), along="z")
    return model


def answers():
    results = an.simulated(assembly(), 200_000)
    return an.Answers([an.deviation(an.values(results, name)) for name in ("middle", "corner")], 200_000)
