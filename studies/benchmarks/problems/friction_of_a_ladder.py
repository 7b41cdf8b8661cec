"""The least friction that holds a ladder."""

import numpy as np
from scipy import optimize

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.friction import least_coefficient
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    tan = np.tan(np.radians(N.angle))
    return 1 / (2 * tan), np.sqrt(1 + tan**2) - tan


def check():
    angle = np.radians(N.angle)
    foot, top = (N.length * np.cos(angle), 0.0), (0.0, N.length * np.sin(angle))
    load = [((foot[0] / 2, top[1] / 2), (0, -N.weight))]

    def smooth(mu):  # moment about the foot: the wall's force, equal to friction at the foot, and the weight
        return mu * N.weight * top[1] - N.weight * foot[0] / 2

    rough = least_coefficient([(foot, (0, 1)), (top, (1, 0))], load)
    return optimize.brentq(smooth, 0, 5, xtol=1e-13), rough


def assembly(smooth_wall=True):
    angle = np.radians(N.angle)
    foot, top = N.length * np.cos(angle), N.length * np.sin(angle)
    model = tc.Assembly("ladder")
    # The box is as wide and as high as the ladder, which is its diagonal; the floor ends at a stop.
    ladder = model.part("ladder", tc.Box(foot, 1, top))
    planar = [tc.Locator(f"beside {k}", (x, 0, z), "y", 0.1) for k, (x, z) in enumerate([(foot, 0), (0, top), (0, 0)])]
    floor = tc.Locator("floor", (foot, 0, 0), "z", 0.1, one_sided=True)
    wall = tc.Locator("wall", (0, 0, top), "x", 0.1, one_sided=not smooth_wall)  # two-sided: without friction
    stop = tc.Locator("stop", (foot, 0, 0), "-x", 0.1, one_sided=True)
    model.locate(ladder, [*planar, floor, wall, stop])
    model.force("weight", at=ladder.point(foot / 2, 0, top / 2), vector=(0, 0, -N.weight))
    model.measure("foot", ladder.point(foot, 0, 0), along="x")
    return model


def answers():
    return an.Answers([an.critical_friction(assembly(smooth), "ladder.stop") for smooth in (True, False)], 0)
