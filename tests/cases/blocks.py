"""Blocks: flat faces, alone or in a row."""

import numpy as np
import trimesh
from scipy.stats import uniform

import tolcontact as tc
from tests.cases.frames import STILL, Frame
from tests.cases.locators import translating


def ra1(frame: Frame = STILL, points=202) -> tc.Assembly:
    """models/ra1.py in any frame."""
    s = frame.scale
    a = tc.Assembly("RA1")
    base = a.part("base", frame.box(100, 50, 10), **frame.place(0, 0, 0))
    top = a.part("top", frame.box(50, 25, 10), **frame.place(50, 12.5, 10))
    a.locate(base, tc.three_two_one(base.face("-z"), base.face("-y"), base.face("-x"), inset=5 * s), tolerance=10 * s)
    a.locate(top, tc.three_two_one(top.face("-z"), top.face("+y"), top.face("-x"), inset=5 * s), tolerance=10 * s)
    a.contact("interface", moving=top.face("-z"), reference=base.face("+z"), points=points)
    a.measure("corner height", top.point(50 * s, 0, 10 * s), along=frame.along(0, 0, 1), tolerance=s)
    return a


def one_dimensional(base_tolerance: float) -> tc.Assembly:
    """A block that only moves up and down, on a block that does the same or stands still."""
    a = tc.Assembly("C1")
    base = a.part("base", tc.Box(10, 10, 10), at=(0, 0, -10))
    block = a.part("block", tc.Box(10, 10, 10))
    a.locate(base, translating(base_tolerance))
    a.locate(block, translating(6))
    a.contact("seat", moving=block.face("-z"), reference=base.face("+z"), points=9)
    a.measure("height", block.point(5, 5, 10), along="z")
    return a


def stack(frame: Frame = STILL, *, reverse: bool = False, free_middle: bool = True) -> tc.Assembly:
    """Three plates, the upper two free: a pair of two free parts, and a part between two others."""
    a = tc.Assembly("stack")
    sizes = {"bottom": (0, 60, 40), "middle": (10, 50, 40), "upper": (20, 30, 30)}
    parts = {}
    for name in reversed(sizes) if reverse else sizes:
        z, x, y = sizes[name]
        fixed = {"bottom": True, "middle": not free_middle, "upper": False}[name]
        parts[name] = a.part(name, frame.box(x, y, 10), **frame.place(0, 0, z), fixed=fixed)
    for part in parts.values():
        scheme = tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=4 * frame.scale)
        a.locate(part, scheme, tolerance=1.5 * frame.scale)
    pairs = [("lower joint", "middle", "bottom"), ("upper joint", "upper", "middle")]
    for name, moving, reference in reversed(pairs) if reverse else pairs:
        a.contact(name, moving=parts[moving].face("-z"), reference=parts[reference].face("+z"), points=60)
    s = frame.scale
    a.measure("top", parts["upper"].point(15 * s, 15 * s, 10 * s), along=frame.along(0, 0, 1), tolerance=s)
    gap = {"to": parts["upper"].point(0, 0, 0), "along": frame.along(0, 0, 1)}
    a.measure("joint", parts["bottom"].point(0, 0, 10 * s), **gap, tolerance=s)
    return a


def jaws() -> tc.Assembly:
    """A tongue in the slot between two free jaws, all of them on a floor."""
    a = tc.Assembly("jaws")
    floor = a.part("floor", tc.Box(60, 30, 10), at=(0, 0, -10), fixed=True)
    left = a.part("left", tc.Box(20, 20, 20), at=(0, 5, 0), fixed=False)
    tongue = a.part("tongue", tc.Box(20, 20, 25), at=(20, 5, 0), fixed=False)
    right = a.part("right", tc.Box(20, 20, 20), at=(40, 5, 0), fixed=False)
    for part in (left, tongue, right):
        scheme = tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=2)
        a.locate(part, scheme, tolerance=0.5)
        a.contact(f"{part.name} on floor", moving=part.face("-z"), reference=floor.face("+z"), points=25)
    a.contact("left side", moving=tongue.face("-x"), reference=left.face("+x"), points=25)
    a.contact("right side", moving=tongue.face("+x"), reference=right.face("-x"), points=25)
    a.measure("slot", left.point(20, 10, 20), to=right.point(0, 10, 20), along="x", tolerance=1)
    return a


def tab(slot: float = 9.9, *, tolerance: float = 0.1, floor: bool = True) -> tc.Assembly:
    """A tab 10 wide that goes down into a slot, which may have a floor."""
    a = tc.Assembly("tab")
    left = a.part("left", tc.Box(10, 10, 10), at=(-10, 0, 0), fixed=True)
    right = a.part("right", tc.Box(10, 10, 10), at=(slot, 0, 0), fixed=True)
    part = a.part("tab", tc.Box(10, 10, 10))
    a.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=1), tolerance=tolerance)
    a.contact("left side", moving=part.face("-x"), reference=left.face("+x"), points=9)
    a.contact("right side", moving=part.face("+x"), reference=right.face("-x"), points=9)
    if floor:
        below = a.part("floor", tc.Box(10, 10, 10), at=(0, 0, -10), fixed=True)
        a.contact("floor", moving=part.face("-z"), reference=below.face("+z"), points=9)
    a.measure("side", part.point(5, 5, 5), along="x", tolerance=1)
    return a


