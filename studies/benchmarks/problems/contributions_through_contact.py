"""Contributions of two causes to a height that contact keeps above 0."""

import numpy as np
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    whole = N.sa**2 + N.sb**2

    def product(rho):  # mean of two positive parts of correlated unit normal variables
        return (np.sqrt(1 - rho**2) + rho * (np.pi - np.arccos(rho))) / (2 * np.pi)

    variance = 0.5 - 1 / (2 * np.pi)
    first, other = ((product(s**2 / whole) - 1 / (2 * np.pi)) / variance for s in (N.sa, N.sb))
    return first, 1 - other, N.sa**2 / whole


def check():
    whole = np.hypot(N.sa, N.sb)

    def share(sigma, other_sigma):
        def mean(x):
            return other_sigma * stats.norm.pdf(x / other_sigma) + x * stats.norm.cdf(x / other_sigma)

        moments = [
            integrate.quad(lambda z, k=k: stats.norm.pdf(z) * mean(sigma * z) ** k, -10, 10, epsabs=1e-14)[0] for k in (1, 2)
        ]
        second = integrate.quad(lambda h: h**2 * stats.norm.pdf(h, 0, whole), 0, 12 * whole, epsabs=1e-14)[0]
        return (moments[1] - moments[0] ** 2) / (second - moments[0] ** 2)

    return share(N.sa, N.sb), 1 - share(N.sb, N.sa), N.sa**2 / whole**2


def assembly():
    model = tc.Assembly("contributions through contact")
    base = model.part("base", tc.Box(30, 20, 10), at=(0, 0, -10), fixed=True)
    carrier = parts.slider(model, "carrier", 6 * N.sa, at=(100, 0, 0))
    block = parts.slider(model, "block", 6 * N.sb, size=(30, 20, 10), on=carrier)
    model.contact("seat", moving=block.face("-z"), reference=base.face("+z"), points=12)
    model.measure("height", block.point(15, 10, 0), along="z")
    return model


def answers():
    contributions = tc.analyses.contributions(assembly(), samples=8192, seed=an.SEED, solver="daqp").sel(
        measure="height", group="carrier.S"
    )
    indices = [an.of_analysis(contributions[kind].sel(state="corrected")) for kind in ("first", "total")]
    return an.Answers([*indices, an.within(contributions.linear, 1e-6)], int(contributions.by_status.sum()))
