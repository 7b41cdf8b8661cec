"""Sensitivities of a one-way clutch."""

import casadi as ca
import numpy as np

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def shares(slopes):
    parts_of_variance = (np.array(slopes) * [N.da, N.dc, N.de]) ** 2
    return parts_of_variance / parts_of_variance.sum()


def solution():
    over, under = N.a + N.c, N.e - N.c
    root = np.sqrt(under**2 - over**2)
    slopes = np.degrees([-1 / root, -(1 + over / under) / root, over / under / root])
    return *slopes, *shares(slopes)


def check():
    step = 1e-30
    slopes = []
    for k in range(3):
        a, c, e = np.array([N.a, N.c, N.e]) + 1j * step * np.eye(3)[k]
        half = np.arctan(np.sqrt((e - 2 * c - a) / (e + a)))  # of the angle
        slopes.append(np.degrees(2 * half.imag / step))
    variances = [(slope * reach / 3) ** 2 for slope, reach in zip(slopes, (N.da, N.dc, N.de), strict=True)]
    return *slopes, *(variance / sum(variances) for variance in variances)


def assembly():
    model = tc.Assembly("clutch")
    size = parts.dimensions(model, a=2 * N.da, c=2 * N.dc, e=2 * N.de)

    def phi(poses):
        a, c, e = (nominal + poses.translation(size[name])[0] for name, nominal in (("a", N.a), ("c", N.c), ("e", N.e)))
        return ca.acos((a + c) / (e - c)) * 180 / ca.pi

    model.measure("angle", phi, units="degree")
    return model


def answers():
    labels = ["a.S", "c.S", "e.S"]
    slopes = tc.analyses.sensitivities(assembly(), samples=100, solver="daqp").sel(measure="angle")
    linear = tc.analyses.contributions(assembly(), samples=256, solver="daqp").sel(measure="angle")
    values = [*slopes.nominal.sel(contributor=labels).values, *linear.linear.sel(group=labels).values]
    return an.Answers([an.within(value, 1e-5) for value in values], int(slopes.by_status.sum() + linear.by_status.sum()))
