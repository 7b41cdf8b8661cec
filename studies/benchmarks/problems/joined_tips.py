"""Two cantilevers joined at their tips."""

import numpy as np

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.beams import beam_stiffness, condensed
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def bending(thickness):
    return N.E * N.width * thickness**3 / 12


def solution():
    k1, k2 = (3 * bending(h) / N.length**3 for h in (N.h1, N.h2))
    place = (k1 * N.d1 + k2 * N.d2) / (k1 + k2)
    return place, k1 * (N.d1 - place)


def check():
    (k1,), (k2,) = (condensed(beam_stiffness(N.length, 7, bending(h))[2:, 2:], [12])[0] for h in (N.h1, N.h2))
    # Equilibrium of both tips with the multiplier of their tie.
    first, second, force = np.linalg.solve([[k1, 0, 1], [0, k2, -1], [1, -1, 0]], [k1 * N.d1, k2 * N.d2, 0])
    return (first + second) / 2, force


def assembly():
    """Return a rigid joint on two springs: the first, whose rest is above, pushes it up, and the second holds it."""
    k1, k2 = (3 * bending(h) / N.length**3 for h in (N.h1, N.h2))
    model = tc.Assembly("joined tips", method=tc.Method(objective="seating"))
    joint = model.part("joint", tc.Box(10, 10, 10))
    springs = [
        tc.Locator("first", (5, 5, 0), "z", tc.Tolerance(0.0, shift=float(N.d1)), one_sided=True, stiffness=float(k1)),
        tc.Locator("second", (5, 5, 0), "z", tc.Tolerance(0.0, shift=float(N.d2)), stiffness=float(k2)),
    ]
    places = {"y1": ((0, 0, 0), "y"), "y2": ((10, 0, 0), "y"), "y3": ((5, 0, 10), "y"), "x1": ((0, 5, 0), "x")}
    places["x2"] = ((0, 5, 10), "x")
    model.locate(joint, [*springs, *(tc.Locator(name, place, along, 0.0) for name, (place, along) in places.items())])
    model.force("across", at=joint.point(10, 5, 5), vector=(1, 0, 0))  # a force is needed; this one moves nothing
    model.measure("place", joint.point(5, 5, 0), along="z")
    return model


def answers():
    results = an.simulated(assembly(), 2)
    return an.Answers([an.within(an.values(results, "place")[0], 1e-6), an.within(results.reaction.values[0, 0], 1e-5)], 2)
