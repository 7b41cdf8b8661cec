"""The highest of four blocks, above a limit."""

import itertools

import casadi as ca
import numpy as np
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return (-np.expm1(np.sum(np.log1p(-stats.norm.sf(N.below)))),)


def check():
    sd, means = np.array(N.sd), -np.array(N.below) * N.sd

    def density(h):
        z = (h - means) / sd
        others = [np.prod(np.delete(stats.norm.cdf(z), k)) for k in range(len(sd))]
        return stats.norm.pdf(z) / sd @ others

    spans = (0, 0.05, 0.2, 0.6, 2, 8)
    return (sum(integrate.quad(density, a, b, epsabs=0, epsrel=1e-10)[0] for a, b in itertools.pairwise(spans)),)


def assembly():
    model = tc.Assembly("highest of four")
    lifts = [stats.norm(-below * sd, sd) for below, sd in zip(N.below, N.sd, strict=True)]
    blocks = [parts.slider(model, f"block {k}", lift, at=(20.0 * k, 0, 0)) for k, lift in enumerate(lifts)]

    def highest(poses):
        a, b, c, d = (poses.translation(block)[2] for block in blocks)
        return ca.fmax(ca.fmax(a, b), ca.fmax(c, d))

    model.measure("highest", highest, limits=(None, 0.0))
    return model


def answers():
    return an.of_tails(assembly(), "highest outside limits", 40_000)
