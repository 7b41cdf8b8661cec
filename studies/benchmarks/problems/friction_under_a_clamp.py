"""The friction at which a clamped block does not slide to its stop."""

import numpy as np

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.friction import least_coefficient
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    angle = np.radians(N.angle)
    return (N.clamp * np.sin(angle) / (N.weight + N.clamp * np.cos(angle)),)


def check():
    angle = np.radians(N.angle)
    clamp = -N.clamp * np.array([np.sin(angle), np.cos(angle)])
    return (least_coefficient([((10, 0), (0, 1)), ((90, 0), (0, 1))], [((50, 20), (0, -N.weight)), ((60, 40), clamp)]),)


def assembly():
    angle = np.radians(N.angle)
    model = tc.Assembly("block under a clamp")
    table = model.part("table", tc.Box(110, 60, 6), at=(0, 0, -6), fixed=True)
    block = model.part("block", tc.Box(80, 40, 40), at=(10, 10, 0))
    stop = tc.Locator("stop", (0, 20, 20), "x", 0.1, one_sided=True)
    sides = [tc.Locator(f"side {x}", (x, 0, 20), "y", 0.1) for x in (0, 80)]
    model.locate(block, [stop, *sides], floating=True)
    model.contact("seat", moving=block.face("-z"), reference=table.face("+z"))
    model.force("weight", at=block.point(40, 20, 20), vector=(0, 0, -N.weight))
    model.force("clamp", at=block.point(50, 20, 40), vector=(-N.clamp * np.sin(angle), 0, -N.clamp * np.cos(angle)))
    model.measure("place", block.point(0, 0, 0), along="x")
    return model


def answers():
    return an.Answers([an.critical_friction(assembly(), "block.stop")], 0)
