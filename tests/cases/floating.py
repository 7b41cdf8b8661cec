"""Parts that contact alone holds in some directions, with features that vary; answers in closed form, or from scipy."""

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.cases.frames import STILL, Frame

BARREL, BORE = tc.select.Cylinder(inner=False), tc.select.Cylinder(inner=True)
SEATED = tc.Method(resolution="exact", objective="seating")


def flat_feet(z: float = 0.0) -> list[tc.Locator]:
    """Three exact locators along z: what they hold may shift and turn in the plane."""
    return [tc.Locator(f"Z{k}", (x, y, z), "z", 0) for k, (x, y) in enumerate([(5, 0), (-5, 0), (0, 5)])]


def floating_shaft_in_a_v(sections: int = 48, radius: float = 10.0, frame: Frame | None = None) -> tc.Assembly:
    """A shaft along y whose diameter varies, under its weight in a V of two plates whose faces do.

    Its axis comes to (left + right + diameter) / sqrt 2 above its nominal place: deviations of the offsets and of the diameter.
    """
    base = frame or STILL
    a = tc.Assembly("V", method=SEATED)
    shape = trimesh.creation.cylinder(radius=radius, height=60, sections=sections)
    shape.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    shaft = a.part("shaft", tc.Mesh(shape), **base.place(0, 0, radius * np.sqrt(2)))
    a.locate(shaft, [tc.Locator("Y", (0, -30, 0), "y", 0.3)], floating=True)
    barrel = shaft.feature("barrel", shaft.face(BARREL), tc.Size(2 * radius, 0.03, -0.05))
    a.force("weight", at=shaft.point(0, 0, 0), vector=base.along(0, 0, -10))
    for name, turn in (("left", -np.pi / 4), ("right", np.pi / 4)):
        own = Frame((base.R * Rotation.from_rotvec((0, turn, 0))).as_rotvec(), base.shift)
        plate = a.part(name, tc.Box(40, 80, 5), **own.place(-20, -40, -5), fixed=True)
        plate.feature("back", plate.face("-z"), datum="A")
        wall = plate.feature("wall", plate.face("+z"), tc.Profile(0.1, "A", rule="translation"))
        a.contact(f"{name} wall", moving=barrel, reference=wall)
    a.measure("height", shaft.point(0, 0, 0), along=base.along(0, 0, 1))
    a.measure("top", barrel.point(0, 0, radius), along=base.along(0, 0, 1))
    return a


def floating_peg_in_a_hole(clearance: float = 0.1, sections: int = 48) -> tc.Assembly:
    """A peg that a force pushes along (1, -2) to the side of a hole; sizes and the place of the hole vary.

    Its axis comes to that of the hole, and half of what the diameters differ by towards the force.
    """
    a = tc.Assembly("peg", method=SEATED)
    plate = a.part("plate", tc.Mesh(trimesh.creation.annulus(5 + clearance / 2, 20, 10, sections=sections)), fixed=True)
    plate.feature("under", plate.face("-z"), datum="A")
    plate.feature("rim", plate.face(tc.select.Cylinder(radius=20)), datum="B")
    bore = plate.feature(
        "bore", plate.face(BORE), tc.Size(10 + clearance, 0.03, -0.03), tc.Position(0.2, "A|B", rule="translation")
    )
    peg = a.part("peg", tc.Mesh(trimesh.creation.cylinder(5, 20, sections=sections)))
    barrel = peg.feature("barrel", peg.face(BARREL), tc.Size(10, 0.02, -0.04))
    a.locate(peg, flat_feet(-10), floating=True)
    a.contact("fit", moving=barrel, reference=bore)
    a.force("push", at=peg.point(0, 0, 0), vector=(1, -2, 0))
    for axis in "xy":
        a.measure(f"{axis} to bore", bore.axis(0), to=peg.point(0, 0, 0), along=axis)
        a.measure(f"bore {axis}", bore.axis(1), along=axis)
    return a


