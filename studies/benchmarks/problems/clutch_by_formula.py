"""A one-way clutch by its formula."""

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
    a, c, e = np.meshgrid(N.a + N.da / 3 * z, N.c + N.dc / 3 * z, N.e + N.de / 3 * z, indexing="ij")
    weights = w[:, None, None] * w[:, None] * w
    phi = np.degrees(np.arccos((a + c) / (e - c)))
    mean = (weights * phi).sum()
    moments = [(weights * (phi - mean) ** k).sum() for k in (2, 3)]
    # The angle is below the limit where a is above (e - c) cos(limit) - c.
    above = stats.norm.sf(((e - c) * np.cos(np.radians(N.limit)) - c)[0], N.a, N.da / 3)
    return mean, np.sqrt(moments[0]), moments[1] / moments[0] ** 1.5, (w[:, None] * w * above).sum()


def check():
    covariance = np.array([[N.da**2 + N.dc**2, -(N.dc**2)], [-(N.dc**2), N.de**2 + N.dc**2]]) / 9
    root = np.linalg.cholesky(covariance)
    z = np.linspace(-8, 8, 2001)
    weight = stats.norm.pdf(z) * (z[1] - z[0])
    weights = weight[:, None] * weight
    over = N.a + N.c + root[0, 0] * z[:, None]
    under = N.e - N.c + root[1, 0] * z[:, None] + root[1, 1] * z
    phi = np.arctan2(np.sqrt(under**2 - over**2), over) * 180 / np.pi
    mean = (weights * phi).sum()
    deviation = np.sqrt((weights * (phi - mean) ** 2).sum())
    # For given over, the angle is below the limit where under is below over / cos(limit).
    bound = over[:, 0] / np.cos(np.radians(N.limit))
    below = stats.norm.cdf((bound - (N.e - N.c) - root[1, 0] * z) / root[1, 1])
    return mean, deviation, (weights * (phi - mean) ** 3).sum() / deviation**3, weight @ below


def assembly():
    model = tc.Assembly("clutch")
    size = parts.dimensions(model, a=2 * N.da, c=2 * N.dc, e=2 * N.de)

    def phi(poses):
        a, c, e = (nominal + poses.translation(size[name])[0] for name, nominal in (("a", N.a), ("c", N.c), ("e", N.e)))
        return ca.acos((a + c) / (e - c)) * 180 / ca.pi

    model.measure("angle", phi, units="degree", limits=(N.limit, None))
    return model


def answers():
    phi = an.values(an.simulated(assembly(), 400_000), "angle")
    return an.Answers([an.mean(phi), an.deviation(phi), an.skewness(phi), an.share(phi < N.limit)], len(phi))