def stopped(stops: int = 1) -> tc.Assembly:
    """A block on six two-sided locators, and in its way one-sided ones, which push it."""
    a = tc.Assembly("stopped")
    a.part("base", tc.Box(100, 100, 10), at=(0, 0, -10), fixed=True)
    block = a.part("block", tc.Box(50, 30, 20))
    places = {
        "Z1": ((5, 5, 0), "z"), "Z2": ((45, 5, 0), "z"), "Z3": ((25, 25, 0), "z"),
        "Y1": ((5, 0, 10), "y"), "Y2": ((45, 0, 10), "y"), "X": ((0, 15, 10), "x"),
    }  # fmt: skip
    a.locate(
        block,
        [tc.Locator(name, *place, 1) for name, place in places.items()]
        + [tc.Locator(f"stop {k}", (0, 5 + 7 * k, 5), "x", 1, one_sided=True) for k in range(stops)],
    )
    a.measure("face", block.point(50, 30, 20), along="x")
    return a


def block_on_six(width: float, one_sided: int = 0) -> tc.Assembly:
    """A block on six locators, some of them one-sided, that a force pushes against a wall it may not reach."""
    a = tc.Assembly("block on six")
    wall = a.part("wall", tc.Box(10, 100, 100), at=(100, 0, 0), fixed=True)
    block = a.part("block", tc.Box(100, 100, 100), fixed=False)
    places = [
        ((10, 10, 0), "z"),
        ((90, 10, 0), "z"),
        ((50, 90, 0), "z"),
        ((10, 0, 50), "y"),
        ((90, 0, 50), "y"),
        ((0, 50, 50), "x"),
    ]
    six = [tc.Locator(f"L{k}", p, d, width, one_sided=k >= 6 - one_sided) for k, (p, d) in enumerate(places)]
    a.locate(block, six)
    a.contact("side", moving=block.face("+x"), reference=wall.face("-x"))
    a.force("push", at=block.point(50, 50, 50), vector=(1, 0, -1))
    a.measure("corner", block.point(0, 0, 0), along="x", tolerance=1)
    return a


def square_pins(varies: str = "both") -> tc.Assembly:
    """A plate with two square pins, free to slide along x only; each face of pins and slots is off and askew.

    A face is a part of its own. Off by u with sigma t/6 and askew by gamma with sigma t/30 is the same as two independent
    deviations with sigma t/6 sqrt(2) at y = -5 and +5. A push along x finds its rest where both pins fit. Of "translations"
    or "rotations" alone both deviations are driven by one cause.
    """
    t = 0.16
    a = tc.Assembly("C6")
    plate = a.part("plate", tc.Box(130, 40, 5), at=(0, -20, 10), fixed=False)
    guides = {
        "A1": ((10, 5, 0), "z"),
        "A2": ((120, 5, 0), "z"),
        "A3": ((65, 35, 0), "z"),
        "B1": ((10, 0, 2), "y"),
        "B2": ((120, 0, 2), "y"),
    }
    stop = tc.Locator("stop", (0, 20, 2), "x", uniform(-1, 1e-9), one_sided=True)
    a.locate(plate, [*(tc.Locator(name, p, along, 0) for name, (p, along) in guides.items()), stop])
    a.force("push", at=plate.point(0, 20, 2), vector=(1.0, 0, 0))

    def wall(name, x, on=None):
        part = a.part(name, tc.Box(1, 10, 10), at=(x, -5, 0), fixed=True)
        held = {"Z1": ((0, 0, 0), "z"), "Z2": ((1, 0, 0), "z"), "Z3": ((0, 10, 0), "z"), "Y": ((0, 0, 0), "y")}
        varying = [tc.Locator(f"X{y}", (0, y, 0), "x", np.sqrt(2) * t if varies == "both" else 0) for y in (0, 10)]
        if varies != "both":
            a.variable(f"{name} off", t, drives={f"{name}.X0": 1, f"{name}.X10": 1 if varies == "translations" else -1})
        a.locate(part, [*(tc.Locator(key, p, along, 0) for key, (p, along) in held.items()), *varying], on=on)
        return part

    for k, x in enumerate((30, 100)):
        left = wall(f"pin {k} left", x - 5, plate), wall(f"slot {k} left", x - 6.1)
        right = wall(f"pin {k} right", x + 4, plate), wall(f"slot {k} right", x + 5.1)
        a.contact(f"left {k}", moving=left[0].face("-x"), reference=left[1].face("+x"), points="vertices")
        a.contact(f"right {k}", moving=right[0].face("+x"), reference=right[1].face("-x"), points="vertices")
    a.measure("slide", plate.point(0, 0, 0), along="x", tolerance=1)
    return a


def comb(teeth, width, pitch=10.0, height=8.0):
    """A comb whose teeth stand on z = 0."""
    back = trimesh.creation.box(bounds=[[0, 0, -3], [teeth * pitch, 20, 0]])
    bounds = [[[k * pitch, 0, 0], [k * pitch + width, 20, height]] for k in range(teeth)]
    return trimesh.boolean.union([back, *(trimesh.creation.box(bounds=low_high) for low_high in bounds)], engine="manifold")


def combs():
    """A comb in another one: teeth 4.0 mm wide in grooves of 4.2 mm, whose tips are 0.1 mm apart from the ground."""
    lower, upper = comb(6, 5.8), comb(5, 4.0)
    upper.vertices = upper.vertices * [1, 1, -1] + [5.9, 0, 8.1]
    upper.invert()
    return upper, lower
