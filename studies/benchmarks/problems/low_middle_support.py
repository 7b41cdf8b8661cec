"""A pressed beam on three supports of which the middle one is low."""

from scipy import integrate, optimize, stats

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.beams import beam_stiffness, condensed
from studies.benchmarks.problem import numbers

N = numbers(__file__)
BENDING, SHEAR = N.E * N.width * N.h**3 / 12, 5 / 6 * N.E / 2 * N.width * N.h
OVERHANG = 10.0


def solution():
    k = 1 / (N.length**3 / 48 / BENDING + N.length / 4 / SHEAR)
    return N.F - k * N.low, N.F**2 / (2 * k * N.most), 1 - N.F / k / N.most


def check():
    k = condensed(beam_stiffness(N.length, 20, BENDING, SHEAR), [0, 20, 40])[1, 1]
    lost = optimize.brentq(lambda d: N.F - k * d, 0, N.most)
    force = optimize.minimize_scalar(lambda f: (f + k * N.low - N.F) ** 2, bounds=(0, N.F), options={"xatol": 1e-9}).x
    mean = integrate.quad(lambda d: max(N.F - k * d, 0) / N.most, 0, N.most, points=[lost], epsabs=1e-9)[0]
    return force, mean, (N.most - lost) / N.most


def assembly(tolerance=None):
    """Return the beam; the middle is low by a distribution, by default that of the statement."""
    tolerance = stats.uniform(-N.most, N.most) if tolerance is None else tolerance
    model = tc.Assembly("low middle support", method=tc.Method(objective="seating"))
    beam = model.part("beam", tc.Box(N.length + 2 * OVERHANG, N.width, N.h))
    beam.elastic(E=N.E, nu=0.0)
    middle = OVERHANG + N.length / 2
    feet = [
        tc.Locator(f"{name} {k}", (x, y, 0), "z", 0.0, one_sided=True)
        for name, x in (("left", OVERHANG), ("middle", middle), ("right", N.length + OVERHANG))
        for k, y in enumerate((0, N.width))
    ]
    sides = [tc.Locator(f"side {k}", (x, 0, 0), "y", 0.0) for k, x in enumerate((OVERHANG, N.length + OVERHANG))]
    model.locate(beam, [*feet, *sides, tc.Locator("end", (0, N.width / 2, 0), "x", 0.0)])
    model.variable("middle", tolerance, drives={"beam.middle 0": 1.0, "beam.middle 1": 1.0})
    model.force("press", at=beam.point(middle, N.width / 2, N.h), vector=(0, 0, -N.F))
    model.measure("middle", beam.point(middle, N.width / 2, 0), along="z")
    return model


def middle_forces(model, samples):
    """Return the forces (realization,) on the middle."""
    return an.simulated(model, samples, keep="all")["elastic"].reaction_at_load.values[:, 2:4].sum(axis=1)


def answers():
    """Return the force of a solid of tetrahedra, within 0.1 %, and of a sample the mean and the share."""
    force = middle_forces(assembly(tc.Tolerance(0.0, shift=-N.low)), 2)[0]
    forces = middle_forces(assembly(), 20_000)
    return an.Answers([an.within(force, 1e-3 * force), an.mean(forces), an.share(forces < 1e-6 * N.F)], len(forces))
