"""A one-way clutch as parts in contact: the model is models/clutch.py."""

import importlib

import numpy as np
from scipy import stats

from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    z, w = np.polynomial.hermite_e.hermegauss(24)
    w = w / w.sum()
    a, c, e = np.meshgrid(N.a + N.da / 3 * z, N.c + N.dc / 3 * z, N.e + N.de / 3 * z, indexing="ij")
    weights = w[:, None, None] * w[:, None] * w
    phi = np.degrees(np.arccos((a + c) / (e - c)))
    mean = (weights * phi).sum()
    return mean, np.sqrt((weights * (phi - mean) ** 2).sum()), 0.0


def check():
    covariance = np.array([[N.da**2 + N.dc**2, -(N.dc**2)], [-(N.dc**2), N.de**2 + N.dc**2]]) / 9
    root = np.linalg.cholesky(covariance)
    z = np.linspace(-8, 8, 1001)
    weight = stats.norm.pdf(z) * (z[1] - z[0])
    weights = weight[:, None] * weight
    over = N.a + N.c + root[0, 0] * z[:, None]
    under = N.e - N.c + root[1, 0] * z[:, None] + root[1, 1] * z
    phi = np.arctan2(np.sqrt(under**2 - over**2), over) * 180 / np.pi
    mean = (weights * phi).sum()
    return mean, np.sqrt((weights * (phi - mean) ** 2).sum()), 0.0


def assembly():
    return importlib.import_module("models.clutch").assembly()


def answers():
    results = an.simulated(assembly(), 10_000, keep="all")
    phi, deviations = an.values(results, "angle"), results["sample"].deviation
    a = N.a + deviations.sel(contributor="hub.flat.offset").values
    c, e = (
        nominal + deviations.sel(contributor=label).values / 2
        for nominal, label in ((N.c, "roller.barrel.size"), (N.e, "ring.bore.size"))
    )
    difference = np.abs(phi - np.degrees(np.arccos((a + c) / (e - c)))).max()
    return an.Answers([an.mean(phi), an.deviation(phi), an.within(difference, 1e-5)], len(phi))
