"""A one-way clutch: by which angle does a roller jam between the hub's flat and the ring?

The classic of root-sum-square analysis: cos(phi) = (a + c) / (e - c), with the hub's flat at a = 27.645 +- 0.05, the roller's
radius c = 11.43 +- 0.01 and the ring's radius e = 50.8 +- 0.0125, where each +- is three standard deviations. This model does
not use the formula: hub, ring and roller vary as drawn, a spring presses the roller into the wedge, and the angle is where it
comes to rest. Expected: mean 7.0148 and standard deviation 0.2197 degrees.

Lengths in mm. A tolerance is the full width of its zone.
"""

import casadi as ca
import numpy as np
import trimesh

import tolcontact as tc

HUB, ROLLER, RING = 27.645, 11.43, 50.8
NOMINAL = np.arccos((HUB + ROLLER) / (RING - ROLLER))


def assembly() -> tc.Assembly:
    model = tc.Assembly("clutch", method=tc.Method(resolution="exact", objective="seating"))
    ring = model.part("ring", tc.Mesh(trimesh.creation.annulus(RING, 60, 20, sections=90)), fixed=True)
    hub = model.part("hub", tc.Box(2 * HUB, 2 * HUB, 20), at=(-HUB, -HUB, -10), fixed=True)
    place = (RING - ROLLER) * np.sin(NOMINAL), HUB + ROLLER, 0
    roller = model.part("roller", tc.Mesh(trimesh.creation.cylinder(ROLLER, 16, sections=90)), at=place)
    bore = ring.feature("bore", ring.face(tc.select.Cylinder(radius=RING)), tc.Size(2 * RING, 2 * 0.0125))
    hub.feature("bottom", hub.face("-y"), datum="A")
    flat = hub.feature("flat", hub.face("+y"), tc.Profile(2 * 0.05, "A", rule="translation"))
    barrel = roller.feature("barrel", roller.face(tc.select.Cylinder()), tc.Size(2 * ROLLER, 2 * 0.01))
    feet = [(0, 0), (5, 0), (0, 5)]
    model.locate(roller, [tc.Locator(f"Z{k}", (*foot, -8), "z", 0.0) for k, foot in enumerate(feet)], floating=True)
    model.contact("flat", moving=barrel, reference=flat)
    model.contact("ring", moving=barrel, reference=bore)
    model.force("spring", at=roller.point(0, 0, 0), vector=(10, 0, 0))

    def angle(poses) -> ca.SX:
        middle = poses.position(roller.point(0, 0, 0))
        return ca.atan2(middle[0], middle[1]) * 180 / ca.pi

    model.measure("angle", angle, units="degree", tolerance=2.0)
    return model


if __name__ == "__main__":
    tc.main(assembly)  # the same as: tolcontact run models/clutch.py
