"""The least friction of three supports that holds a clamped block."""

import numpy as np

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.friction import least_coefficient
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    angles = np.radians(N.angles)
    return tuple(N.clamp * np.sin(angles) / (N.weight + N.clamp * np.cos(angles)))


def check():
    supports = [((x, y, 0), (0, 0, 1)) for x, y in ((10, 10), (90, 10), (50, 50))]

    def coefficient(angle):
        aside = np.sin(angle) * np.sqrt(0.5)
        clamp = -N.clamp * np.array([aside, aside, np.cos(angle)])
        return least_coefficient(supports, [((50, 30, 10), (0, 0, -N.weight)), ((50, 30, 20), clamp)])

    return tuple(map(coefficient, np.radians(N.angles)))


def assembly(degrees=45):
    angle, aside = np.radians(degrees), np.array([1, 1, 0]) * np.sqrt(0.5)
    model = tc.Assembly("clamped block")
    block = model.part("block", tc.Box(100, 60, 20))
    points = [(10, 10, 0), (90, 10, 0), (50, 50, 0)]
    supports = [tc.Locator(f"support {k}", point, "z", 0.1, one_sided=True) for k, point in enumerate(points)]
    sides = [tc.Locator(f"side {x}", (x, 30, 10), (1, -1, 0), 0.1) for x in (20, 80)]  # across the sideways force
    model.locate(block, [*supports, *sides, tc.Locator("stop", (50, 30, 10), aside, 0.1, one_sided=True)])
    model.force("weight", at=block.point(50, 30, 10), vector=(0, 0, -N.weight))
    clamp = -N.clamp * (np.sin(angle) * aside + np.cos(angle) * np.array([0, 0, 1]))
    model.force("clamp", at=block.point(50, 30, 20), vector=clamp)
    model.measure("place", block.point(0, 0, 0), along="x")
    return model


def answers():
    return an.Answers([an.critical_friction(assembly(angle), "block.stop") for angle in N.angles], 0)
