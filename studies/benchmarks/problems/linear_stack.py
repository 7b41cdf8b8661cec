"""The gap of a stack of four parts."""

import numpy as np
from scipy import integrate, signal, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
WIDTHS = np.array([N.ta, N.tb, N.tc, N.th])
NOMINAL = N.h - N.a - N.b - N.c


def solution():
    sigma = np.sqrt((WIDTHS**2).sum()) / 6
    return NOMINAL, sigma, stats.norm.cdf((N.limit - NOMINAL) / sigma)


def check():
    x, step = np.linspace(-0.8, 0.8, 16_001, retstep=True)
    first_density, *further_densities = (stats.norm.pdf(x, 0, width / 6) for width in WIDTHS)
    density = first_density
    for next_density in further_densities:
        density = signal.fftconvolve(density, next_density, mode="same") * step
    mean = integrate.simpson(density * x, x=x)
    below = x <= N.limit - NOMINAL + step / 2
    spread = np.sqrt(integrate.simpson(density * (x - mean) ** 2, x=x))
    return NOMINAL + mean, spread, integrate.simpson(density[below], x=x[below])


def assembly():
    model = tc.Assembly("linear stack")
    size = parts.dimensions(model, a=N.ta, b=N.tb, c=N.tc, h=N.th)

    def gap(poses):
        moved = {name: poses.translation(part)[0] for name, part in size.items()}
        return NOMINAL + moved["h"] - moved["a"] - moved["b"] - moved["c"]

    model.measure("gap", gap, limits=(N.limit, None))
    return model


def answers():
    gap = an.values(an.simulated(assembly(), 200_000), "gap")
    return an.Answers([an.mean(gap), an.deviation(gap), an.share(gap < N.limit)], len(gap))
