"""A stack of three parts whose deviations are skewed."""

import numpy as np
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
COUNT = 3


def solution():
    total = stats.gamma(COUNT * N.shape, scale=N.scale)
    return total.mean(), 2 / np.sqrt(COUNT * N.shape), total.sf(N.limit)


def check():
    # Condition on two of the parts: what is above the limit, and the moments about the mean.
    part = stats.gamma(N.shape, scale=N.scale)
    nodes, weights = np.polynomial.legendre.leggauss(80)
    x, w = (nodes + 1) * N.limit / 2, weights * N.limit / 2
    inner = [
        integrate.quad(lambda y, a=a: part.pdf(y) * part.sf(N.limit - a - y), 0, N.limit - a)[0] + part.sf(N.limit - a)
        for a in x
    ]
    above = w @ (part.pdf(x) * np.array(inner)) + part.sf(N.limit)
    mean, second, third = (integrate.quad(lambda y, k=k: part.pdf(y) * y**k, 0, 40 * N.scale)[0] for k in (1, 2, 3))
    variance = second - mean**2
    return COUNT * mean, (third - 3 * mean * variance - mean**3) / variance**1.5 / np.sqrt(COUNT), above


def assembly():
    model = tc.Assembly("skewed stack")
    size = parts.dimensions(
        model, **{f"part{k}": tc.Tolerance(distribution=stats.gamma(N.shape, scale=N.scale)) for k in range(COUNT)}
    )
    model.measure("height", lambda poses: sum(poses.translation(part)[0] for part in size.values()), limits=(None, N.limit))
    return model


def answers():
    height = an.values(an.simulated(assembly(), 200_000), "height")
    return an.Answers([an.mean(height), an.skewness(height), an.share(height > N.limit)], len(height))
