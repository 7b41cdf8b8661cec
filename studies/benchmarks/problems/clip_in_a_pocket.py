"""The gap of a clip over three parts in a pocket."""

import numpy as np
from scipy import integrate, optimize, stats

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)
LINKS = {
    "pocket": (1, N.pocket, N.th),
    "plate": (-1, N.plate, N.tp),
    "spacer": (-1, N.spacer, N.ts),
    "cap": (-1, N.cap, N.tcap),
}
SIGNS, NOMINAL, HALVES = np.array(list(LINKS.values())).T


def solution():
    return stats.norm.cdf((N.limit - SIGNS @ NOMINAL) / (np.linalg.norm(HALVES) / 3)), SIGNS @ NOMINAL - HALVES.sum()


def check():
    def characteristic(w):  # of the gap less its limit
        return np.prod(np.exp(1j * w * SIGNS * NOMINAL - (w * HALVES / 3) ** 2 / 2)) * np.exp(-1j * w * N.limit)

    above = 0.5 + integrate.quad(lambda w: characteristic(w).imag / w, 1e-12, 200, limit=400)[0] / np.pi
    return 1 - above, optimize.linprog(SIGNS, bounds=np.column_stack([NOMINAL - HALVES, NOMINAL + HALVES])).fun


def assembly():
    stack = tc.Stack("clip in a pocket")
    for name, (sign, nominal, half) in LINKS.items():
        stack.link(name, nominal, (-half, half), sensitivity=sign)
    stack.gap("gap", limits=(N.limit, None))
    return stack


def answers():
    gap = an.values(an.simulated(assembly(), 200_000), "gap")
    figures = tc.analyses.stack_up(assembly(), samples=3000, solver="daqp").sel(measure="gap", approach="worst case")
    return an.Answers([an.share(gap < N.limit), an.within(figures.centred - figures.half_width, 1e-9)], len(gap))
