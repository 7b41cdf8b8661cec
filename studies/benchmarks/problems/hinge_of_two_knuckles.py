"""A door that sinks onto the first of two knuckles."""

import numpy as np
from scipy import stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    s, q = np.sqrt(2) * N.T / 6, N.T / 4
    x, step = np.linspace(-0.4, 0.4, 8001, retstep=True)

    def ramp(y):  # second antiderivative of the normal density
        return y * stats.norm.cdf(y / s) + s * stats.norm.pdf(y / s)

    def cumulated_ramp(y):
        return (y**2 + s**2) / 2 * stats.norm.cdf(y / s) + s * y / 2 * stats.norm.pdf(y / s)

    density_2 = (stats.norm.cdf((x + q) / s) - stats.norm.cdf((x - q) / s)) / (2 * q)
    below_2 = (ramp(x + q) - ramp(x - q)) / (2 * q)
    density_1 = (ramp(x + 2 * q) - 2 * ramp(x) + ramp(x - 2 * q)) / (2 * q) ** 2
    below_1 = (cumulated_ramp(x + 2 * q) - 2 * cumulated_ramp(x) + cumulated_ramp(x - 2 * q)) / (2 * q) ** 2
    density = (density_1 * below_2 + density_2 * below_1) * step
    mean = x @ density
    variance, third = ((x - mean) ** k @ density for k in (2, 3))
    return mean, np.sqrt(variance), third / variance**1.5


def check():
    nodes, weights = np.polynomial.legendre.leggauss(40)
    shifts, weights = nodes * N.T / 4, weights / 2
    x, w = np.polynomial.legendre.leggauss(400)
    reach = 0.35
    x, w = x * reach, w * reach
    two = (shifts[:, None] + shifts).ravel(), (weights[:, None] * weights).ravel()

    def below(shift, weight):
        return stats.norm.cdf((x[:, None] - shift) / (np.sqrt(2) * N.T / 6)) @ weight

    survival = 1 - below(*two) * below(shifts, weights)  # P(larger one > x)
    # E h^k = (-r)^k + integral of k x^(k-1) P(h > x) from -r on.
    first, second, third = ((-reach) ** k + w @ (k * x ** (k - 1) * survival) for k in (1, 2, 3))
    variance = second - first**2
    return first, np.sqrt(variance), (third - 3 * first * second + 2 * first**3) / variance**1.5


def assembly():
    model = tc.Assembly("hinge", method=tc.Method(resolution="exact", objective="seating"))
    door = model.part("door", tc.Box(10, 20, 200))
    guides = [row for row in parts.sliding((10, 20, 200), "z", 0.0) if row.name != "S"]
    model.locate(door, guides, floating=True)
    model.force("weight", at=door.point(5, 10, 0), vector=(0, 0, -10))
    float_ = stats.uniform(-N.T / 4, N.T / 2)
    for number, floats in ((1, 2), (2, 1)):
        lug = parts.slider(model, f"lug {number}", N.T, at=(0, 12.0 * (number - 1), -10), size=(10, 8, 10))
        model.variable(f"knuckle {number}", N.T, drives={f"lug {number}.S": 1.0})
        for k in range(floats):
            model.variable(f"float {number}{k}", tc.Tolerance(distribution=float_), drives={f"lug {number}.S": 1.0})
        model.contact(f"on lug {number}", moving=door.face("-z"), reference=lug.face("+z"), within=1)
    model.measure("height", door.point(5, 10, 0), along="z")
    return model


def answers():
    height = an.values(an.simulated(assembly(), 20_000), "height")
    return an.Answers([an.mean(height), an.deviation(height), an.skewness(height)], len(height))
