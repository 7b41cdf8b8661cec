"""The worst case of a block that contact keeps above a table."""

from scipy import optimize

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return max(N.gap - N.db, -N.dt), max(N.gap + N.db, N.dt)


def check():
    # Heights h >= t and h >= gap + b: the least h of all as a linear program; the largest over the two branches.
    limits = [(None, None), (-N.dt, N.dt), (-N.db, N.db)]
    least = optimize.linprog([1, 0, 0], [[-1, 1, 0], [-1, 0, 1]], [0, -N.gap], bounds=limits).fun
    branches = [
        optimize.linprog([-1, 0, 0], A_eq=[row], b_eq=[b], bounds=limits).fun
        for row, b in (([1, -1, 0], 0), ([1, 0, -1], N.gap))
    ]
    return least, -min(branches)


def assembly():
    model = tc.Assembly("worst case above a stop")
    table = parts.slider(model, "table", 2 * N.dt, at=(0, 0, -N.table), size=(60, 40, N.table))
    block = parts.slider(model, "block", 2 * N.db, at=(15, 10, N.gap), size=(30, 20, 15))
    model.contact("seat", moving=block.face("-z"), reference=table.face("+z"), within=2)
    model.measure("height", block.point(15, 10, 0), along="z", absolute=True)
    return model


def answers():
    extremes = tc.analyses.worst_case(assembly(), solver="daqp")
    ends = extremes.worst.sel(measure="height", state="corrected").values
    return an.Answers([an.within(end, 1e-6) for end in ends], int(extremes.by_status.sum()))
