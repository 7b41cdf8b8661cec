"""A cover on a housing with two dowel pins, a round hole and a slot: how far may its edges be off the housing's?

The pins are off their places by the tolerance of the holes that they are pressed into; the cover is set down by hand, up to
half a millimetre off, and the pins move it to where its hole (clearance 0.1 on the diameter) and its slot fit over them.
Expected: an edge deviates as much as the nearest pin, plus half the clearance; without contact the cover passes through its
pins. Pins and hole vary in size, too. They are round, so one linear step is not enough, and the model asks for the exact
resolution. Dimensions were chosen for this model; cover_cad.py makes both STEP files from them.

Needs the extra `tolcontact[step]`. Lengths in mm. A tolerance is the full width of its zone.
"""

from pathlib import Path

import trimesh

import tolcontact as tc

HERE = Path(__file__).parent
LENGTH, WIDTH, TOP, COVER = 120.0, 80.0, 40.0, 8.0
PINS = {"round": (15.0, 15.0), "slotted": (105.0, 65.0)}
PIN, HOLE = 8.0, 8.1  # diameters
INSERTED, PLACED = 0.1, 1.0  # tolerances of the place of a pin, and of the place where the cover is set down


def six(x: float, y: float, length: float, width: float) -> list[tc.Locator]:
    """Three points below, two at the side, one at the end of a part that is `length` by `width`, about (x, y)."""
    feet = [(x - length / 2, y - width / 2), (x + length / 2, y - width / 2), (x, y + width / 2)]
    return [
        *(tc.Locator(f"A{k + 1}", (*foot, 0), "z", 0.0) for k, foot in enumerate(feet)),
        tc.Locator("B1", (x - length / 2, y, 0), "y"),
        tc.Locator("B2", (x + length / 2, y, 0), "y"),
        tc.Locator("C1", (x, y, 0), "x"),
    ]


def assembly() -> tc.Assembly:
    model = tc.Assembly("cover", method=tc.Method(resolution="exact", objective="all points"))
    housing = model.part("housing", tc.Mesh(HERE / "housing.step"), fixed=True)
    cover = model.part("cover", tc.Mesh(HERE / "cover.step"), at=(0, 0, TOP))
    model.locate(cover, six(LENGTH / 2, WIDTH / 2, LENGTH, WIDTH), tolerance=PLACED)
    rim = housing.face("+z", tc.select.Inside((0, 0, TOP - 1), (LENGTH, WIDTH, TOP)))
    model.contact("seat", moving=cover.face("-z"), reference=rim, points=100)
    for name, (x, y) in PINS.items():
        stub = trimesh.creation.cylinder(PIN / 2, COVER, sections=180)
        pin = model.part(f"{name} pin", tc.Mesh(stub), at=(x, y, TOP + COVER / 2), fixed=True)
        model.locate(pin, six(0, 0, PIN, PIN), tolerance=INSERTED)
        barrel = pin.feature("barrel", pin.face(tc.select.Cylinder(radius=PIN / 2)), tc.Size(PIN, 0.0, -0.015))
        wall: tc.declaration.Face | tc.declaration.Feature = cover.face(tc.select.Near(pin, 0.2))
        if name == "round":
            wall = cover.feature("hole", cover.face(tc.select.Brep((x + HOLE / 2, y, 1))), tc.Size(HOLE, 0.03))
        model.contact(f"{name} hole", moving=wall, reference=barrel)
    for name, x, axis in (("near edge, x", 0, "x"), ("near edge, y", 0, "y"), ("far edge, y", LENGTH, "y")):
        model.measure(name, cover.point(x, WIDTH / 2, 0), along=axis, tolerance=0.3)
    return model


if __name__ == "__main__":
    tc.main(assembly)  # the same as: tolcontact run models/cover.py
