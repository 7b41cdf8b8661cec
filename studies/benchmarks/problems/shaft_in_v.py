"""A shaft in a V of two walls."""

import itertools

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    radius = N.td / 12
    return np.sqrt(2 * N.s**2 + (2 * radius) ** 2) / np.sqrt(2), N.s


def check():
    normals = np.array([[1, 1], [-1, 1]]) / np.sqrt(2)

    def centre(left, right, radius):
        return np.linalg.solve(normals, np.array([left, right]) + radius)

    z, w = np.polynomial.hermite_e.hermegauss(4)
    w = w / w.sum()
    nodes, weights = np.array(list(itertools.product(z, repeat=3))), np.prod(list(itertools.product(w, repeat=3)), axis=1)
    places = np.array([centre(N.s * a, N.s * b, N.r + N.td / 12 * c) for a, b, c in nodes])
    across, height = np.sqrt(weights @ (places - weights @ places) ** 2)
    return height, across


def assembly():
    model = tc.Assembly("shaft in V", method=tc.Method(resolution="exact", objective="seating"))
    shape = trimesh.creation.cylinder(radius=N.r, height=60, sections=48)
    shape.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    shaft = model.part("shaft", tc.Mesh(shape), at=(0, 0, N.r * np.sqrt(2)))
    barrel = shaft.feature("barrel", shaft.face(tc.select.Cylinder()), tc.Size(2 * N.r, N.td / 2))
    model.locate(shaft, [tc.Locator("Y", (0, -30, 0), "y", 0.0)], floating=True)
    model.force("weight", at=shaft.point(0, 0, 0), vector=(0, 0, -10))
    for name, turn in (("left", -np.pi / 4), ("right", np.pi / 4)):
        corner = Rotation.from_rotvec((0, turn, 0)).apply((-20, -40, -5))
        block = model.part(name, tc.Box(40, 80, 5), at=corner, rotation=(0, turn, 0), fixed=True)
        block.feature("back", block.face("-z"), datum="A")
        wall = block.feature("wall", block.face("+z"), tc.Profile(6 * N.s, "A", rule="translation"))
        model.contact(f"{name} wall", moving=barrel, reference=wall)
    for axis in "zx":
        model.measure(axis, shaft.point(0, 0, 0), along=axis)
    return model


def answers():
    results = an.simulated(assembly(), 10_000)
    return an.Answers([an.deviation(an.values(results, axis)) for axis in "zx"], 10_000)
