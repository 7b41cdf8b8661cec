"""Assemblies with known answers, for several tests."""

import importlib.util
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import tolcontact as tc

MODELS = Path(__file__).resolve().parents[1] / "models"


def model(name: str) -> tc.Assembly:
    """The assembly of a script in `models/`."""
    spec = importlib.util.spec_from_file_location(name, MODELS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.assembly()


class Frame:
    """A rigid motion, and a stretch, of a whole assembly: what its results must not depend on."""

    def __init__(self, turn=(0.0, 0.0, 0.0), shift=(0.0, 0.0, 0.0), scale=1.0):
        self.R, self.shift, self.scale = Rotation.from_rotvec(turn), np.array(shift), scale

    def place(self, *at):
        return {"at": self.R.apply(np.array(at) * self.scale) + self.shift, "rotation": self.R.as_rotvec()}

    def box(self, *size):
        return tc.Box(*(self.scale * s for s in size))

    def along(self, *direction):
        return tuple(self.R.apply(direction))


STILL = Frame()


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


def translating(tolerance) -> list[tc.Locator]:
    """Six locators of which one varies, and moves the part along z without turning it."""
    return [
        tc.Locator("Z", (5, 5, 0), "z", tolerance),
        tc.Locator("X1", (0, 5, 0), "x", 0),
        tc.Locator("X2", (0, 5, 10), "x", 0),
        tc.Locator("X3", (0, 15, 0), "x", 0),
        tc.Locator("Y1", (5, 0, 0), "y", 0),
        tc.Locator("Y2", (5, 0, 10), "y", 0),
    ]


def one_dimensional(base_tolerance: float) -> tc.Assembly:
    """CASES C1: a block that only moves up and down, on a block that does the same or stands still."""
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