def hinge(clearance: float = 0.1, reach: float = 40.0, width: float = 8.0) -> tc.Assembly:
    """A pin, free to turn, that a force at its middle pushes up (+y) in two knuckles whose bores vary in size."""
    a = tc.Assembly("hinge", method=SEATED)
    pin = a.part("pin", tc.Mesh(trimesh.creation.cylinder(4, 2 * reach + 3 * width, sections=48)))
    barrel = pin.feature("barrel", pin.face(BARREL), tc.Size(8, 0.02))
    a.locate(pin, [tc.Locator("end", (0, 0, -reach - 1.5 * width), "z", 0.2)], floating=True)
    for name, z in (("low", -reach), ("high", reach)):
        ring = trimesh.creation.annulus(4 + clearance / 2, 9, width, sections=48)
        knuckle = a.part(name, tc.Mesh(ring), at=(0, 0, z), fixed=True)
        bore = knuckle.feature("bore", knuckle.face(BORE), tc.Size(8 + clearance, 0.06, -0.03))
        a.contact(f"{name} fit", moving=barrel, reference=bore)
    a.force("push", at=pin.point(0, 0, 0), vector=(0, 5, 0))
    a.measure("lift", pin.point(0, 0, 0), along="y")
    return a


def lid_on_studs(
    position: float = 0.3, sizes: float = 0.05, clearance: float = 0.2, half: float = 30.0, seating: bool = True, **hole
) -> tc.Assembly:
    """A lid with four holes over four studs of a base, pushed along x; all of them off their places, the holes also in size.

    The lid lies on its locators and is free in their plane. `hole` has further words for the position of the holes.
    """
    method = SEATED if seating else tc.Method(resolution="exact", objective="all points")
    a = tc.Assembly("lid", method=method)
    places = [(x, y) for x in (-half, half) for y in (-half, half)]
    size = (4 * half, 4 * half, 2)
    rings, studs = (
        [shape.apply_translation((x, y, 0)) for x, y in places for shape in (make(),)]
        for make in (
            lambda: trimesh.creation.annulus(4 + clearance / 2, 6, 4, sections=32),
            lambda: trimesh.creation.cylinder(4, 8, sections=32),
        )
    )
    parts = {}
    for name, z, bodies, outside, fixed in (("lid", 3, rings, "-z", None), ("base", -5, studs, "+z", True)):
        slab = trimesh.creation.box(extents=size).apply_translation((0, 0, z))
        part = a.part(name, tc.Mesh(trimesh.util.concatenate([slab, *bodies])), fixed=fixed)
        level = z + (1 if outside == "+z" else -1)
        part.feature("slab", part.face(outside, lambda c, n, level=level: abs(c[:, 2] - level) < 1e-6), datum="A")
        part.feature("side", part.face("-x", lambda c, n: c[:, 0] < -1.9 * half), datum="B")
        part.feature("end", part.face("-y", lambda c, n: c[:, 1] < -1.9 * half), datum="C")
        parts[name] = part
    lid, base = parts["lid"], parts["base"]
    a.locate(lid, flat_feet(2), floating=True)
    for k, (x, y) in enumerate(places):

        def near(c, n, x=x, y=y):
            return np.hypot(c[:, 0] - x, c[:, 1] - y) < 5

        said = tc.Position(position, "A|B|C", rule="translation")
        bore = lid.feature(
            f"H{k}",
            lid.face(tc.select.Cylinder(radius=4 + clearance / 2, inner=True), near),
            tc.Size(8 + clearance, sizes),
            tc.Position(position, "A|B|C", rule="translation", **hole),
        )
        stud = base.feature(f"S{k}", base.face(tc.select.Cylinder(radius=4), near), said)
        a.contact(f"fit {k}", moving=bore, reference=stud)
    if seating:
        a.force("push", at=lid.point(0, 0, 0), vector=(3, 0, 0))
    a.measure("x", lid.point(0, 0, 0), along="x")
    return a


def drawn_of_lid(results) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shifts of the lid's holes and of the studs (realization, 4, 2) [mm], and half of the holes' deviations in size."""
    drawn = results["sample"].deviation

    def shifts(part: str) -> np.ndarray:
        of = [[drawn.sel(contributor=f"{part}{k}.shift {axis}").values for axis in "xy"] for k in range(4)]
        return np.array(of).transpose(2, 0, 1)

    sizes = np.array([drawn.sel(contributor=f"lid.H{k}.size").values for k in range(4)])
    return shifts("lid.H"), shifts("base.S"), sizes.T / 2
