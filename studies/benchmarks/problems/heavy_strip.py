"""A heavy strip that loses its table."""

import numpy as np
from scipy import integrate

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)
BENDING = N.E * N.width * N.h**3 / 12
LENGTH, GRAVITY = 240.0, 9.81


def solution():
    length = (24 * BENDING * N.H / N.q) ** 0.25
    return length, N.q * length / 2


def check():
    def slopes(x, y, p):  # x from 0 to 1 times the unknown length
        return np.vstack([p[0] * y[1], p[0] * y[2], p[0] * y[3], np.full_like(x, -p[0] * N.q / BENDING)])

    def ends(left, right, p):  # flat, without moment, on the table; lifted, without moment, at the end
        return np.array([left[0], left[1], left[2], right[0] - N.H, right[2]])

    x = np.linspace(0, 1, 50)
    start = np.vstack([N.H * x**3, 3 * N.H * x**2 / 150, 6 * N.H * x / 150**2, np.full_like(x, 6 * N.H / 150**3)])
    solution_on_length = integrate.solve_bvp(slopes, ends, x, start, p=[150.0], tol=1e-10)
    return solution_on_length.p[0], -BENDING * solution_on_length.y[3, -1]


def assembly():
    """Return the strip, 240 mm of it, as a solid without Poisson's ratio on a table whose contact points are 6 mm apart."""
    model = tc.Assembly("heavy strip", method=tc.Method(objective="seating"))
    table = model.part("table", tc.Box(LENGTH, N.width, 10), at=(0, 0, -10), fixed=True)
    strip = model.part("strip", tc.Box(LENGTH, N.width, N.h))
    strip.elastic(E=N.E, nu=0.0, density=N.q / (N.width * N.h) / GRAVITY * 1e9)
    model.gravity((0, 0, -GRAVITY))
    lift = [tc.Locator(f"lift {k}", (LENGTH, y, 0), "z", tc.Tolerance(0.0, shift=N.H)) for k, y in enumerate((5, 15))]
    sides = [tc.Locator(f"side {k}", (x, 0, 0), "y", 0.0) for k, x in enumerate((0, LENGTH))]
    model.locate(strip, [*lift, *sides, tc.Locator("end", (0, N.width / 2, 0), "x", 0.0)], floating=True)
    model.contact("table", moving=strip.face("-z"), reference=table.face("+z"), spacing=6)
    model.measure("end", strip.point(LENGTH, N.width / 2, 0), along="z")
    return model


def answers():
    """Return the length, which a free strip of this weight needs for the force that lifts it, and the force."""
    force = an.simulated(assembly(), 2).reaction.sel(pair=["strip.lift 0", "strip.lift 1"]).values[0].sum()
    return an.Answers([an.within(2 * force / N.q, 0.18), an.within(force, 1.4e-3)], 2)
