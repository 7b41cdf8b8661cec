"""A bracket that hangs on two bolts with nuts: how far does it sag in their clearance, and does it hang level?

Bolts M10 pass holes of 11 mm in the bracket and in the wall plate. Holes vary in size and place, shanks in diameter; the weight
presses bracket and bolts down. Expected: each end sags by both clearances of its bolt, 1 mm and half of what the sizes deviate,
and by what its two holes are off their places; the bracket hangs as far from level as both ends differ. By H - F = T all bolts
go in: holes of 10.95 at least, shanks of 10 at most, positions of 0.9. Dimensions were chosen for this model.

x along the bracket, y up, z out of the wall. Lengths in mm. A tolerance is the full width of its zone; sizes have limits.
"""

import trimesh

import tolcontact as tc

HOLE, BOLT, SHEET, APART = 11.0, 10.0, 8.0, 90.0  # diameters, thickness of both plates, distance of the holes
PLACE, DRILLED = 0.9, 0.05  # tolerances: position of a hole, its size to either side
SHANK = tc.Size(BOLT, 0.0, -0.1)


def plate(model: tc.Assembly, name: str, z: float, fixed: bool | None = None) -> tuple[tc.Part, list[tc.declaration.Feature]]:
    """Declare a bar between two eyes, with its back at a height z, and the holes in the eyes."""
    eyes = [trimesh.creation.annulus(HOLE / 2, 14, SHEET, sections=48).apply_translation((x, 0, SHEET / 2)) for x in XS]
    bar = trimesh.creation.box(bounds=[(-APART / 2 + 14, -14, 0), (APART / 2 - 14, 14, SHEET)])
    part = model.part(name, tc.Mesh(trimesh.util.concatenate([bar, *eyes])), at=(0, 0, z), fixed=fixed)
    for letter, direction in {"A": "-z", "B": "-y"}.items():
        part.feature(letter, part.face(direction, tc.select.Inside((-30, -15, -1), (30, 15, SHEET + 1))), datum=letter)
    middle = tc.select.Inside((-31.1, -15, -1), (-30.9, 15, SHEET + 1))
    part.feature("C", part.face("-x", middle), datum="C")
    walls = [
        part.face(tc.select.Cylinder(radius=HOLE / 2), tc.select.Inside((x - 9, -9, -1), (x + 9, 9, SHEET + 1))) for x in XS
    ]
    tolerances = tc.Size(HOLE, DRILLED), tc.Position(PLACE, "A|B|C", rule="translation")
    return part, [part.feature(f"hole {k}", wall, *tolerances) for k, wall in enumerate(walls, start=1)]


XS = (-APART / 2, APART / 2)


def assembly() -> tc.Assembly:
    model = tc.Assembly("bracket", method=tc.Method(resolution="exact", objective="seating"))
    _, holes_of_wall = plate(model, "wall", 0.0, fixed=True)
    bracket, holes = plate(model, "bracket", SHEET)
    back = [tc.Locator(f"A{k}", (x, y, 0), "z", 0.0) for k, (x, y) in enumerate([(-45, -12), (45, -12), (0, 12)], start=1)]
    model.locate(bracket, back, floating=True)
    for number, (hole, hole_of_wall) in enumerate(zip(holes, holes_of_wall, strict=True), start=1):
        x = XS[number - 1]
        seat = bracket.face("+z", tc.select.Inside((x - 15, -15, 0), (x + 15, 15, SHEET + 1)))
        tc.fasten(model, f"bolt {number}", SHANK, through=[hole, hole_of_wall], seat=seat)
    model.force("weight", at=bracket.point(10, 0, SHEET), vector=(0, -50, 0))
    for name, x in (("left end", XS[0]), ("right end", XS[1])):
        model.measure(name, bracket.point(x, 0, SHEET), along="y", limits=(-1.6, 0))
    return model


if __name__ == "__main__":
    tc.main(assembly)  # the same as: tolcontact run models/bracket.py
