"""A shaft that a force tilts in the bores of two walls."""

import numpy as np
import trimesh
from scipy import optimize

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    # The shaft touches the far bore above, at z1, and the near one below, at 0: z1 sin a + d = b cos a.
    length = np.hypot(N.z1, N.b)
    angle = np.arctan2(N.b, N.z1) - np.arcsin(N.d / length)
    return (-N.b / 2 + N.d / 2 / np.cos(angle) + N.force * np.tan(angle),)


def check():
    # All sections of a tilted cylinder by planes z = constant are ellipses; their tops and bottoms stay in the bores.
    walls = np.array([0.0, N.wall, N.z0, N.z1])

    def room(pose):
        off, slope = pose
        half = N.d / 2 * np.sqrt(1 + slope**2)
        axis = off + slope * walls
        return np.concatenate([N.b / 2 - axis - half, N.b / 2 + axis - half])

    best = optimize.minimize(
        lambda pose: -(pose[0] + N.force * pose[1]), (-0.5, 0.01), constraints={"type": "ineq", "fun": room},
        options={"ftol": 1e-15, "maxiter": 200},
    )  # fmt: skip
    return (-best.fun,)


def assembly():
    model = tc.Assembly("shaft in two bores", method=tc.Method(resolution="exact", objective="seating"))
    bar = trimesh.creation.cylinder(N.d / 2, 2 * N.force, sections=96)
    shaft = model.part("shaft", tc.Mesh(bar), at=(0, 0, N.z1 / 2))
    barrel = shaft.face(tc.select.Cylinder())
    foot = (0, 0, -N.force)
    model.locate(shaft, [tc.Locator("Z", foot, "z", 0.0)], floating=True)
    for name, z in (("near", 0.0), ("far", N.z0)):
        ring = trimesh.creation.annulus(N.b / 2, 2 * N.b, N.wall, sections=96)
        wall = model.part(name, tc.Mesh(ring), at=(0, 0, z + N.wall / 2), fixed=True)
        model.contact(f"{name} bore", moving=barrel, reference=wall.face(tc.select.Cylinder(inner=True)))
    model.force("push", at=shaft.point(0, 0, N.force - N.z1 / 2), vector=(0, 10, 0))
    # A ring at the height of the force: the axis is measured in its middle plane, through which the shaft slides.
    ring = tc.Mesh(trimesh.creation.annulus(N.b, 2 * N.b, 2.0, sections=96))
    gauge = model.part("gauge", ring, at=(0, 0, N.force), fixed=True)
    model.measure("height", tc.AxisDistance(gauge.face(tc.select.Cylinder(inner=True)), barrel, across=(0.0, 0.0, 1.0)))
    return model


def answers():
    results = an.simulated(assembly(), 2)
    return an.Answers([an.within(an.values(results, "height")[0], 1e-6)], 2)
