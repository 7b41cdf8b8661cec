"""The least friction that holds a block on an incline."""

import numpy as np
from scipy.spatial.transform import Rotation

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.friction import least_coefficient
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return (np.tan(np.radians(N.angle)),)


def check():
    angle = np.radians(N.angle)
    weight = N.weight * np.array([np.sin(angle), -np.cos(angle)])
    return (least_coefficient([((-N.half, 0), (0, 1)), ((N.half, 0), (0, 1))], [((0, N.height), weight)]),)


def assembly():
    turn = Rotation.from_rotvec((0, np.radians(N.angle), 0))  # the x axis points down
    model = tc.Assembly("block on an incline")
    incline = model.part("incline", tc.Box(100, 40, 10), at=turn.apply((0, 0, -10)), rotation=turn.as_rotvec(), fixed=True)
    shape = tc.Box(2 * N.half, 20, 2 * N.height)
    block = model.part("block", shape, at=turn.apply((30, 10, 0)), rotation=turn.as_rotvec())
    stop = tc.Locator("stop", (2 * N.half, 10, 0), "-x", 0.1, one_sided=True)
    sides = [tc.Locator(f"side {x}", (x, 0, N.height), "y", 0.1) for x in (0, N.half)]
    model.locate(block, [stop, *sides], floating=True)
    model.contact("plane", moving=block.face("-z"), reference=incline.face("+z"))
    model.force("weight", at=block.point(N.half, 10, N.height), vector=(0, 0, -N.weight))
    model.measure("place", block.point(0, 0, 0), along=turn.apply((1, 0, 0)))
    return model


def answers():
    return an.Answers([an.critical_friction(assembly(), "block.stop")], 0)
