"""The mean derivative of a height through contact."""

from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return 1.0, stats.norm.cdf(N.m / N.s)


def check():
    def mean(m, low):
        return integrate.quad(lambda v: v * stats.norm.pdf(v, m, N.s), low, m + 12 * N.s, epsabs=1e-14, epsrel=1e-13)[0]

    step = 1e-4
    return tuple(
        (mean(N.m + step, low(step)) - mean(N.m - step, low(-step))) / (2 * step)
        for low in (lambda d: N.m + d - 12 * N.s, lambda d: 0)
    )


def assembly():
    model = tc.Assembly("derivative through contact")
    base = model.part("base", tc.Box(30, 20, 10), at=(0, 0, -10), fixed=True)
    block = parts.slider(model, "block", 0.0, size=(30, 20, 10))
    cause = tc.Tolerance(6 * N.s, shift=N.m)
    model.variable("v", cause, drives={"block.S": 1.0})
    model.contact("seat", moving=block.face("-z"), reference=base.face("+z"), points=12)
    model.measure("height", block.point(15, 10, 0), along="z")
    return model


def answers():
    sensitivities = tc.analyses.sensitivities(assembly(), samples=10_000, seed=an.SEED, solver="daqp").sel(
        measure="height", contributor="v"
    )
    raw, corrected = (an.of_analysis(sensitivities.sensitivity.sel(state=state)) for state in ("raw", "corrected"))
    return an.Answers([an.within(raw.value, 1e-6), corrected], int(sensitivities.by_status.sum()))
