"""Two blocks whose heights both vary."""

import numpy as np
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return N.s / np.sqrt(np.pi), N.s**2 * (1 - 1 / np.pi)


def check():
    both = stats.norm(0, N.s)
    first, second = (
        integrate.quad(lambda h, k=k: h**k * 2 * both.pdf(h) * both.cdf(h), -10 * N.s, 10 * N.s)[0] for k in (1, 2)
    )
    return first, second - first**2


def assembly():
    model = tc.Assembly("two blocks")
    lower = parts.slider(model, "lower", 6 * N.s, at=(0, 0, -10))
    upper = parts.slider(model, "upper", 6 * N.s)
    model.contact("seat", moving=upper.face("-z"), reference=lower.face("+z"), points=9, within=10)
    model.measure("height", upper.point(5, 5, 0), along="z")
    return model


def answers():
    height = an.values(an.simulated(assembly(), 40_000), "height")
    return an.Answers([an.mean(height), an.variance(height)], len(height))
