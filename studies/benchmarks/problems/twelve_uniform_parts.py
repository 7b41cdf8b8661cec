"""A stack of twelve uniform parts, rarely high."""

import math

import numpy as np

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
COUNT = 12


def solution():
    y = COUNT - (N.limit / N.half + COUNT) / 2  # missing to the largest sum, of variables between 0 and 1
    return (sum((-1) ** k * math.comb(COUNT, k) * (y - k) ** COUNT for k in range(int(y) + 1)) / math.factorial(COUNT),)


def check():
    # Densities of sums as polynomials on the spans between whole numbers, integrated span by span.
    pieces = [np.polynomial.Polynomial([1.0])]
    for _ in range(COUNT - 1):
        integrals = [piece.integ(lbnd=0) for piece in pieces]  # in the local place t of a span
        rise = [*list(integrals), np.polynomial.Polynomial([0.0])]
        fall = [np.polynomial.Polynomial([0.0])] + [integral(1) - integral for integral in integrals]
        pieces = [a + b for a, b in zip(rise, fall, strict=True)]
    y = COUNT - (N.limit / N.half + COUNT) / 2
    whole = int(y)
    return (sum(pieces[k].integ(lbnd=0)(1) for k in range(whole)) + pieces[whole].integ(lbnd=0)(y - whole),)


def assembly():
    model = tc.Assembly("twelve uniform parts")
    zone = tc.Tolerance(2 * N.half, "uniform")
    size = parts.dimensions(model, **{f"part{k}": zone for k in range(COUNT)})
    model.measure("height", lambda poses: sum(poses.translation(part)[0] for part in size.values()), limits=(None, N.limit))
    return model


def answers():
    return an.of_tails(assembly(), "height outside limits", 200_000)
