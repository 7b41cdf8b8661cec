"""A plate that rests on the tallest of four pads."""

import numpy as np
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    def moment(k):
        return integrate.quad(lambda h: h**k * 4 * stats.norm.pdf(h) * stats.norm.cdf(h) ** 3, -12, 12, epsabs=1e-13)[0]

    return N.s * moment(1), N.s * np.sqrt(moment(2) - moment(1) ** 2)


def check():
    mean = 6 * np.arctan(np.sqrt(2)) / np.pi**1.5
    return N.s * mean, N.s * np.sqrt(1 + np.sqrt(3) / np.pi - mean**2)


def assembly():
    model = tc.Assembly("tallest of four", method=tc.Method(resolution="exact", objective="seating"))
    plate = model.part("plate", tc.Box(100, 60, 5))
    guides = [row for row in parts.sliding((100, 60, 5), "z", 0.0) if row.name != "S"]
    model.locate(plate, guides, floating=True)
    model.force("weight", at=plate.point(50, 30, 0), vector=(0, 0, -10))
    for k, (x, y) in enumerate(((5, 5), (85, 5), (5, 45), (85, 45))):
        pad = model.part(f"pad {k}", tc.Box(10, 10, 20), at=(x, y, -20), fixed=True)
        pad.feature("foot", pad.face("-z"), datum="A")
        top = pad.feature("top", pad.face("+z"), tc.Profile(6 * N.s, "A", rule="translation"))
        model.contact(f"on pad {k}", moving=plate.face("-z"), reference=top, within=2)
    model.measure("height", plate.point(50, 30, 0), along="z")
    return model


def answers():
    height = an.values(an.simulated(assembly(), 20_000), "height")
    return an.Answers([an.mean(height), an.deviation(height)], len(height))
