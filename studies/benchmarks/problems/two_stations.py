"""Three parts that are joined in one station and measured in the next."""

import numpy as np
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    step = np.sqrt(2) * N.s
    mean, variance = step / np.sqrt(2 * np.pi), step**2 * (0.5 - 1 / (2 * np.pi))
    lever = (N.x3 - N.x2) / (N.x2 - N.x1)
    return mean, variance, lever * mean, N.s**2 * ((1 + lever) ** 2 + lever**2 + 1) + lever**2 * variance


def check():
    # The joint's height h and slope m: h + m x1 = p1 on A, h + m x2 + step = p2 on B; columns are p1, p2 and the step.
    places = np.linalg.solve([[1, N.x1], [1, N.x2]], [[1, 0, 0], [0, 1, -1]])
    flush = -np.array([1, N.x3]) @ places - [0, 0, 1]
    density = stats.norm(0, np.sqrt(2) * N.s).pdf
    first, second = (integrate.quad(lambda g, k=k: g**k * density(g), 0, 12 * N.s, epsabs=1e-15)[0] for k in (1, 2))
    variance = second - first**2
    return first, variance, flush[2] * first, N.s**2 * (flush[0] ** 2 + flush[1] ** 2 + 1) + flush[2] ** 2 * variance


def stops(part):
    places = {"B1": ((20, 0, 5), "y"), "B2": ((40, 0, 5), "y"), "C": ((0, 10, 5), "x")}
    return [tc.Locator(name, part.point(*place), along) for name, (place, along) in places.items()]


def rests(part, left, right):
    places = {"A1": (left, 5, 0), "A2": (left, 15, 0), "A3": (right, 10, 0)}
    return [*(tc.Locator(name, part.point(*place), "z") for name, place in places.items()), *stops(part)]


def assembly():
    line = tc.Assembly("stations", method=tc.Method(objective="all points"))
    a, b = line.part("A", tc.Box(100, 20, 10)), line.part("B", tc.Box(100, 20, 10), at=(60, 0, 10))
    c = line.part("C", tc.Box(40, 20, 10), at=(165, 0, 10))
    weld, check = line.station("weld"), line.station("check")
    weld.locate(a, rests(a, 10, 90), tolerance=0)
    weld.locate(b, rests(b, 50, 90), tolerance=0)
    weld.contact("lap", moving=b.face("-z"), reference=a.face("+z", tc.select.Inside((60, 0, 9), (100, 20, 11))))
    weld.measure("step", a.point(60, 10, 10), to=b.point(0, 10, 0), along="z")
    pins = {"P1": a.point(N.x1, 5, 0), "P2": a.point(N.x1, 15, 0), "P3": b.point(N.x2 - 60, 10, 0)}
    check.locate(weld.join("AB", a, b), [*(tc.Locator(k, p, "z") for k, p in pins.items()), *stops(a)], tolerance=0)
    check.locate(c, rests(c, 5, 35), tolerance=0)
    check.measure("flush", b.point(N.x3 - 60, 10, 10), to=c.point(0, 10, 10), along="z")
    for body, locators in (("weld.A", "A1 A2 A3"), ("weld.B", "A1 A2 A3"), ("check.AB", "P1 P2"), ("check.AB", "P3"),
                           ("check.C", "A1 A2 A3")):  # fmt: skip
        labels = [f"{body}.{locator}" for locator in locators.split()]
        line.variable(f"height of {', '.join(labels)}", 6 * N.s, drives=dict.fromkeys(labels, 1.0))
    return line


def answers():
    results = an.simulated(assembly(), 200_000)
    samples = [an.values(results, name) for name in ("step", "flush")]
    return an.Answers([f(x) for x in samples for f in (an.mean, an.variance)], 200_000)
