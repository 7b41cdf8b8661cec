"""A plate on more supports than it needs."""

import numpy as np

import tolcontact as tc
from tests.cases.frames import STILL, Frame

LEGS = np.array([(5, 5), (95, 5), (95, 55), (5, 55)], dtype=float)
WEIGHT = np.array([52.0, 31.0])


def table(frame: Frame = STILL, *, weight=100.0, legs=LEGS, tolerance=2.0) -> tc.Assembly:
    """A plate on one-sided supports of uneven height, guided sideways, under its weight."""
    s = frame.scale
    a = tc.Assembly("table")
    plate = a.part("plate", frame.box(100, 60, 5), **frame.place(0, 0, 40))
    supports = [
        tc.Locator(f"leg{k}", (s * x, s * y, -40 * s), "z", tolerance * s, one_sided=True) for k, (x, y) in enumerate(legs)
    ]
    guides = [
        tc.Locator("B1", (20 * s, 0, 2 * s), "y", 0),
        tc.Locator("B2", (80 * s, 0, 2 * s), "y", 0),
        tc.Locator("C", (0, 30 * s, 2 * s), "x", 0),
    ]
    a.locate(plate, [*supports, *guides])
    down = -weight * np.array(frame.along(0, 0, 1))
    a.force("weight", at=plate.point(s * WEIGHT[0], s * WEIGHT[1], 2 * s), vector=tuple(down))
    a.measure("corner", plate.point(100 * s, 60 * s, 0), along=frame.along(0, 0, 1))
    a.measure("centre", plate.point(50 * s, 30 * s, 0), along=frame.along(0, 0, 1))
    return a
