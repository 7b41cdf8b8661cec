"""A male part in a pocket whose faces are off and askew."""

import numpy as np
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
CLEARANCE = N.pocket - N.male


def solution():
    # At either end the gap has variance 2 (t/6)² + 2 (arm t/30)², and with arm = 5 both ends are independent.
    s = np.sqrt(2) * np.hypot(N.t / 6, N.arm * N.t / 30)
    fits = stats.norm.cdf(CLEARANCE / s) ** 2
    return 1 - fits, CLEARANCE - s / np.sqrt(np.pi), s * np.sqrt(1 - 1 / np.pi)


def check():
    offset, tilt = stats.norm(CLEARANCE, np.sqrt(2) * N.t / 6), np.sqrt(2) * N.arm * N.t / 30
    # gap = offset - |tilt|: condition on the tilt, which is folded normal.
    folded = stats.halfnorm(scale=tilt)

    def over_tilts(f):
        return integrate.quad(lambda a: folded.pdf(a) * f(a), 0, 12 * tilt, epsabs=1e-14, epsrel=1e-12)[0]

    mean = over_tilts(lambda a: offset.mean() - a)
    second = over_tilts(lambda a: (offset.mean() - a) ** 2 + offset.var())
    return over_tilts(offset.cdf), mean, np.sqrt(second - mean**2)


def assembly():
    model = tc.Assembly("rectangular pocket")
    male, pocket = (
        parts.leaning_wall(model, name, x, off=N.t, tilt=N.t / 5, arm=N.arm)
        for name, x in (("male", N.male), ("pocket", N.pocket))
    )
    for k, y in enumerate((0, 2 * N.arm)):
        model.measure(f"gap {k}", male.point(0, y, N.arm), to=pocket.point(0, y, N.arm), along="x")
    model.measure("gap", tc.Minimum("gap 0", "gap 1"), limits=(0, None))
    return model


def answers():
    gap = an.values(an.simulated(assembly(), 200_000), "gap")
    return an.Answers([an.share(gap < 0), an.mean(gap), an.deviation(gap)], len(gap))
