"""The friction from which on a drawer jams."""

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.friction import least_coefficient
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return (N.length / (2 * N.off),)


def check():
    # The push turns the drawer against the guides at opposite corners.
    x, y = N.length / 2, N.width / 2
    contacts = ([((-x, -y), (0, 1)), ((x, y), (0, -1))], [((x, -y), (0, 1)), ((-x, y), (0, -1))])
    return (min(least_coefficient(pair, [((0, N.off), (N.push, 0))]) for pair in contacts),)


def assembly():
    x, y = N.length / 2, N.width / 2
    model = tc.Assembly("drawer")
    drawer = model.part("drawer", tc.Box(N.length, N.width, 10), at=(-x, -y, 0))
    floor = [tc.Locator(f"floor {k}", (a, b, 0), "z", 0.1) for k, (a, b) in enumerate([(0, 0), (2 * x, 0), (x, 2 * y)])]
    corners = [((2 * x, 0, 0), "y"), ((0, 2 * y, 0), "-y")]  # against which the push turns the drawer
    guides = [tc.Locator(f"guide {k}", point, into, 0.1, one_sided=True) for k, (point, into) in enumerate(corners)]
    model.locate(drawer, [*floor, *guides, tc.Locator("end", (2 * x, y, 0), "-x", 0.1, one_sided=True)])
    model.force("push", at=drawer.point(0, y + N.off, 0), vector=(N.push, 0, 0))
    model.measure("place", drawer.point(0, 0, 0), along="x")
    return model


def answers():
    return an.Answers([an.critical_friction(assembly(), "drawer.end")], 0)
