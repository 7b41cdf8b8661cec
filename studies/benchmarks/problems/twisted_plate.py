"""The corner force of a twisted plate."""

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.beams import condensed
from studies.benchmarks.plates import elastic_file, nodes_at, plate_stiffness
from studies.benchmarks.problem import numbers

N = numbers(__file__)
CORNERS = [(0, 0), (N.side, 0), (0, N.side), (N.side, N.side)]


def solution():
    return (2 * N.E * N.h**3 / 12 / (1 + N.nu) / (1 - N.nu) * (1 - N.nu) * N.d / N.side**2,)


def at_corners():
    """Return places and stiffness of the corners."""
    grid, stiffness = plate_stiffness(N.side, N.h, N.E, N.nu)
    chosen = nodes_at(grid, CORNERS)
    return grid[chosen], condensed(stiffness, chosen)


def check():
    return (at_corners()[1][3] @ [0, 0, 0, N.d],)


def assembly():
    model = tc.Assembly("twisted plate", method=tc.Method(objective="seating"))
    plate = model.part("plate", tc.Box(N.side, N.side, N.h))
    plate.elastic(**elastic_file("twisted plate", *at_corners()))
    lifts = [tc.Tolerance(0.0, shift=N.d if k == 3 else 0.0) for k in range(4)]
    corners = [tc.Locator(f"corner {k}", (*CORNERS[k], 0), "z", lift) for k, lift in enumerate(lifts)]
    sides = [tc.Locator(f"side {k}", (*CORNERS[k], 0), "y", 0.0) for k in (0, 1)]
    model.locate(plate, [*corners, *sides, tc.Locator("end", (*CORNERS[0], 0), "x", 0.0)])
    model.measure("corner", plate.point(*CORNERS[3], 0), along="z")
    return model


def answers():
    force = an.simulated(assembly(), 2).reaction.sel(pair="plate.corner 3").values[0]
    return an.Answers([an.within(force, 1e-5)], 2)
