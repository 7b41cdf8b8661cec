"""The worst case of a slider crank near its dead centre."""

import itertools

import casadi as ca
import numpy as np
from scipy import optimize

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    far = np.radians(N.t + N.dt)
    least = min(
        (N.r + sign * N.dr) * np.cos(far) + np.sqrt((N.l - N.dl) ** 2 - ((N.r + sign * N.dr) * np.sin(far)) ** 2)
        for sign in (-1, 1)
    )
    return least, N.r + N.dr + N.l + N.dl


def check():
    def place(degrees, r, rod):  # by the law of sines
        turn = np.radians(degrees) + 1e-12
        return rod * np.sin(turn + np.arcsin(r * np.sin(turn) / rod)) / np.sin(turn)

    ends = []
    for r, rod in itertools.product((N.r - N.dr, N.r + N.dr), (N.l - N.dl, N.l + N.dl)):
        for sign in (1, -1):
            low, high = N.t - N.dt, N.t + N.dt
            best = optimize.minimize_scalar(
                lambda x, r=r, rod=rod, sign=sign: sign * place(x, r, rod),
                bounds=(low, high),
                method="bounded",
                options={"xatol": 1e-9},
            )
            ends += [place(best.x, r, rod), place(low, r, rod), place(high, r, rod)]
    return min(ends), max(ends)


def assembly():
    model = tc.Assembly("slider crank")
    size = parts.dimensions(model, r=2 * N.dr, l=2 * N.dl, t=np.radians(2 * N.dt))

    def place(poses):
        moved = {name: poses.translation(part)[0] for name, part in size.items()}
        r, rod, t = N.r + moved["r"], N.l + moved["l"], np.radians(N.t) + moved["t"]
        return r * ca.cos(t) + ca.sqrt(rod**2 - (r * ca.sin(t)) ** 2)

    model.measure("x", place)
    return model


def answers():
    extremes = tc.analyses.worst_case(assembly(), solver="daqp")
    ends = extremes.worst.sel(measure="x", state="corrected").values
    return an.Answers([an.within(end, 1e-6) for end in ends], int(extremes.by_status.sum()))
