"""The corner of a plate on three supports."""

import numpy as np
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)
SUPPORTS = np.array([[N.x1, N.y1], [N.x2, N.y2], [N.x3, N.y3]])


def solution():
    weights = np.linalg.solve(np.vstack([SUPPORTS.T, np.ones(3)]), [N.length, N.width, 1])
    sigma = np.sqrt((weights**2).sum()) * N.t / 6
    return sigma, 2 * stats.norm.sf(N.limit / sigma)


def check():
    planes = np.linalg.lstsq(np.column_stack([SUPPORTS, np.ones(3)]), np.eye(3), rcond=None)[0]  # of each support alone
    scales = np.abs(np.array([N.length, N.width, 1]) @ planes) * N.t / 6
    sigma = np.sqrt(np.sum(scales**2))
    density = stats.norm(0, sigma).pdf
    return sigma, 1 - integrate.quad(density, -N.limit, N.limit, epsabs=1e-13)[0]


def assembly():
    model = tc.Assembly("corner")
    plate = model.part("plate", tc.Box(N.length, N.width, 5))
    heights = [tc.Locator(f"A{k}", (x, y, 0), "z", N.t) for k, (x, y) in enumerate(SUPPORTS.tolist())]
    sides = [
        tc.Locator("B1", (10, 0, 2), "y", 0.0),
        tc.Locator("B2", (90, 0, 2), "y", 0.0),
        tc.Locator("C", (0, 30, 2), "x", 0.0),
    ]
    model.locate(plate, [*heights, *sides])
    model.measure("corner", plate.point(N.length, N.width, 0), along="z", tolerance=2 * N.limit)
    return model


def answers():
    corner = an.values(an.simulated(assembly(), 200_000), "corner")
    return an.Answers([an.deviation(corner), an.share(abs(corner) > N.limit)], len(corner))
