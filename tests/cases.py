"""Assemblies with known answers, for several tests."""

import runpy
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation
from scipy.stats import norm, uniform

import tolcontact as tc

MODELS = Path(__file__).resolve().parents[1] / "models"


def model(name: str, *choices) -> tc.Assembly:
    """The assembly of a script in `models/`."""
    return runpy.run_path(str(MODELS / f"{name}.py"))["assembly"](*choices)


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


def ring(wedges: int = 8) -> tc.Assembly:
    """Free wedges side by side around an axis: the loop of contacts closes."""
    a = tc.Assembly("ring")
    half = np.pi / wedges
    corners = [(r * np.cos(s * half), r * np.sin(s * half), z) for r in (20, 40) for s in (-1, 1) for z in (0, 10)]
    wedge = trimesh.Trimesh(corners).convex_hull
    out, along = np.array([np.cos(half), np.sin(half), 0]), np.array([-np.sin(half), np.cos(half), 0])
    x = 20 * np.cos(half)
    locators = [
        tc.Locator("A1", (x + 1, 0, 0), "z"),
        tc.Locator("A2", (35, -5, 0), "z"),
        tc.Locator("A3", (35, 5, 0), "z"),
        tc.Locator("B1", (x, -5, 5), "x"),
        tc.Locator("B2", (x, 5, 5), "x"),
        tc.Locator("C", tuple(30 * out * [1, -1, 1] + [0, 0, 5]), "y"),
    ]
    parts = []
    for k in range(wedges):
        part = a.part(f"wedge {k}", tc.Mesh(wedge), rotation=(0, 0, 2 * half * k), fixed=False)
        a.locate(part, locators, tolerance=0.5)
        parts.append(part)

    def towards(direction):
        return lambda c, n: n @ direction > 0.99

    ahead, behind = towards(along), towards(along * [1, -1, 1])
    for k, part in enumerate(parts):
        a.contact(f"joint {k}", moving=part.face(ahead), reference=parts[(k + 1) % wedges].face(behind), points=20)
    a.measure("width", parts[0].point(x, 0, 5), to=parts[wedges // 2].point(x, 0, 5), along="x", tolerance=1)
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


def tab(slot: float = 9.9) -> tc.Assembly:
    """A tab 10 wide that goes down into a slot."""
    a = tc.Assembly("tab")
    left = a.part("left", tc.Box(10, 10, 10), at=(-10, 0, 0), fixed=True)
    right = a.part("right", tc.Box(10, 10, 10), at=(slot, 0, 0), fixed=True)
    floor = a.part("floor", tc.Box(10, 10, 10), at=(0, 0, -10), fixed=True)
    part = a.part("tab", tc.Box(10, 10, 10))
    a.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=1), tolerance=0.1)
    a.contact("left side", moving=part.face("-x"), reference=left.face("+x"), points=9)
    a.contact("right side", moving=part.face("+x"), reference=right.face("-x"), points=9)
    a.contact("floor", moving=part.face("-z"), reference=floor.face("+z"), points=9)
    a.measure("side", part.point(5, 5, 5), along="x", tolerance=1)
    return a


def rollers(tangential: float = 6.0) -> tc.Assembly:
    """A roller that is set down beside the top (+y) of another one; their axes (z) stay parallel."""
    a = tc.Assembly("rollers")
    shape = tc.Mesh(trimesh.creation.cylinder(radius=10, height=10, sections=720))
    lower = a.part("lower", shape, fixed=True)
    upper = a.part("upper", shape, at=(0, 20, 0))
    places = {
        "Z1": ((0, 0, -5), "z", 0), "Z2": ((5, 0, -5), "z", 0), "Z3": ((0, 5, -5), "z", 0),
        "X1": ((-10, 0, -4), "x", tangential), "Y1": ((-8, -6, 4), "y", 2), "Y2": ((8, -6, 4), "y", 2),
    }  # fmt: skip
    a.locate(upper, [tc.Locator(name, *place) for name, place in places.items()])
    sides = {"moving": upper.face(lambda c, n: n[:, 1] < -0.5), "reference": lower.face(lambda c, n: n[:, 1] > 0.5)}
    a.contact("line", **sides, points=400, within=20)
    a.measure("height", upper.point(0, 0, 0), along="y", tolerance=1)
    return a


