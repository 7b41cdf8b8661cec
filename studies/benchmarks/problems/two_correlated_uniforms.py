"""Two uniform links with a Gaussian copula."""

import numpy as np
from scipy import integrate, optimize, stats

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)
OWN = np.sqrt(1 - N.rho**2)


def solution():
    pearson = 6 / np.pi * np.arcsin(N.rho / 2)
    sigma = 2 * N.half / np.sqrt(12)

    def above(x):  # given the first length, by the conditional distribution of the copula
        second = stats.norm.ppf(np.clip((N.limit - x) / (2 * N.half) + 0.5, 0, 1))
        return stats.norm.sf((second - N.rho * stats.norm.ppf(x / (2 * N.half) + 0.5)) / OWN) / (2 * N.half)

    share = integrate.quad(above, N.limit - N.half, N.half, epsabs=1e-12, limit=200)[0]
    return pearson, sigma * np.sqrt(2 + 2 * pearson), share


def check():
    # In polar coordinates of the two independent normal causes.
    radii, weights = np.polynomial.legendre.leggauss(200)
    radii, weights = 4.5 * (radii + 1), 4.5 * weights
    r, angle = np.meshgrid(radii, np.linspace(0, 2 * np.pi, 720, endpoint=False))
    density = weights * r * np.exp(-(r**2) / 2) / 720
    first, second = _lengths(r, angle)
    variances = (density * first**2).sum(), (density * (first + second) ** 2).sum()

    def above(angle):  # the sum grows along rays on which both lengths do; on others it is below the limit
        reach = optimize.brentq(lambda r: sum(_lengths(r, angle)) - N.limit, 0, 1e6, xtol=1e-12)
        return np.exp(-(reach**2) / 2) / (2 * np.pi)

    share = integrate.quad(above, -np.arcsin(N.rho) + 1e-5, np.pi / 2 - 1e-5, epsabs=1e-12, limit=200)[0]
    return (density * first * second).sum() / variances[0], np.sqrt(variances[1]), share


def _lengths(r, angle):
    scores = r * np.cos(angle), r * (N.rho * np.cos(angle) + OWN * np.sin(angle))
    return [N.half * (2 * stats.norm.cdf(score) - 1) for score in scores]


def assembly():
    stack = tc.Stack("two correlated uniforms")
    for name in ("first", "second"):
        stack.link(name, 0.0, tc.Tolerance(2 * N.half, "uniform"))
    stack.correlate(["first", "second"], N.rho)
    for name in ("first", "second"):
        stack.gap(name, {name: 1.0})
    stack.gap("sum", {"first": 1.0, "second": 1.0}, limits=(None, N.limit))
    return stack


def answers():
    results = an.simulated(assembly(), 200_000)
    first, second, total = (an.values(results, name) for name in ("first", "second", "sum"))
    product = (first - first.mean()) * (second - second.mean()) / (first.std() * second.std())
    r = product.mean()
    scores = [(x - x.mean()) ** 2 / x.var() for x in (first, second)]
    half = an.Z * (product - r / 2 * sum(scores)).std() / np.sqrt(len(first))  # by the influence of each realization
    return an.Answers([an.Estimate(r, r - half, r + half), an.deviation(total), an.share(total > N.limit)], len(first))
