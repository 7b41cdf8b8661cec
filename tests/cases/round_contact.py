"""Balls and shafts beside walls, with answers in closed form."""

from functools import partial

import numpy as np
import trimesh
from scipy.optimize import brentq

import tolcontact as tc
from tests.cases.frames import MODELS
from tests.cases.locators import parked
from tests.cases.round_bodies import ball_in_a_cone, peg_in_a_hole, shaft_in_a_v

BARREL = tc.select.Cylinder(inner=False)


def held(part, points, tolerance):
    """Six locators along the axes: three along z, one along x, two along y, at `points` (6, 3)."""
    names = zip("ZZZXYY", range(6), strict=True)
    return [tc.Locator(f"{n}{k}", tuple(p), n.lower(), tolerance) for (n, k), p in zip(names, points, strict=True)]


def jammed_peg(clearance: float = 0.05, length: float = 10.0, sections: int = 48, tolerance: float = 0.2) -> tc.Assembly:
    """A peg of radius 5 that a couple tilts in a hole that is off its place and askew, until both rims hold it.

    The angle between the axes is then `jamming_angle`.
    """
    a = tc.Assembly("jammed")
    plate = a.part("plate", tc.Mesh(trimesh.creation.annulus(5 + clearance, 20, length, sections=sections)), fixed=True)
    peg = a.part("peg", tc.Mesh(trimesh.creation.cylinder(5, 3 * length, sections=sections)), fixed=False)
    corners = [(20, 0, 0), (-20, 0, 0), (0, 20, 0), (0, 0, 0), (0, 0, 0), (20, 0, 0)]
    a.locate(plate, held(plate, corners, tolerance))
    stops = parked("Z1:5,0,0:z", "Z2:0,5,0:z", "X:-5,0,0:x", "Y1:0,-5,0:y", "Y2:4,-3,0:y")
    a.locate(peg, [tc.Locator("Z", (0, 0, 0), "z", 0), *stops])
    for name, z, sign in (("above", length, 1.0), ("below", -length, -1.0)):
        a.force(name, at=peg.point(0, 0, z), vector=(2 * sign, -1 * sign, 0))
    a.contact("fit", moving=peg.face(BARREL), reference=plate.face(tc.select.Cylinder(radius=5 + clearance, inner=True)))
    a.measure("top", peg.point(0, 0, length), along="x", tolerance=tolerance)
    return a


def jamming_angle(clearance: float = 0.05, length: float = 10.0, radius: float = 5.0) -> float:
    """[rad]: (length / 2) sin + radius = (radius + clearance) cos."""
    return float(brentq(lambda t: length / 2 * np.sin(t) + radius - (radius + clearance) * np.cos(t), 0, 0.1, xtol=1e-16))


def ball_on_three_pins(subdivisions: int = 3, tolerance: float = 0.3) -> tc.Assembly:
    """A ball of radius 10 under its weight on three lying pins of radius 3 at 120 degrees, each off its place and askew."""
    a = tc.Assembly("pins")
    pins = []
    for k in range(3):
        turn = 2 * np.pi * k / 3
        shape = trimesh.creation.cylinder(3, 16, sections=40)
        shape.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))  # along y
        pin = a.part(f"pin {k}", tc.Mesh(shape), at=(8 * np.cos(turn), 8 * np.sin(turn), 0), rotation=(0, 0, turn), fixed=True)
        ends = [(3, 8, 0), (-3, 8, 0), (0, -8, 0), (0, 0, 0), (3, 0, 0), (-3, 0, 0)]
        a.locate(pin, held(pin, ends, tolerance))
        pins.append(pin)
    ball = a.part("ball", tc.Mesh(trimesh.creation.icosphere(subdivisions, 10)), at=(0, 0, np.sqrt(13**2 - 8**2)), fixed=False)
    a.locate(ball, parked("Z1:5,0,-8:z", "Z2:-5,0,-8:z", "Z3:0,5,-8:z", "X:-10,0,0:x", "Y1:0,-10,0:y", "Y2:3,-9,0:y", away=1))
    a.force("weight", at=ball.point(0, 0, 0), vector=(0, 0, -10))
    for pin in pins:
        a.contact(f"on {pin.name}", moving=ball.face(lambda c, n: n[:, 2] < 0.5), reference=pin.face(BARREL))
    a.measure("height", ball.point(0, 0, 0), along="z", tolerance=tolerance)
    return a


def cylinder_in_a_slot(sections: int = 32, clearance: float = 0.1, tolerance: float = 0.2) -> tc.Assembly:
    """A standing pin of radius 4 in the straight part of a slot along x, which it is pushed against; the slot varies."""
    a = tc.Assembly("slot")
    width = 4 + clearance
    jaws = [
        a.part(name, tc.Box(40, 10, 8), at=(-20, y, -4), fixed=True)
        for name, y in (("near", width), ("far", -10 - width))
    ]  # fmt: skip
    for jaw in jaws:
        inner = 0 if jaw.name == "near" else 10
        a.locate(jaw, held(jaw, [(0, 0, 0), (40, 0, 0), (0, 10, 0), (20, 5, 4), (0, inner, 4), (40, inner, 4)], tolerance))
    pin = a.part("pin", tc.Mesh(trimesh.creation.cylinder(4, 30, sections=sections)), fixed=False)
    exact = [tc.Locator(f"Z{k}", (x, y, -15), "z", 0) for k, (x, y) in enumerate([(4, 0), (-4, 0), (0, 4)])]
    a.locate(pin, [*exact, tc.Locator("X", (0, 0, 0), "x", 0), *parked("Y1:0,-4,10:y", "Y2:3,-3,-10:y")])
    a.force("push", at=pin.point(0, 0, 0), vector=(0, 5, 0))
    for jaw, side in zip(jaws, ("-y", "+y"), strict=True):
        a.contact(f"{jaw.name} side", moving=pin.face(BARREL), reference=jaw.face(side))
    a.measure("aside", pin.point(0, 0, 0), along="y", tolerance=tolerance)
    return a


# Bodies of few triangles, except for the fine cone: their clearances take a minute.
EVERY = {
    "peg": peg_in_a_hole, "V": shaft_in_a_v, "cone": partial(ball_in_a_cone, sections=96, subdivisions=3),
    "fine cone": ball_in_a_cone, "jammed": jammed_peg, "pins": ball_on_three_pins, "slot": cylinder_in_a_slot,
}  # fmt: skip


def pinned(chord=None):
    """A pin in the round hole of the cover's STEP file, which is triangulated within `chord`."""
    a = tc.Assembly("pinned", method=tc.Method(resolution="exact", objective="all points"))
    cover = a.part("cover", tc.Mesh(MODELS / "cover.step", chord=chord), fixed=True)
    pin = a.part("pin", tc.Mesh(trimesh.creation.cylinder(4, 16, sections=30)), at=(15, 15, 4))
    a.locate(pin, held(pin, [(4, 0, 0), (-4, 0, 0), (0, 4, 0), (0, 0, 0), (0, 0, 0), (4, 0, 0)], 0.4))
    a.contact("hole", moving=pin.face(tc.select.Cylinder()), reference=cover.face(tc.select.Brep((19.05, 15, 1))))
    a.measure("x", pin.point(0, 0, 8), along="x")
    return a
