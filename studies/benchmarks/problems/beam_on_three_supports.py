"""The middle force of a beam on three supports."""

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.beams import beam_stiffness, condensed
from studies.benchmarks.problem import numbers

N = numbers(__file__)
BENDING = N.E * N.width * N.h**3 / 12
OVERHANG = 10.0


def solution():
    return (48 * BENDING * N.d / N.length**3,)


def check():
    return (condensed(beam_stiffness(N.length, 20, BENDING), [0, 20, 40])[1] @ [0, N.d, 0],)


def assembly():
    """Return the beam as a solid without Poisson's ratio, as beams have none, held at its neutral plane."""
    model = tc.Assembly("beam on three supports", method=tc.Method(objective="seating"))
    beam = model.part("beam", tc.Box(N.length + 2 * OVERHANG, N.width, N.h))
    beam.elastic(E=N.E, nu=0.0)
    supports = {"left": 0.0, "middle": N.length / 2, "right": N.length}
    feet = [
        tc.Locator(f"{name} {k}", (OVERHANG + x, y, N.h / 2), "z", tc.Tolerance(0.0, shift=N.d if name == "middle" else 0.0))
        for name, x in supports.items()
        for k, y in enumerate((N.width / 4, 3 * N.width / 4))
    ]
    ends = [tc.Locator(f"side {k}", (x, 0, N.h / 2), "y", 0.0) for k, x in enumerate((OVERHANG, N.length + OVERHANG))]
    model.locate(beam, [*feet, *ends, tc.Locator("end", (0, N.width / 2, N.h / 2), "x", 0.0)])
    model.measure("middle", beam.point(N.length / 2 + OVERHANG, N.width / 2, N.h / 2), along="z")
    return model


def answers():
    reactions = an.simulated(assembly(), 2).reaction.sel(pair=["beam.middle 0", "beam.middle 1"])
    force = reactions.values[0].sum()
    return an.Answers([an.within(force, 1e-3 * force)], 2)
