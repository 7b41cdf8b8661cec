"""Round faces with form that fit into each other."""

from typing import Any

import numpy as np
import trimesh

import tolcontact as tc
from tests.cases.locators import parked
from tests.cases.round_contact import BARREL

RADIUS, LENGTH, CLEARANCE = 10.0, 40.0, 0.03
PULL = (6.0, -2.0)


def shaft_in_a_bore(
    shaft: Any = None,
    bore: Any = None,
    clearance: float = CLEARANCE,
    points: int | None = None,
) -> tc.Assembly:
    """A shaft of radius 10 that a force pulls aside in a bore, both 40 long; it does not turn about its axis."""
    a = tc.Assembly("fit")
    inner = RADIUS + clearance
    ring = a.part("ring", tc.Mesh(trimesh.creation.annulus(inner, 20, LENGTH, sections=96)), fixed=True)
    pin = a.part("pin", tc.Mesh(trimesh.creation.cylinder(RADIUS, LENGTH, sections=96)), fixed=False)
    hole = ring.feature("bore", ring.face(tc.select.Cylinder(radius=inner)), *([bore] if bore else []))
    barrel = pin.feature("shaft", pin.face(BARREL), *([shaft] if shaft else []))
    a.contact("fit", moving=barrel, reference=hole, points=points)
    stops = parked("X1:-10,0,18:x", "X2:-10,0,-18:x", "Y1:0,-10,18:y", "Y2:0,-10,-18:y")
    a.locate(pin, [tc.Locator("Z", (0, 0, -20), "z", 0), tc.Locator("T", (10, 0, 0), "y", 0), *stops])
    a.force("pull", at=pin.point(0, 0, 3), vector=(*PULL, 0))
    for name, z in (("top", 20), ("foot", -20), ("pulled", 3)):
        for axis in "xy":
            a.measure(f"{name} {axis}", pin.point(0, 0, z), along=axis)
    return a


def shaft_on_a_table(form: tc.Form) -> tc.Assembly:
    """A shaft of radius 10 along y under a weight on a table, which it cannot roll over; its barrel has form."""
    a = tc.Assembly("roller")
    table = a.part("table", tc.Box(60, 80, 10), at=(-30, -40, -20), fixed=True)
    shape = trimesh.creation.cylinder(RADIUS, 60, sections=96)
    shape.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    shaft = a.part("shaft", tc.Mesh(shape), fixed=False)
    barrel = shaft.feature("barrel", shaft.face(BARREL), tc.Cylindricity(0.05, form=form))
    a.contact("line", moving=barrel, reference=table.face("+z"))
    guides = {"X1": ((0, -25, 0), "x"), "X2": ((0, 25, 0), "x"), "X3": ((0, 0, 10), "x"), "Y": ((0, -30, 0), "y")}
    stops = parked("Z1:0,-25,-10:z", "Z2:0,25,-10:z")
    a.locate(shaft, [*(tc.Locator(name, *place, 0) for name, place in guides.items()), *stops])
    a.force("weight", at=shaft.point(0, 2.3, 0), vector=(0, 0, -10))
    a.measure("left", shaft.point(0, -30, 0), along="z")
    a.measure("right", shaft.point(0, 30, 0), along="z")
    return a
