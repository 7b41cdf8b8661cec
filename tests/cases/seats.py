"""A block with a form of its underside, pressed onto a flat table."""

import numpy as np

import tolcontact as tc

PRESS = np.array([46.3, 21.7])  # off all lines between contact points, on which a seat could tilt either way


def seat(form: tc.Form | None = None, width: float = 0.05, lowered: float = 1.0, points: int | None = None) -> tc.Assembly:
    """A block of 100 x 50 x 20 above supports so low that its underside carries."""
    a = tc.Assembly("seat")
    table = a.part("table", tc.Box(140, 90, 10), at=(-20, -20, -10), fixed=True)
    block = a.part("block", tc.Box(100, 50, 20))
    under = block.feature("under", block.face("-z"), tc.Flatness(width, form=form or tc.Form()))
    a.contact("seat", moving=under, reference=table.face("+z"), points=points)
    low = tc.Tolerance(0.1, shift=-lowered)
    supports = [tc.Locator(f"Z{k}", (*p, 0), "z", low, one_sided=True) for k, p in enumerate([(5, 5), (95, 5), (50, 45)])]
    guides = [tc.Locator("X", (0, 25, 0), "x", 0), tc.Locator("Y1", (5, 0, 0), "y", 0), tc.Locator("Y2", (95, 0, 0), "y", 0)]
    a.locate(block, [*supports, *guides])
    a.force("weight", at=block.point(*PRESS, 0), vector=(0, 0, -10))
    for name, place in {"near": (0, 0, 0), "right": (100, 0, 0), "far": (50, 50, 0), "pressed": (*PRESS, 0)}.items():
        a.measure(name, block.point(*place), along="z")
    a.measure("foot", under.point(30, 20, 0), along="z")
    return a


def sliding(form: tc.Form | None = None) -> tc.Assembly:
    """A block that hangs over the end of a table; both faces that touch have form, and the table holds a stop, too."""
    form = form or tc.Form()
    a = tc.Assembly("sliding")
    table = a.part("table", tc.Box(100, 60, 10), at=(0, 0, -10), fixed=True)
    block = a.part("block", tc.Box(60, 40, 10), at=(70, 10, 0))
    top = table.feature("top", table.face("+z"), tc.Flatness(0.05, form=form))
    under = block.feature("under", block.face("-z"), tc.Flatness(0.05, form=form))
    a.contact("seat", moving=under, reference=top)
    a.locate(block, tc.three_two_one(under, block.face("-y"), block.face("-x"), inset=5), tolerance=0.4)
    a.measure("end", block.point(60, 20, 10), along="z")
    a.measure("foot", under.point(30, 20, 0), along="z")
    return a
