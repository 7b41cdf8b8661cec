"""A stack of six parts with uniform heights."""

import math

import numpy as np
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
COUNT = 6


def solution():
    y = (N.limit / N.half + COUNT) / 2  # of a sum of variables between 0 and 1
    below = sum((-1) ** k * math.comb(COUNT, k) * (y - k) ** COUNT for k in range(int(y) + 1)) / math.factorial(COUNT)
    return 1 - below, N.half * math.sqrt(COUNT / 3)


def check():
    def characteristic(w):
        return np.sinc(w * N.half / np.pi) ** COUNT

    above = 0.5 - integrate.quad(lambda w: characteristic(w) * np.sin(w * N.limit) / w, 1e-12, 3000, limit=2000)[0] / np.pi
    step = 1e-2
    return above, np.sqrt((2 - 2 * characteristic(step)) / step**2)


def assembly():
    model = tc.Assembly("uniform stack")
    size = parts.dimensions(
        model, **{f"part{k}": tc.Tolerance(distribution=stats.uniform(-N.half, 2 * N.half)) for k in range(COUNT)}
    )
    model.measure("height", lambda poses: sum(poses.translation(part)[0] for part in size.values()), limits=(None, N.limit))
    return model


def answers():
    height = an.values(an.simulated(assembly(), 200_000), "height")
    return an.Answers([an.share(height > N.limit), an.deviation(height)], len(height))
