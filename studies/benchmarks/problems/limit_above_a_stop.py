"""The rare height of a block above its stop."""

from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return (stats.norm.sf(N.limit / N.s),)


def check():
    return (integrate.quad(lambda g: stats.norm.pdf(g, 0, N.s), N.limit, N.limit + 12 * N.s, epsabs=0, epsrel=1e-11)[0],)


def assembly():
    model = tc.Assembly("limit above a stop")
    base = model.part("base", tc.Box(30, 20, 10), at=(0, 0, -10), fixed=True)
    block = parts.slider(model, "block", 6 * N.s, size=(30, 20, 10))
    model.contact("seat", moving=block.face("-z"), reference=base.face("+z"), points=12)
    model.measure("height", block.point(15, 10, 0), along="z", limits=(0, N.limit))
    return model


def answers():
    return an.of_tails(assembly(), "height outside limits", 30_000)
