"""A block over a fixed face: its height where it cannot sink in."""

import numpy as np
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return N.s / np.sqrt(2 * np.pi), N.s**2 * (0.5 - 1 / (2 * np.pi)), 0.5


def check():
    moments = [integrate.quad(lambda g, k=k: g**k * stats.norm.pdf(g, 0, N.s), 0, 12 * N.s, epsabs=1e-13)[0] for k in range(3)]
    return moments[1], moments[2] - moments[1] ** 2, 1 - moments[0]


def assembly():
    model = tc.Assembly("block on plane")
    base = model.part("base", tc.Box(10, 10, 10), at=(0, 0, -10), fixed=True)
    block = parts.slider(model, "block", 6 * N.s)
    model.contact("seat", moving=block.face("-z"), reference=base.face("+z"), points=9)
    model.measure("height", block.point(5, 5, 0), along="z")
    return model


def answers():
    results = an.simulated(assembly(), 40_000)
    height, raw = an.values(results, "height"), an.values(results, "height", "raw")
    return an.Answers([an.mean(height), an.variance(height), an.share((raw < 0) & (height > raw))], len(height))
