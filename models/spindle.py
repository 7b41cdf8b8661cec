"""A spindle on two bearing seats: how far does its nose run out, and how does it lie in the bearings' rings?

The seats are one common datum A-B; the nose is toleranced to it with total run-out, its face with axial run-out, and the seats
vary in size. The rings stand in a housing whose front bore is off its place; the spindle floats in them with its clearance,
and its weight presses it down. Expected: the axis of the nose shifts with the bores, and down by half the clearance; any
further run-out is that of the spindle itself. Dimensions were chosen for this model.

y along the spindle, z up. Lengths in mm. A tolerance is the full width of its zone.
"""

import numpy as np
import trimesh

import tolcontact as tc

SEAT, NOSE, CLEARANCE = 25.0, 40.0, 0.02  # diameters, and of the rings beyond the seats
SEATS = {"front": -60.0, "rear": -160.0}  # where they are along the spindle
WIDTH, LONG = 16.0, 30.0  # of a seat; of the nose, which ends at 0


def turned(radius: float, low: float, high: float) -> trimesh.Trimesh:
    """Return a cylinder along y."""
    shape = trimesh.creation.cylinder(radius, high - low, sections=64)
    shape.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    return shape.apply_translation((0, (low + high) / 2, 0))


def assembly() -> tc.Assembly:
    model = tc.Assembly("spindle", method=tc.Method(resolution="exact", objective="seating"))
    seats = [turned(SEAT / 2, y - WIDTH / 2, y + WIDTH / 2) for y in SEATS.values()]
    rod = trimesh.util.concatenate([turned(10, -180, -LONG), *seats, turned(NOSE / 2, -LONG, 0)])
    spindle = model.part("spindle", tc.Mesh(rod))
    own = {}
    for letter, (name, y) in zip("AB", SEATS.items(), strict=True):
        where = tc.select.Inside((-20, y - WIDTH, -20), (20, y + WIDTH, 20))
        own[name] = spindle.feature(
            name, spindle.face(tc.select.Cylinder(radius=SEAT / 2), where), tc.Size(SEAT, 0.005), datum=letter
        )
    nose = spindle.feature("nose", spindle.face(tc.select.Cylinder(radius=NOSE / 2)), tc.TotalRunout(0.02, "A-B"))
    front = spindle.face("+y", lambda c, n: abs(c[:, 1]) < 1e-6)
    face = spindle.feature("face", front, tc.TotalRunout(0.01, "A-B"))
    rings = []
    for name, y in SEATS.items():
        shape = trimesh.creation.annulus((SEAT + CLEARANCE) / 2, 30, WIDTH + 4, sections=64)
        shape.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
        ring = model.part(f"{name} ring", tc.Mesh(shape), at=(0, y, 0), fixed=True)
        level = [((0, 0, -30), "z"), ((0, 8, -30), "z"), ((30, 0, 0), "z")]  # shifts, and does not turn
        side = [((0, 0, 0), "x"), ((0, 8, 0), "x"), ((0, -10, 0), "y")]
        held = [*level, *side]
        model.locate(ring, [tc.Locator(f"{d}{k}", p, d, 0.0) for k, (p, d) in enumerate(held)])
        rings.append(ring)
        model.contact(name, moving=own[name], reference=ring.face(tc.select.Cylinder(inner=True)))
    for axis in "xz":
        drives = {f"{rings[0].name}.{axis}{k}": 1.0 for k in range(6) if f"{axis}{k}" in ("x3", "x4", "z0", "z1", "z2")}
        model.variable(f"front bore, {axis}", tc.Tolerance(0.02), drives=drives)
    model.locate(spindle, [tc.Locator("shoulder", (0, -180, 0), "y", 0.0)], floating=True)
    model.force("weight", at=spindle.point(0, -80, 0), vector=(0, 0, -20))
    model.measure("nose up", nose.axis(1), along="z", tolerance=0.05)
    model.measure("nose aside", nose.axis(1), along="x", tolerance=0.05)
    model.measure("face runs out", face.point(0, 0, NOSE / 2), to=face.point(0, 0, -NOSE / 2), along="y", tolerance=0.02)
    return model


if __name__ == "__main__":
    tc.main(assembly)  # the same as: tolcontact run models/spindle.py
