"""Curved faces: shafts, pegs, balls and rollers of many triangles."""

import numpy as np
import trimesh
from scipy.stats import norm

import tolcontact as tc
from tests.cases.frames import Frame
from tests.cases.locators import parked


def rollers(tangential: float = 6.0, sections: int = 720) -> tc.Assembly:
    """A roller that is set down beside the top (+y) of another one; their axes (z) stay parallel."""
    a = tc.Assembly("rollers")
    shape = tc.Mesh(trimesh.creation.cylinder(radius=10, height=10, sections=sections))
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


def ball_in_a_cone(tolerance: float = 0.2, sections: int = 720, subdivisions: int = 5) -> tc.Assembly:
    """A ball under its weight in a cone of 90 degrees that is off its place and askew: its centre comes to 10 sqrt 2 above."""
    a = tc.Assembly("ball")
    profile = np.array([[4, -8], [20, 8], [22, 8], [22, -10], [4, -10], [4, -8]], dtype=float)
    shape = trimesh.creation.revolve(profile, sections=sections)
    shape.invert()
    seat = a.part("seat", tc.Mesh(shape), fixed=True)
    ball = a.part("ball", tc.Mesh(trimesh.creation.icosphere(subdivisions, 10)), at=(0, 0, 10 * np.sqrt(2) - 12), fixed=False)
    places = [((20, 0), "z"), ((-20, 0), "z"), ((0, 20), "z"), ((0, 0), "x"), ((0, 0), "y"), ((20, 0), "y")]
    a.locate(seat, [tc.Locator(f"L{k}", (*xy, -10), along, tolerance) for k, (xy, along) in enumerate(places)])
    a.locate(ball, parked("Z1:5,0,-8:z", "Z2:-5,0,-8:z", "Z3:0,5,-8:z", "X:-10,0,0:x", "Y1:0,-10,0:y", "Y2:3,-9,0:y"))
    a.force("weight", at=ball.point(0, 0, 0), vector=(0, 0, -10))
    hollow = seat.face(lambda c, n: (n[:, 2] > 0.3) & (np.hypot(c[:, 0], c[:, 1]) < 19.9))
    a.contact("seat", moving=ball.face(lambda c, n: n[:, 2] < -0.2), reference=hollow)
    a.measure("height", ball.point(0, 0, 0), along="z", tolerance=tolerance)
    return a
