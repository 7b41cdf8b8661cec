"""A peg that a force pushes to the side of its hole."""

import numpy as np
import trimesh
from scipy import optimize

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)
FORCE = np.array([1.0, -2.0])


def solution():
    along = FORCE[0] / np.linalg.norm(FORCE)
    return along * (N.hole - N.d) / 2, along * np.hypot(N.td, N.th) / 12


def check():
    def place(clearance):
        rim = {"type": "ineq", "fun": lambda xy: (clearance / 2) ** 2 - xy @ xy}
        start = np.array([0.4, 0.2]) * clearance / 2
        return optimize.minimize(lambda xy: -10 * FORCE @ xy, start, constraints=rim, tol=1e-14).x[0]

    z, w = np.polynomial.hermite_e.hermegauss(3)
    w = w / w.sum()
    x = np.array([[place(N.hole - N.d + N.th / 6 * a - N.td / 6 * b) for b in z] for a in z])
    weights = w[:, None] * w
    mean = (weights * x).sum()
    return mean, np.sqrt((weights * (x - mean) ** 2).sum())


def assembly():
    model = tc.Assembly("peg in hole", method=tc.Method(resolution="exact", objective="seating"))
    plate = model.part("plate", tc.Mesh(trimesh.creation.annulus(N.hole / 2, 20, 10, sections=48)), fixed=True)
    bore = plate.feature("bore", plate.face(tc.select.Cylinder(inner=True)), tc.Size(N.hole, N.th / 2))
    peg = model.part("peg", tc.Mesh(trimesh.creation.cylinder(N.d / 2, 20, sections=48)))
    barrel = peg.feature("barrel", peg.face(tc.select.Cylinder()), tc.Size(N.d, N.td / 2))
    feet = [tc.Locator(f"Z{k}", (x, y, -10), "z", 0.0) for k, (x, y) in enumerate([(5, 0), (-5, 0), (0, 5)])]
    model.locate(peg, feet, floating=True)
    model.contact("fit", moving=barrel, reference=bore)
    model.force("push", at=peg.point(0, 0, 0), vector=(*FORCE, 0))
    model.measure("x", peg.point(0, 0, 0), along="x")
    return model


def answers():
    x = an.values(an.simulated(assembly(), 10_000), "x")
    return an.Answers([an.mean(x), an.deviation(x)], len(x))
