"""The worst case of a one-way clutch, from its formula as a measure of three dimensions."""

import casadi as ca
import numpy as np
from scipy import optimize

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def angle(a, c, e):
    return np.degrees(np.arccos((a + c) / (e - c)))


def solution():
    return angle(N.a + N.da, N.c + N.dc, N.e - N.de), angle(N.a - N.da, N.c - N.dc, N.e + N.de)


def check():
    nominal, reach = np.array([N.a, N.c, N.e]), np.array([N.da, N.dc, N.de])
    starts = np.random.default_rng(1).uniform(-1, 1, (5, 3))

    def extreme(sign):
        return min(
            optimize.minimize(lambda u: sign * angle(*(nominal + reach * u)), start, bounds=[(-1, 1)] * 3).fun
            for start in starts
        )

    return extreme(1), -extreme(-1)


def assembly():
    model = tc.Assembly("clutch")
    size = parts.dimensions(model, a=2 * N.da, c=2 * N.dc, e=2 * N.de)

    def phi(poses):
        a, c, e = (nominal + poses.translation(size[name])[0] for name, nominal in (("a", N.a), ("c", N.c), ("e", N.e)))
        return ca.acos((a + c) / (e - c)) * 180 / ca.pi

    model.measure("angle", phi, units="degree")
    return model


def answers():
    extremes = tc.analyses.worst_case(assembly(), solver="daqp")
    ends = extremes.worst.sel(measure="angle", state="corrected").values
    return an.Answers([an.within(end, 1e-6) for end in ends], int(extremes.by_status.sum()))
