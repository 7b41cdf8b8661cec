"""A stack of forty parts, rarely high."""

import numpy as np
from scipy import integrate, special, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
COUNT = 40


def solution():
    return (special.erfc(N.limit / N.s / np.sqrt(2 * COUNT)) / 2,)


def check():
    total = stats.norm(0, np.sqrt(COUNT * N.s**2))
    return (integrate.quad(total.pdf, N.limit, 3 * N.limit, epsabs=0, epsrel=1e-10)[0],)


def assembly():
    model = tc.Assembly("forty parts")
    size = parts.dimensions(model, **{f"part{k}": 6 * N.s for k in range(COUNT)})
    model.measure("height", lambda poses: sum(poses.translation(part)[0] for part in size.values()), limits=(None, N.limit))
    return model


def answers():
    return an.of_tails(assembly(), "height outside limits", 100_000)
