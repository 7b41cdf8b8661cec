"""Two parts whose deviations have heavy tails."""

import numpy as np
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
PULL = N.limit / N.scale


def solution():
    t = stats.t(3)
    spans = (-np.inf, 0), (0, PULL / 2)
    inner = [integrate.quad(lambda x: t.pdf(x) * t.sf(PULL - x), *span, epsabs=0, epsrel=1e-10)[0] for span in spans]
    return (2 * sum(inner) + t.sf(PULL / 2) ** 2,)


def check():
    # P(X > x) = -1/pi Im of the integral of f(w) exp(-i w x) / w with f = exp(-2 r w) (1 + r w)², r = sqrt 3. Along
    # w = -i v / x the exponential falls, and what is left is the odd part of f: exp(2 i r v / x) (1 - i r v / x)².
    r = np.sqrt(3) / PULL

    def integrand(v):
        return np.exp(-v) / v * (np.exp(2j * r * v) * (1 - 1j * r * v) ** 2).imag

    return (abs(integrate.quad(integrand, 0, 60, epsabs=0, epsrel=1e-11, limit=400)[0]) / np.pi,)


def assembly():
    model = tc.Assembly("heavy tails")
    zone = tc.Tolerance(distribution=stats.t(3, scale=N.scale))
    size = parts.dimensions(model, first=zone, second=zone)
    model.measure("height", lambda poses: sum(poses.translation(part)[0] for part in size.values()), limits=(None, N.limit))
    return model


def answers():
    return an.of_tails(assembly(), "height outside limits", 40_000)
