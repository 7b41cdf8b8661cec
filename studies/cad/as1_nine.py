"""Nine bodies of the assembly "as1": two brackets on a plate, three bolts through one of them, a rod through both, its nuts.

Holes have clearance and are off their places; contact moves brackets, bolts, rod and nuts to where they fit. Measured are
the gap between the brackets' feet, how flush their tops are, and the room between the rod's nuts. Sizes of holes and all
tolerances were chosen for this model. A tolerance is the full width of its zone [mm].

    tolcontact worst studies/cad/as1_nine.py
"""

from pathlib import Path

import tolcontact as tc

FILE = Path(__file__).with_name("as1-oc-214.stp")
BOLTS = ["bolt_1", "bolt_1 (2)", "bolt_1 (3)"]
IN_PLATE, IN_FOOT, IN_BACK = (14, 8, 6), (13, 11, 9), 6  # a face of each hole, in the order of the bolts
CLEARED, SHANK = tc.Size(10, 0.4, 0.2), tc.Size(10, 0.0, -0.1)  # of holes, and of bolts and rod
PLACED = 0.4


def datums(part: tc.Part, *directions: str) -> None:
    """Declare the largest planes of a part along three directions as its datums A, B and C."""
    for letter, direction in zip("ABC", directions, strict=True):
        part.feature(letter, part.face(tc.select.Largest("plane", direction)), datum=letter)


def hole(part: tc.Part, name: str, face: int) -> tc.declaration.Feature:
    """Declare a hole with clearance, within 0.2 mm of its place."""
    return part.feature(name, part.face(tc.select.Brep(face, whole=True)), CLEARED, tc.Position(0.2, "A|B|C"))


def placed(model: tc.Assembly, part: tc.Part, *faces: tc.declaration.Face) -> None:
    """Locate a part by three of its faces."""
    model.locate(part, tc.three_two_one(*faces, inset=2), tolerance=PLACED)


def assembly() -> tc.Assembly:
    model = tc.Assembly("as1, nine bodies", method=tc.Method(resolution="exact", objective="all points"))
    plate = tc.io.parts_from(model, FILE, ["plate_1"], fixed=True)["plate_1"]
    near, far, rod, far_nut, near_nut, *bolts = tc.io.parts_from(
        model, FILE, ["l-bracket_1", "l-bracket_1 (2)", "rod_1", "nut_1", "nut_2", *BOLTS]
    ).values()
    datums(plate, "-z", "-y", "-x")
    for bracket in (near, far):
        datums(bracket, "-y", "-x", "-z")
        foot, back = bracket.face(tc.select.Largest("plane", "-y")), bracket.face(tc.select.Largest("plane", "-x"))
        placed(model, bracket, foot, back, bracket.face("-z"))
        model.contact(f"foot of {bracket.name}", moving=foot, reference=plate.face(tc.select.Largest("plane", "+z")))
    for bolt, in_plate, in_foot in zip(bolts, IN_PLATE, IN_FOOT, strict=True):
        shank = bolt.feature("shank", bolt.face(tc.select.Cylinder(radius=5)), SHANK)
        model.locate(bolt, [], floating=True, on=near)
        model.contact(f"{bolt.name} in plate", moving=shank, reference=hole(plate, f"hole of {bolt.name}", in_plate))
        model.contact(f"{bolt.name} in foot", moving=shank, reference=hole(near, f"hole of {bolt.name}", in_foot))
    rod_surface = rod.feature("surface", rod.face(tc.select.Cylinder(radius=5)), SHANK)
    model.locate(rod, [], floating=True)
    for bracket in (near, far):
        model.contact(f"rod in {bracket.name}", moving=rod_surface, reference=hole(bracket, "hole of the rod", IN_BACK))
    for nut, bracket, side in ((far_nut, far, "-z"), (near_nut, near, "+z")):
        bearing = nut.face(tc.select.Largest("plane", side))
        placed(model, nut, bearing, nut.face("-y"), nut.face("-x"))
        model.contact(f"{nut.name} on {bracket.name}", moving=bearing, reference=bracket.face(tc.select.Largest("plane", "-x")))
    model.measure("gap of the feet", near.point(50, 5, 50), to=far.point(50, 5, 50), along="x", tolerance=1)
    model.measure("flush of the tops", near.point(5, 60, 50), to=far.point(5, 60, 50), along="z", tolerance=1)
    model.measure("between the nuts", near_nut.point(10, 7.5, 3), to=far_nut.point(10, 7.5, 0), along="x", tolerance=1)
    return model


if __name__ == "__main__":
    tc.main(assembly)
