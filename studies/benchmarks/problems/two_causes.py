"""A block lifted by its own deviation or by the table under it, and how rarely it is too high."""

from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    by_block, by_table = stats.norm.sf(N.limit / N.sv), stats.norm.sf((N.limit + N.low) / N.su)
    return (by_block + by_table - by_block * by_table,)


def check():
    reach = N.limit + N.low
    densities = [lambda u: stats.norm.pdf(u, 0, N.su), lambda v: stats.norm.pdf(v, 0, N.sv)]
    table = integrate.quad(densities[0], reach, reach + 9 * N.su, epsabs=0, epsrel=1e-11)[0]
    block = integrate.quad(densities[1], N.limit, N.limit + 9 * N.sv, epsabs=0, epsrel=1e-11)[0]
    return (1 - (1 - table) * (1 - block),)


def assembly():
    model = tc.Assembly("two causes")
    table = parts.slider(model, "table", 6 * N.su, at=(0, 0, -10 - N.low), size=(100, 50, 10))
    block = parts.slider(model, "block", 6 * N.sv, at=(25, 12.5, 0), size=(50, 25, 10))
    model.contact("under", moving=block.face("-z"), reference=table.face("+z"), points=12, within=10)
    model.measure("height", block.point(25, 12.5, 0), along="z", limits=(None, N.limit))
    return model


def answers():
    return an.of_tails(assembly(), "height outside limits", 40_000, resolution="linearized", objective="all points")