def square_pins() -> tc.Assembly:
    """CASES C6: a plate with two square pins, free to slide along x only; each face of pins and slots is off and askew.

    A face is a part of its own. Off by u with sigma t/6 and askew by gamma with sigma t/30 is the same as two independent
    deviations with sigma t/6 sqrt(2) at y = -5 and +5. A push along x finds its rest where both pins fit.
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
        varying = [tc.Locator(f"X{y}", (0, y, 0), "x", np.sqrt(2) * t) for y in (0, 10)]
        a.locate(part, [*(tc.Locator(key, p, along, 0) for key, (p, along) in held.items()), *varying], on=on)
        return part

    for k, x in enumerate((30, 100)):
        left = wall(f"pin {k} left", x - 5, plate), wall(f"slot {k} left", x - 6.1)
        right = wall(f"pin {k} right", x + 4, plate), wall(f"slot {k} right", x + 5.1)
        a.contact(f"left {k}", moving=left[0].face("-x"), reference=left[1].face("+x"), points="vertices")
        a.contact(f"right {k}", moving=right[0].face("+x"), reference=right[1].face("-x"), points="vertices")
    a.measure("slide", plate.point(0, 0, 0), along="x", tolerance=1)
    return a


def bar_in_a_half_pipe(spacing: float) -> tc.Assembly:
    """A bar of radius 20 in the lower half of a pipe of radius 20.2: curved against curved."""
    a = tc.Assembly("pipe")
    pipe = a.part("pipe", tc.Mesh(trimesh.creation.annulus(20.2, 24, 80, sections=256)), fixed=True)
    bar = a.part("bar", tc.Mesh(trimesh.creation.cylinder(20, 60, sections=256)))
    ends = [(0, 0, 25), (0, 0, -25)]
    held = [tc.Locator("Z", (0, 0, -30), "z"), tc.Locator("T", (20, 0, 0), "y", 0)]
    a.locate(bar, [*(tc.Locator(f"{n}{k}", p, n) for n in "xy" for k, p in enumerate(ends)), *held], tolerance=1)
    inner = pipe.face(lambda c, n: (abs(n[:, 2]) < 0.1) & (np.hypot(c[:, 0], c[:, 1]) < 21) & (c[:, 1] < 0))
    a.contact("inside", moving=bar.face(lambda c, n: abs(n[:, 2]) < 0.1), reference=inner, spacing=spacing)
    a.measure("height", bar.point(0, 0, 30), along="y")
    a.measure("aside", bar.point(0, 0, 30), along="x")
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


def parked(*names: str, away: float = 0.5) -> list[tc.Locator]:
    """One-sided stops that hold nothing once a part has come to rest: `name:x,y,z:direction`, that far behind the part."""
    found = []
    for said in names:
        name, at, along = said.split(":")
        point = tuple(float(c) for c in at.split(","))
        found.append(tc.Locator(name, point, along, norm(-away, 1e-9), one_sided=True))
    return found


def hinged_ring(wedges: int, sigma: float = 0.05) -> tc.Assembly:
    """Wedges hinged on one axis, one of them fixed, each face of each askew by its own angle; pushed together.

    They close where the sum of the angles leaves room: see `excess_of_hinged_ring`. A face is a plate of its own, which turns
    about the axis by its locator at 30 mm.
    """
    a = tc.Assembly("hinged ring")
    half, open_ = np.pi / wedges, ring_opening(wedges, sigma) / 30 / (2 * wedges)
    faces = []
    for k in range(wedges):
        c, s = np.cos(2 * half * k), np.sin(2 * half * k)
        hub = a.part(f"hub {k}", tc.Box(20, 2, 10), at=(20 * c, 20 * s, 0), rotation=(0, 0, 2 * half * k), fixed=k == 0)
        feet = [tc.Locator(f"Z{i}", p, "z", 0) for i, p in enumerate([(0, 0, 0), (20, 0, 0), (10, 2, 0)])]
        axis = [tc.Locator("X", (-20, 0, 0), "x", 0), tc.Locator("Y", (-20, 0, 0), "y", 0)]
        last = [tc.Locator("T", (10, 0, 0), "y", 0)] if k == 0 else parked("T:10,0,0:y", away=20)
        a.locate(hub, [*feet, *axis, *last])
        if k:
            a.force(f"push {k}", at=hub.point(10, 0, 0), vector=(-0.1 * s, 0.1 * c, 0))
        both = {}
        for side, sign, y in (("ahead", 1, 1.0), ("behind", -1, 0.0)):
            angle = 2 * half * k + sign * (half - open_)
            frame = Frame(turn=(0, 0, angle))
            plate = a.part(f"{side} {k}", tc.Box(20, 1, 10), **frame.place(20, -y, 0), fixed=True)
            rest = [tc.Locator(f"Z{i}", p, "z", 0) for i, p in enumerate([(0, 0, 0), (20, 0, 0), (10, 1, 0)])]
            about = [tc.Locator("X", (-20, y, 0), "x", 0), tc.Locator("Y", (-20, y, 0), "y", 0)]
            a.locate(plate, [*rest, *about, tc.Locator("T", (10, y, 0), "y", norm(0, sigma))], on=hub)
            both[side] = plate
        faces.append(both)
    for k in range(wedges):
        moving, reference = faces[(k + 1) % wedges]["behind"].face("-y"), faces[k]["ahead"].face("+y")
        a.contact(f"joint {k}", moving=moving, reference=reference, points=9, within=5)
    a.measure("x", faces[0]["ahead"].point(0, 0, 0), along="x", tolerance=1)
    return a


def ring_opening(wedges: int, sigma: float = 0.05) -> float:
    """What the hinged ring is open nominally, at 30 mm from the axis [mm]: some 19 % of the draws exceed it."""
    return 0.87 * sigma * np.sqrt(2 * wedges)


def excess_of_hinged_ring(nominal, deviations: np.ndarray, sigma: float = 0.05) -> np.ndarray:
    """By how much (realization,) the wedges are wider than the full turn, at 30 mm from the axis [mm]."""
    labels = nominal.locators.labels
    wide = sum(
        (1.0 if label.startswith("ahead") else -1.0) * deviations[:, column]
        for column, label in enumerate(labels)
        if label.endswith(".T") and not label.startswith("hub")
    )
    return wide - ring_opening(sum(label.startswith("ahead") for label in labels) // 6, sigma)


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


def shaft_in_a_v(sections: int = 720, sigma: float = 0.02, radius: float = 10.0, **points) -> tc.Assembly:
    """A shaft along y under its weight in a V of two plates at 45 degrees, whose heights vary.

    Its axis comes to (left + right) / sqrt 2 above its nominal place.
    """
    a = tc.Assembly("V")
    plates = []
    for name, turn in (("left", -np.pi / 4), ("right", np.pi / 4)):
        frame = Frame(turn=(0, turn, 0))
        plate = a.part(name, tc.Box(40, 80, 5), **frame.place(-20, -40, -5), fixed=True)
        rest = {
            "RX": ((20, 0, 2), "y"),
            "X1": ((0, 40, 0), "x"),
            "X2": ((0, 40, 5), "x"),
            "X3": ((0, 80, 2), "x"),
            "Y": ((20, 0, 4), "y"),
        }
        held = [tc.Locator(key, p, d, 0) for key, (p, d) in rest.items()]
        a.locate(plate, [tc.Locator("H", (20, 40, 5), "z", norm(0, sigma)), *held])
        plates.append(plate)
    shape = trimesh.creation.cylinder(radius=radius, height=60, sections=sections)
    shape.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    shaft = a.part("shaft", tc.Mesh(shape), at=(0, 0, radius * np.sqrt(2)), fixed=False)
    stops = parked("Z1:0,-25,-10:z", "Z2:0,25,-10:z", "X1:-10,-25,0:x", "X2:-10,25,0:x", "T:0,0,10:x")
    a.locate(shaft, [tc.Locator("Y", (0, -30, 0), "y", 0), *stops])
    a.force("weight", at=shaft.point(0, 0, 0), vector=(0, 0, -10))
    for plate in plates:
        barrel = shaft.face(lambda c, n: abs(n[:, 1]) < 0.1)
        a.contact(f"{plate.name} wall", moving=barrel, reference=plate.face("+z"), **points)
    a.measure("height", shaft.point(0, 0, 0), along="z", tolerance=6 * sigma)
    return a


def peg_in_a_hole(clearance: float = 0.05, tolerance: float = 0.2) -> tc.Assembly:
    """A round peg, free to spin, that a force pushes to the side of a hole whose place varies."""
    a = tc.Assembly("peg")
    plate = a.part("plate", tc.Mesh(trimesh.creation.annulus(5 + clearance, 20, 10, sections=720)), fixed=True)
    peg = a.part("peg", tc.Mesh(trimesh.creation.cylinder(5, 20, sections=720)), fixed=False)
    feet = [tc.Locator(f"Z{k}", (x, y, -5), "z", 0) for k, (x, y) in enumerate([(20, 0), (-20, 0), (0, 20)])]
    sides = [tc.Locator(f"S{k}", (x, 0, 0), along, tolerance) for k, (x, along) in enumerate([(0, "x"), (0, "y"), (20, "y")])]
    a.locate(plate, [*feet, *sides])
    ends = [tc.Locator(f"Z{k}", (x, y, -10), "z", 0) for k, (x, y) in enumerate([(0, 0), (5, 0), (0, 5)])]
    a.locate(peg, [*ends, *parked("X:-5,0,0:x", "Y1:0,-5,0:y", "Y2:4,-3,0:y")])
    a.force("push", at=peg.point(0, 0, 0), vector=(1, -2, 0))
    wall = plate.face(lambda c, n: (abs(n[:, 2]) < 0.1) & (np.hypot(c[:, 0], c[:, 1]) < 10))
    a.contact("fit", moving=peg.face(lambda c, n: abs(n[:, 2]) < 0.1), reference=wall)
    a.measure("x", peg.point(0, 0, 0), along="x", tolerance=tolerance)
    return a


def ball_in_a_cone(tolerance: float = 0.2) -> tc.Assembly:
    """A ball under its weight in a cone of 90 degrees that is off its place and askew: its centre comes to 10 sqrt 2 above."""
    a = tc.Assembly("ball")
    profile = np.array([[4, -8], [20, 8], [22, 8], [22, -10], [4, -10], [4, -8]], dtype=float)
    shape = trimesh.creation.revolve(profile, sections=720)
    shape.invert()
    seat = a.part("seat", tc.Mesh(shape), fixed=True)
    ball = a.part("ball", tc.Mesh(trimesh.creation.icosphere(5, 10)), at=(0, 0, 10 * np.sqrt(2) - 12), fixed=False)
    places = [((20, 0), "z"), ((-20, 0), "z"), ((0, 20), "z"), ((0, 0), "x"), ((0, 0), "y"), ((20, 0), "y")]
    a.locate(seat, [tc.Locator(f"L{k}", (*xy, -10), along, tolerance) for k, (xy, along) in enumerate(places)])
    a.locate(ball, parked("Z1:5,0,-8:z", "Z2:-5,0,-8:z", "Z3:0,5,-8:z", "X:-10,0,0:x", "Y1:0,-10,0:y", "Y2:3,-9,0:y"))
    a.force("weight", at=ball.point(0, 0, 0), vector=(0, 0, -10))
    hollow = seat.face(lambda c, n: (n[:, 2] > 0.3) & (np.hypot(c[:, 0], c[:, 1]) < 19.9))
    a.contact("seat", moving=ball.face(lambda c, n: n[:, 2] < -0.2), reference=hollow)
    a.measure("height", ball.point(0, 0, 0), along="z", tolerance=tolerance)
    return a
