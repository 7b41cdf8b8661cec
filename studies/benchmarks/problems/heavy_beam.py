"""The part of its weight that a heavy beam rests on the middle of three supports."""

import numpy as np

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)
E, GRAVITY, DENSITY = 210e3, 9.81, 7850
SPAN = N.ends[1] - N.ends[0]
OVERHANG = (N.length - SPAN) / 2
BENDING, SHEAR = N.width * N.h**3 / 12, 5 / 6 * N.width * N.h / 2  # by E


def solution():
    moment = OVERHANG**2 / 2  # of the overhang, for a unit load
    sunk = 5 * SPAN**4 / 384 / BENDING + SPAN**2 / 8 / SHEAR - moment * SPAN**2 / 8 / BENDING
    return (sunk / (SPAN**3 / 48 / BENDING + SPAN / 4 / SHEAR) / N.length,)


def check():
    nodes, weights = np.polynomial.legendre.leggauss(8)
    x = SPAN / 4 * (nodes + 1)  # from a support to the middle
    shear, unit_shear = N.length / 2 - OVERHANG - x, np.full_like(x, 0.5)
    moment, unit_moment = N.length / 2 * x - (OVERHANG + x) ** 2 / 2, x / 2
    sunk, risen = (
        weights @ (m * unit_moment / BENDING + q * unit_shear / SHEAR) for m, q in ((moment, shear), (unit_moment, unit_shear))
    )
    return (sunk / risen / N.length,)


def assembly():
    model = tc.Assembly("heavy beam", method=tc.Method(objective="seating"))
    beam = model.part("beam", tc.Box(N.length, N.width, N.h))
    beam.elastic(E=E, nu=0.0, density=DENSITY)  # so its shear modulus is E/2
    model.gravity((0, 0, -GRAVITY))
    feet = [
        tc.Locator(f"{name} {k}", (x, y, 0), "z", 0.0)
        for name, x in (("left", N.ends[0]), ("middle", N.middle), ("right", N.ends[1]))
        for k, y in enumerate((N.width / 4, 3 * N.width / 4))
    ]
    sides = [tc.Locator(f"side {k}", (x, 0, N.h / 2), "y", 0.0) for k, x in enumerate((1, N.length - 1))]
    model.locate(beam, [*feet, *sides, tc.Locator("end", (0, N.width / 2, N.h / 2), "x", 0.0)])
    model.measure("middle", beam.point(N.middle, N.width / 2, 0), along="z")
    return model


def answers():
    """Return the part that a solid of tetrahedra gives, within 0.1 %."""
    reactions = an.simulated(assembly(), 2).reaction.sel(pair=["beam.middle 0", "beam.middle 1"])
    part = reactions.values[0].sum() / (DENSITY * 1e-9 * GRAVITY * N.length * N.width * N.h)
    return an.Answers([an.within(part, 1e-3 * part)], 2)
