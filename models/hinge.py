"""An over-constrained hinge: a leaf with two knuckles on a pin in two lugs. Does it go together, and where does the leaf hang?

Pin and bores vary in size, and the bores in place. Pin and leaf float: contact alone holds them. Their weight presses the
pin into the bores of the lugs, and the knuckles onto the pin. Expected: the leaf hangs lower than nominal by both
clearances, more or less as bores are off their places; a pin that cannot go through all four bores ends as
`not_assemblable`. Dimensions were chosen for this model.

x along the pin, z up. Lengths in mm. A tolerance is the full width of its zone.
"""

import numpy as np
import trimesh

import tolcontact as tc

PIN, CLEARANCE, WIDTH = 10.0, 0.2, 12.0  # diameter, of the bores beyond it, and width of lugs and knuckles
LUGS, KNUCKLES = (-30.0, 30.0), (-16.0, 16.0)  # where they are on the pin
PLACE, BORE, SHAFT = 0.12, 0.06, 0.03  # tolerances: position of a bore, its size, size of the pin


def ring(x: float) -> trimesh.Trimesh:
    """Return a lug or a knuckle, with its bore along x."""
    shape = trimesh.creation.annulus((PIN + CLEARANCE) / 2, PIN, WIDTH, sections=48)
    shape.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    return shape.apply_translation((x, 0, 0))


def bored(
    model: tc.Assembly, name: str, xs: tuple[float, ...], plate: float, place: float, fixed: bool | None = None
) -> list[tc.declaration.Feature]:
    """Declare a part with a bore at each of `xs`, toleranced to its plate at a height, and to the plate's side and end."""
    slab = trimesh.creation.box(extents=(100, 60, 4)).apply_translation((0, 0, plate))
    part = model.part(name, tc.Mesh(trimesh.util.concatenate([slab, *map(ring, xs)])), fixed=fixed)
    for letter, direction, reach in (("A", "+z" if plate < 0 else "-z", 2), ("B", "-y", 30), ("C", "-x", 50)):
        k, sign = "xyz".index(direction[1]), -1 if direction[0] == "-" else 1
        level = sign * reach + (plate if k == 2 else 0)
        part.feature(letter, part.face(direction, lambda c, n, k=k, level=level: abs(c[:, k] - level) < 1e-6), datum=letter)
    return [
        part.feature(
            f"bore {number + 1}",
            part.face(tc.select.Cylinder(inner=True), tc.select.Inside((x - WIDTH, -PIN, -PIN), (x + WIDTH, PIN, PIN))),
            tc.Size(PIN + CLEARANCE, BORE / 2),
            tc.Position(place, "A|B|C"),
        )
        for number, x in enumerate(xs)
    ]


def assembly(place: float = PLACE) -> tc.Assembly:
    model = tc.Assembly("hinge", method=tc.Method(resolution="exact", objective="seating"))
    lugs = bored(model, "base", LUGS, -20.0, place, fixed=True)
    knuckles = bored(model, "leaf", KNUCKLES, 20.0, place)
    leaf = knuckles[0].part
    rod = trimesh.creation.cylinder(PIN / 2, 90, sections=48)
    rod.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0]))
    pin = model.part("pin", tc.Mesh(rod))
    barrel = pin.feature("barrel", pin.face(tc.select.Cylinder()), tc.Size(PIN, SHAFT / 2))
    model.locate(pin, [tc.Locator("end", (-45, 0, 0), "x", 0.0)], floating=True)
    model.locate(leaf, [tc.Locator("end", (-50, 0, 20), "x", 0.0), tc.Locator("closed", (0, 30, 18), "z", 0.0)], floating=True)
    for kind, bores in (("lug", lugs), ("knuckle", knuckles)):
        for number, bore in enumerate(bores):
            model.contact(f"{kind} {number + 1}", moving=barrel, reference=bore)
    model.force("weight of leaf", at=leaf.point(0, 0, 20), vector=(0, 0, -5))
    model.force("weight of pin", at=pin.point(0, 0, 0), vector=(0, 0, -0.5))
    for name, x in (("left", -50), ("right", 50)):
        model.measure(f"leaf, {name}", leaf.point(x, -30, 22), along="z", tolerance=1.2)
    return model


if __name__ == "__main__":
    tc.main(assembly)  # the same as: tolcontact run models/hinge.py
