"""A block between two stops."""

import numpy as np
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    low, high = -N.a / N.s, N.b / N.s
    p, q = stats.norm.cdf(low), stats.norm.sf(high)
    first = stats.norm.pdf(low) - stats.norm.pdf(high) + low * p + high * q
    inside = 1 - p - q + low * stats.norm.pdf(low) - high * stats.norm.pdf(high)
    second = inside + low**2 * p + high**2 * q
    return N.s * first, N.s * np.sqrt(second - first**2), p + q


def check():
    ends = stats.norm.cdf([-N.a / N.s, N.b / N.s])

    def moment(k):
        between = integrate.quad(lambda u: (N.s * stats.norm.ppf(u)) ** k, *ends, epsabs=1e-14)[0]
        return between + (-N.a) ** k * ends[0] + N.b**k * (1 - ends[1])

    return moment(1), np.sqrt(moment(2) - moment(1) ** 2), 1 - (ends[1] - ends[0])


def assembly():
    model = tc.Assembly("block between stops")
    left = model.part("left", tc.Box(10, 10, 10), at=(-10 - N.a, 0, 0), fixed=True)
    right = model.part("right", tc.Box(10, 10, 10), at=(10 + N.b, 0, 0), fixed=True)
    block = parts.slider(model, "block", 6 * N.s, along="x")
    model.contact("left stop", moving=block.face("-x"), reference=left.face("+x"), points=9)
    model.contact("right stop", moving=block.face("+x"), reference=right.face("-x"), points=9)
    model.measure("place", block.point(5, 5, 5), along="x")
    return model


def answers():
    place = an.values(an.simulated(assembly(), 40_000), "place")
    at_stop = (place < -N.a + 1e-7) | (place > N.b - 1e-7)
    return an.Answers([an.mean(place), an.deviation(place), an.share(at_stop)], len(place))
