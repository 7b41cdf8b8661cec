"""Sobol' indices of the function of Ishigami."""

import casadi as ca
import numpy as np

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    third = N.b**2 * np.pi**8 * (1 / 18 - 1 / 50)
    first = (1 + N.b * np.pi**4 / 5) ** 2 / 2
    second = N.a**2 / 8
    total = first + second + third
    return first / total, second / total, 0.0, (first + third) / total, second / total, third / total


def check():
    nodes, weights = np.polynomial.legendre.leggauss(40)
    x, w = np.pi * nodes, weights / 2
    f = np.sin(x)[:, None, None] + N.a * np.sin(x)[:, None] ** 2 + N.b * np.sin(x)[:, None, None] * x**4

    def variance(values, *axes):
        mean = values
        for _ in axes:
            mean = np.tensordot(w, mean, axes=(0, 0))
        square = values**2
        for _ in axes:
            square = np.tensordot(w, square, axes=(0, 0))
        return float(square - mean**2)

    total = variance(f, 0, 1, 2)
    main_effects = [
        variance(np.tensordot(np.tensordot(f, w, axes=(max(o), 0)), w, axes=(min(o), 0)), 0) for o in ((1, 2), (0, 2), (0, 1))
    ]
    complements = [variance(np.tensordot(f, w, axes=(k, 0)), 0, 1) for k in range(3)]
    return *(v / total for v in main_effects), *(1 - v / total for v in complements)


def assembly():
    model = tc.Assembly("Ishigami")
    zone = tc.Tolerance(2 * np.pi, "uniform")
    size = parts.dimensions(model, x1=zone, x2=zone, x3=zone)

    def f(poses):
        x1, x2, x3 = (poses.translation(part)[0] for part in size.values())
        return ca.sin(x1) + N.a * ca.sin(x2) ** 2 + N.b * x3**4 * ca.sin(x1)

    model.measure("f", f)
    return model


def answers():
    contributions = tc.analyses.contributions(assembly(), samples=16_384, seed=an.SEED, solver="daqp").sel(
        measure="f", state="corrected"
    )
    groups = [f"{name}.S" for name in ("x1", "x2", "x3")]
    indices = [
        an.of_analysis(kind.sel(group=group)) for kind in (contributions["first"], contributions["total"]) for group in groups
    ]
    return an.Answers(indices, int(contributions.by_status.sum()))
