"""A stack of four parts with a correlation and a shared cause."""

import numpy as np
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    covariance = N.s**2 * np.eye(4)
    covariance[0, 1] = covariance[1, 0] = N.rho * N.s**2
    covariance[2:, 2:] += (N.alpha * N.kelvin) ** 2
    sigma = np.sqrt(covariance.sum())
    return sigma, 2 * stats.norm.sf(N.limit / sigma)


def check():
    # Independent causes: the mould by which both parts move together, the temperature, and a remainder.
    together = N.s * np.sqrt(2 + 2 * N.rho)
    remainder = stats.norm(0, np.sqrt(2) * N.s)
    heat = 2 * N.alpha * N.kelvin
    x = np.linspace(-9, 9, 1201)
    weight = stats.norm.pdf(x) * (x[1] - x[0])
    moved = together * x[:, None] + heat * x
    plane = weight[:, None] * weight
    beyond = (plane * (remainder.cdf(-N.limit - moved) + remainder.sf(N.limit - moved))).sum()
    return np.sqrt((plane * moved**2).sum() + integrate.quad(lambda y: y**2 * remainder.pdf(y), -1, 1)[0]), beyond


def assembly():
    model = tc.Assembly("correlated stack")
    size = parts.dimensions(model, **{f"part{k}": 6 * N.s for k in range(4)})
    model.correlate(["part0.S", "part1.S"], N.rho)
    model.variable("temperature", 6 * N.kelvin, drives={"part2.S": N.alpha, "part3.S": N.alpha}, units="K")
    model.measure("height", lambda poses: sum(poses.translation(part)[0] for part in size.values()), tolerance=2 * N.limit)
    return model


def answers():
    height = an.values(an.simulated(assembly(), 200_000), "height")
    return an.Answers([an.deviation(height), an.share(abs(height) > N.limit)], len(height))
