"""Two elastic tips that may touch."""

import numpy as np
from scipy import integrate, optimize, stats

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    share = N.k2 / (N.k1 + N.k2) * N.s
    return share / np.sqrt(2 * np.pi), share**2 * (0.5 - 1 / (2 * np.pi))


def check():
    def moved(gap):  # the force that closes the gap moves both tips
        force = optimize.brentq(lambda f: f / N.k1 + f / N.k2 + gap, 0, 100, xtol=1e-14)
        return force / N.k1

    density = stats.norm(0, N.s).pdf
    first, second = (
        integrate.quad(lambda g, k=k: density(g) * moved(g) ** k, -10 * N.s, -1e-12, epsabs=1e-13)[0] for k in (1, 2)
    )
    return first, second - first**2


def tip(model, name, stiffness, height, tolerance):
    """Return a rigid tip that moves along z alone, on a spring: five locators hold it otherwise."""
    part = model.part(name, tc.Box(10, 10, 10), at=(0, 0, height))
    places = {"y1": ((0, 0, 0), "y"), "y2": ((10, 0, 0), "y"), "y3": ((5, 0, 10), "y"), "x1": ((0, 5, 0), "x")}
    places["x2"] = ((0, 5, 10), "x")
    spring = tc.Locator("spring", (5, 5, 0), "z", tolerance, stiffness=float(stiffness))
    model.locate(part, [spring, *(tc.Locator(label, place, along, 0.0) for label, (place, along) in places.items())])
    return part


def assembly():
    model = tc.Assembly("touching tips", method=tc.Method(objective="seating"))
    first = tip(model, "first", N.k1, 10, 0.0)
    second = tip(model, "second", N.k2, 0, 6 * N.s)
    model.contact("tips", moving=first.face("-z"), reference=second.face("+z"))
    model.force("across", at=first.point(10, 5, 5), vector=(1, 0, 0))  # a force is needed; this one moves nothing
    model.measure("moved", first.point(5, 5, 0), along="z")
    return model


def answers():
    moved = an.values(an.simulated(assembly(), 100_000), "moved")
    return an.Answers([an.mean(moved), an.variance(moved)], len(moved))
