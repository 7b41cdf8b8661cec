"""A plate that slides over a block with chamfers, and never touches it."""

import itertools

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return 0.0, 0.0


def check():
    # The top of the block is the only face that the plate's underside could reach: it is the highest point of the block.
    rng = np.random.default_rng(1)
    corners = np.array(list(itertools.product((-N.plate / 2, N.plate / 2), (-25, 25), (N.gap, N.gap + 3))))
    heights = [
        np.add(Rotation.from_rotvec((0, 0, turn)).apply(corners), (x, y, 0))[:, 2].min()
        for x, y, turn in rng.normal(0, N.t / 6, (2000, 3)) * [1, 1, 1.5 / N.plate]
    ]
    return float(np.mean(np.array(heights) < 0)), float(np.max(np.abs(np.array(heights) - N.gap)))


def assembly():
    model = tc.Assembly("chamfers", method=tc.Method(resolution="exact", objective="all points"))
    edges = ((20, 15, -10), (20, 15, -1), (19, 14, 0))
    points = [(s * x, u * y, z) for x, y, z in edges for s in (-1, 1) for u in (-1, 1)]
    block = model.part("block", tc.Mesh(trimesh.convex.convex_hull(np.array(points, dtype=float))), fixed=True)
    plate = model.part("plate", tc.Box(N.plate, 50, 3), at=(-N.plate / 2, -25, N.gap))
    feet = [tc.Locator(f"Z{k}", point, "z", 0.0) for k, point in enumerate([(0, 0, 0), (N.plate, 0, 0), (0, 50, 0)])]
    sides = [
        tc.Locator("Y0", (0, 0, 0), "y", N.t),
        tc.Locator("Y1", (N.plate, 0, 0), "y", N.t),
        tc.Locator("X", (0, 25, 0), "x", N.t),
    ]
    model.locate(plate, [*feet, *sides])
    model.contact("clearance", moving=plate.face("-z"), reference=block.face(tc.select.Near(plate, 2)))
    model.measure("height", plate.point(N.plate / 2, 25, 0), along="z")
    return model


def answers():
    results = an.simulated(assembly(), 1000)
    touches = results.status.values != tc.Status.UNTOUCHED
    return an.Answers([an.within(touches.mean(), 0), an.within(abs(an.values(results, "height")).max(), 1e-9)], len(touches))
