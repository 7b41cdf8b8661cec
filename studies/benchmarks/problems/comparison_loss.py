"""The comparison loss of JCGM 101, whose sensitivities are 0 at the nominal values."""

import numpy as np
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return 2 * N.s**2, np.exp(-N.limit / (2 * N.s**2))


def check():
    r = np.sqrt(N.limit)

    def beyond(x):
        return 2 * stats.norm.sf(np.sqrt(N.limit - x**2), 0, N.s) * stats.norm.pdf(x, 0, N.s)

    inside = integrate.quad(lambda angle: beyond(r * np.sin(angle)) * r * np.cos(angle), -np.pi / 2, np.pi / 2, epsabs=1e-18)[0]
    mean = 2 * integrate.quad(lambda x: x**2 * stats.norm.pdf(x, 0, N.s), -10 * N.s, 10 * N.s, epsabs=1e-16)[0]
    return mean, inside + 2 * stats.norm.sf(r, 0, N.s)


def assembly():
    model = tc.Assembly("comparison loss")
    size = parts.dimensions(model, x1=6 * N.s, x2=6 * N.s)

    def loss(poses):
        return sum(poses.translation(part)[0] ** 2 for part in size.values())

    model.measure("loss", loss, limits=(None, N.limit), units="1")
    return model


def answers():
    tail = an.of_tails(assembly(), "loss outside limits", 40_000)
    loss = an.values(an.simulated(assembly(), 200_000), "loss")
    return an.Answers([an.mean(loss), *tail.estimates], len(loss) + tail.realizations)
