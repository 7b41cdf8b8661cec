"""The parallelism of a rectangular face that leans."""

import numpy as np
from scipy import integrate, optimize, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
INSIDE = 0.9973


def solution():
    factor = np.sqrt(2) * stats.norm.ppf((1 + np.sqrt(INSIDE)) / 2)
    corner = np.sqrt(2) * N.t / 2 / factor
    return corner, 2 * stats.norm.sf(N.limit / corner)


def check():
    def inside(k):
        return integrate.quad(lambda a: stats.halfnorm.pdf(a) * stats.halfnorm.cdf(k - a), 0, k, epsabs=1e-13)[0]

    s = N.t / 2 / optimize.brentq(lambda k: inside(k) - INSIDE, 1, 9, xtol=1e-12)
    beyond = integrate.quad(
        lambda a: stats.norm.pdf(a, 0, s) * (stats.norm.sf(N.limit - a, 0, s) + stats.norm.cdf(-N.limit - a, 0, s)),
        -10 * s, 10 * s, epsabs=1e-13,
    )  # fmt: skip
    return np.sqrt(2) * s, beyond[0]


def assembly():
    model = tc.Assembly("parallelism of a face")
    top = parts.block(model, (N.length, N.width, 10), tc.Parallelism(N.t, "A"))
    model.measure("corner", top.point(N.length, N.width, 10), along="z")
    return model


def answers():
    corner = an.values(an.simulated(assembly(), 200_000), "corner")
    return an.Answers([an.deviation(corner), an.share(abs(corner) > N.limit)], len(corner))
