"""The piston of a slider crank, by its formula."""

import casadi as ca
import numpy as np
from scipy import stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    z, w = np.polynomial.hermite_e.hermegauss(24)
    w = w / w.sum()
    r, rod, t = (nominal + spread / 3 * z for nominal, spread in ((N.r, N.dr), (N.l, N.dl), (N.t, N.dt)))
    r, rod, t = np.meshgrid(r, rod, np.radians(t), indexing="ij")
    weights = w[:, None, None] * w[:, None] * w
    x = r * np.cos(t) + np.sqrt(rod**2 - (r * np.sin(t)) ** 2)
    mean = (weights * x).sum()
    return mean, np.sqrt((weights * (x - mean) ** 2).sum())


def check():
    nodes, weights = np.polynomial.legendre.leggauss(60)
    z = 8 * nodes
    w = 8 * weights * stats.norm.pdf(z)
    total = square = 0.0
    for zr, wr in zip(z, w, strict=True):
        for zl, wl in zip(z, w, strict=True):
            crank, rod = N.r + N.dr / 3 * zr, N.l + N.dl / 3 * zl
            turn = np.radians(N.t + N.dt / 3 * z)
            lean = np.arcsin(crank * np.sin(turn) / rod)  # of the rod
            x = rod * np.sin(np.pi - turn - lean) / np.sin(turn)  # law of sines
            total += wr * wl * (w @ x)
            square += wr * wl * (w @ (x - N.r - N.l) ** 2)
    return total, np.sqrt(square - (total - N.r - N.l) ** 2)


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
    x = an.values(an.simulated(assembly(), 200_000), "x")
    return an.Answers([an.mean(x), an.deviation(x)], len(x))
