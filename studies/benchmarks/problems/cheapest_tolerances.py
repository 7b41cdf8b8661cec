"""The cheapest tolerances of three parts."""

import numpy as np
from scipy import optimize, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
WIDTHS, COSTS = np.array(N.widths), np.array(N.costs)
PPM = 2700


def solution():
    allowed = 6 * N.limit / stats.norm.isf(PPM / 2e6)  # root sum of squares of the tolerances
    best = np.cbrt(COSTS * WIDTHS)
    best *= allowed / np.sqrt((best**2).sum())
    return (COSTS * WIDTHS / best).sum(), *best


def check():
    def outside(logs):
        return 2 * stats.norm.sf(N.limit, 0, np.sqrt(np.sum((np.exp(logs) * WIDTHS / 6) ** 2)))

    limit = {"type": "ineq", "fun": lambda logs: np.log(PPM / 1e6) - np.log(outside(logs))}
    best = optimize.minimize(
        lambda logs: np.sum(COSTS * np.exp(-logs)), np.full(3, -0.2), constraints=limit, method="SLSQP", options={"ftol": 1e-15}
    ).x
    return np.sum(COSTS * np.exp(-best)), *(np.exp(best) * WIDTHS)


def assembly():
    model = tc.Assembly("cheapest tolerances")
    size = parts.dimensions(model, **{f"part{k + 1}": width for k, width in enumerate(N.widths)})
    model.measure("height", lambda poses: sum(poses.translation(part)[0] for part in size.values()), tolerance=2 * N.limit)
    return model


def answers():
    names = [f"part{k}.S" for k in (1, 2, 3)]
    costs = dict(zip(names, N.costs, strict=True))
    allocation = tc.analyses.allocate(
        assembly(), f"height: ppm {PPM}", costs=costs, samples=32_768, seed=an.SEED, solver="daqp"
    )
    cost = float(allocation.cost.sel(stage="after").sum())
    ranges = allocation.range.sel(stage="after", group=names).values
    # It simulates a search of unknown length, so no number of realizations is stated.
    return an.Answers([an.within(cost, 0.03 * cost), *(an.within(width, 0.12 * width) for width in ranges)], 0)
