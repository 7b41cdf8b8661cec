"""A rigid beam on three pegs."""

import numpy as np
from scipy import stats

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)
ENDS = np.array([0.5 - N.e, 0, 0.5 + N.e])  # height under the weight if both ends carry: weights of the pegs
BENT = np.array([0, 1 - 2 * N.e, 2 * N.e])  # if the middle and the third peg carry


def solution():
    a = np.sqrt(((ENDS - BENT) ** 2).sum())
    mean = a / np.sqrt(2 * np.pi)  # Clark: both have the mean 0
    second = ((ENDS**2).sum() + (BENT**2).sum()) / 2
    return N.s * mean, N.s * np.sqrt(second - mean**2)


def check():
    # The middle peg's height over the line through the ends, c = z2 - (z1 + z3) / 2, lifts the weight's point by (1 - 2 e) c.
    lift = np.array([-0.5, 1, -0.5])
    x, step = np.linspace(-9, 9, 20_001, retstep=True)
    weight = stats.norm.pdf(x) * step
    c = np.sqrt(lift @ lift) * x
    slope = ENDS @ lift / (lift @ lift)  # regression of the line on c
    residual_variance = ENDS @ ENDS - slope**2 * (lift @ lift)
    height = slope * c + (1 - 2 * N.e) * np.maximum(c, 0)
    mean = weight @ height
    return N.s * mean, N.s * np.sqrt(weight @ height**2 - mean**2 + residual_variance)


def assembly():
    model = tc.Assembly("beam", method=tc.Method(resolution="exact", objective="seating"))
    beam = model.part("beam", tc.Box(100, 10, 5))
    pegs = [tc.Locator(f"peg {k}", (x, 5, 0), "z", 6 * N.s, one_sided=True) for k, x in enumerate((0, 50, 100))]
    guides = [
        tc.Locator("B1", (0, 0, 0), "y", 0.0), tc.Locator("B2", (100, 0, 0), "y", 0.0), tc.Locator("B3", (0, 0, 5), "y", 0.0),
        tc.Locator("C", (50, 5, 0), "x", 0.0),
    ]  # fmt: skip
    model.locate(beam, [*pegs, *guides])
    place = beam.point(50 + 100 * N.e, 5, 0)
    model.force("weight", at=place, vector=(0, 0, -10))
    model.measure("height", place, along="z")
    return model


def answers():
    height = an.values(an.simulated(assembly(), 20_000), "height")
    return an.Answers([an.mean(height), an.deviation(height)], len(height))
