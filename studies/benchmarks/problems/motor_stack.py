"""The end play of a motor, by Drake."""

import numpy as np
from scipy import optimize

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)
LINKS = np.array(N.links)


def modified(worst, rss):
    return rss * (1 + 0.5 * (worst - rss) / (rss * (np.sqrt(len(LINKS)) - 1)))


def solution():
    signs, nominal, upper, lower = LINKS.T
    halves = (upper - lower) / 2
    worst, rss = halves.sum(), np.sqrt((halves**2).sum())
    return signs @ (nominal + (upper + lower) / 2), worst, rss, modified(worst, rss)


def check():
    signs, nominal, upper, lower = LINKS.T
    bounds = np.column_stack([nominal + lower, nominal + upper])
    least, most = (sense * optimize.linprog(sense * signs, bounds=bounds).fun for sense in (1, -1))
    z, w = np.polynomial.hermite_e.hermegauss(4)
    w = w / w.sum()
    moments = np.zeros(2)  # mean and variance of the sum of the links so far, all normal with six sigma in their limits
    for sign, (low, high) in zip(signs, bounds, strict=True):
        x = sign * ((low + high) / 2 + (high - low) / 6 * z)
        moments += w @ x, w @ (x - w @ x) ** 2
    worst, rss = (most - least) / 2, 3 * np.sqrt(moments[1])
    return moments[0], worst, rss, modified(worst, rss)


def assembly():
    stack = tc.Stack("motor stack", units="in")
    for name, (sign, nominal, upper, lower) in zip("ABCDEFGHIJK", N.links, strict=True):
        stack.link(name, nominal, (lower, upper), sensitivity=sign)
    stack.gap("play")
    return stack


def answers():
    figures = tc.analyses.stack_up(assembly(), samples=3000, solver="daqp").sel(measure="play")
    halves = figures.half_width.sel(approach=["worst case", "RSS", "MRSS"]).values
    return an.Answers([an.within(value, 1e-6) for value in (np.round([figures.centred, *halves], 4))], 3000)
