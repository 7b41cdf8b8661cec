"""A block between two walls of which one varies."""

import numpy as np
from scipy import integrate, special, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return (special.erfc((N.room - N.block) / N.s / np.sqrt(2)) / 2,)


def check():
    wall = stats.norm(N.room, N.s)
    return (integrate.quad(wall.pdf, N.block - 12 * N.s, N.block, epsabs=0, epsrel=1e-11)[0],)


def assembly():
    model = tc.Assembly("block too wide")
    left = model.part("left wall", tc.Box(10, 40, 20), fixed=True)
    right = parts.slider(model, "right wall", 6 * N.s, along="x", at=(10 + N.room, 0, 0), size=(10, 40, 20))
    block = parts.slider(model, "block", 0.0, along="x", at=(10 + (N.room - N.block) / 2, 10, 5), size=(N.block, 20, 10))
    model.contact("left", moving=block.face("-x"), reference=left.face("+x"), within=2)
    model.contact("right", moving=block.face("+x"), reference=right.face("-x"), within=2)
    model.measure("place", block.point(0, 0, 0), along="x")
    return model


def answers():
    return an.of_tails(assembly(), "not assemblable", 30_000)
