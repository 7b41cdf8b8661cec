"""An elastic sheet whose corners lie on four supports."""

import numpy as np
from scipy import stats

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.beams import condensed
from studies.benchmarks.plates import elastic_file, nodes_at, plate_stiffness
from studies.benchmarks.problem import numbers

N = numbers(__file__)
CORNERS = [(0, 0), (N.side, 0), (N.side, N.side), (0, N.side)]
MIDDLE = (N.side / 2, N.side / 2)


def solution():
    slope = 2 * N.E * N.h**3 / 12 / (1 - N.nu**2) * (1 - N.nu) / N.side**2
    return N.F / 4 - slope * N.c, 2 * stats.norm.sf(N.F / 4 / slope / (2 * N.s))


def at_supports():
    """Return places and stiffness of the corners and the middle."""
    grid, stiffness = plate_stiffness(N.side, N.h, N.E, N.nu)
    chosen = nodes_at(grid, [*CORNERS, MIDDLE])
    return grid[chosen], condensed(stiffness, chosen)


def check():
    _, K = at_supports()
    free = K[:4, :4] - np.outer(K[:4, 4], K[4, :4]) / K[4, 4]  # the middle moves freely under its force
    pressed = K[:4, 4] / K[4, 4] * -N.F

    def reactions(heights):
        return free @ heights + pressed

    low = reactions(np.array([0, -N.c, 0, 0]))[1]
    level, lowered = (reactions(w * np.array([1, -1, 1, -1]) / 4)[0] for w in (0.0, -1.0))
    # Gaussian quadrature over the twists, on either side of the one at which a corner has no force.
    lost, nodes, weights = level / (level - lowered), *np.polynomial.legendre.leggauss(60)
    twists = lost + 20 * N.s * (nodes + 1) / 2
    return low, 2 * 10 * N.s * weights @ np.exp(-((twists / N.s) ** 2) / 8) / np.sqrt(8 * np.pi) / N.s


def assembly(tolerance=6 * N.s, low=0.0):
    """Return the sheet; the second support is `low` [mm]."""
    model = tc.Assembly("sheet on four corners", method=tc.Method(objective="seating"))
    sheet = model.part("sheet", tc.Box(N.side, N.side, N.h))
    sheet.elastic(**elastic_file("sheet on four corners", *at_supports()))
    corners = [
        tc.Locator(f"corner {k}", (*place, 0), "z", tc.Tolerance(tolerance, shift=-low if k == 1 else 0.0), one_sided=True)
        for k, place in enumerate(CORNERS)
    ]
    sides = [tc.Locator(f"side {k}", (*CORNERS[k], 0), "y", 0.0) for k in (0, 1)]
    model.locate(sheet, [*corners, *sides, tc.Locator("end", (*CORNERS[0], 0), "x", 0.0)])
    model.force("press", at=sheet.point(*MIDDLE, 0), vector=(0, 0, -N.F))
    model.measure("middle", sheet.point(*MIDDLE, 0), along="z")
    return model


def answers():
    lowered = an.simulated(assembly(0.0, N.c), 2, keep="all")
    force = lowered["elastic"].reaction_at_load.values[0, 1]
    carrying = an.simulated(assembly(), 20_000).carrying.values[:, 0]
    return an.Answers([an.within(force, 1e-5), an.share(carrying < 4)], len(carrying))
