"""A car door in its opening: are gap and flush to the body even, once the bump stops are loaded?

The door hangs on two hinges and a striker, whose places on the body vary; four bump stops are fixed to the body's flange, each
with a height that varies by its own tolerance, and the door cannot go through them. Expected: without contact flush varies as
hinges and striker do; with contact the door is pushed outwards by a stop that is in its way, so that flush shifts outwards and
varies less. Gaps lie along the faces of the stops and hardly change. Dimensions are those of a mid-size car's front door,
rounded; tolerances are usual in bodywork.

x backward, y outward, z up. Lengths in mm. A tolerance is the full width of its zone.
"""

import trimesh

import tolcontact as tc

LENGTH, THICKNESS, HEIGHT = 1000.0, 40.0, 700.0
GAP, FLANGE = 4.0, 30.0  # around the door; width of the flange behind it
STOP = 20.0  # a bump stop is a pad of this side
STOPS = {"front top": (60.0, 640.0), "front bottom": (60, 60), "rear top": (940, 640), "rear bottom": (940, 60)}
HINGES, STRIKER = {"upper": (0, 550), "lower": (0, 150)}, (1000, 350)
SEAMS = {
    "rear top": (LENGTH, 600, "x"),
    "rear middle": (LENGTH, 350, "x"),
    "rear bottom": (LENGTH, 100, "x"),
    "top": (500, HEIGHT, "z"),
}
HINGE_X, HINGE_Y, HINGE_Z, STRIKER_Y, STOP_Y = 1.2, 1.0, 1.0, 1.5, 0.6  # tolerances


def opening() -> trimesh.Trimesh:
    """Return the body around the door as eight bars: its skin, flush with the door's, and the flange behind."""
    low, high_x, high_z = -GAP, LENGTH + GAP, HEIGHT + GAP
    bars = []
    for y, inner, outer in ((THICKNESS, 0.0, 150.0), (-2.0, FLANGE, 150.0)):
        y_range = (y - 2, y)
        for x_range, z_range in (
            ((low - outer, low + inner), (low - outer, high_z + outer)),
            ((high_x - inner, high_x + outer), (low - outer, high_z + outer)),
            ((low + inner, high_x - inner), (low - outer, low + inner)),
            ((low + inner, high_x - inner), (high_z - inner, high_z + outer)),
        ):
            ranges = (x_range, y_range, z_range)
            bars.append(trimesh.creation.box(bounds=[[r[k] for r in ranges] for k in (0, 1)]))
    return trimesh.util.concatenate(bars)


def over(x: float, z: float) -> tc.select.Inside:
    """Choose the part of the door over the stop at (x, z)."""
    return tc.select.Inside((x - STOP / 2, -1, z - STOP / 2), (x + STOP / 2, 1, z + STOP / 2))


def assembly() -> tc.Assembly:
    model = tc.Assembly("door")
    body = model.part("body", tc.Mesh(opening()), fixed=True)
    door = model.part("door", tc.Box(LENGTH, THICKNESS, HEIGHT))
    (ux, uz), (lx, lz), (sx, sz) = HINGES["upper"], HINGES["lower"], STRIKER
    model.locate(
        door,
        [
            tc.Locator("upper hinge y", (ux, 0, uz), "y", HINGE_Y),
            tc.Locator("lower hinge y", (lx, 0, lz), "y", HINGE_Y),
            tc.Locator("striker y", (sx, 0, sz), "y", STRIKER_Y),
            tc.Locator("upper hinge x", (ux, 0, uz), "x", HINGE_X),
            tc.Locator("lower hinge x", (lx, 0, lz), "x", HINGE_X),
            tc.Locator("hinges z", (lx, 0, lz), "z", HINGE_Z),
        ],
        on=body,
    )
    for name, (x, z) in STOPS.items():
        stop = model.part(f"{name} stop", tc.Box(STOP, 2, STOP), at=(x - STOP / 2, -2, z - STOP / 2), fixed=True)
        stop.feature("foot", stop.face("-y"), datum="A")
        height = stop.feature("height", stop.face("+y"), tc.Profile(STOP_Y, "A", rule="translation"))
        model.contact(name, moving=door.face("-y", over(x, z)), reference=height, spacing=STOP / 2)
    for name, (x, z, along) in SEAMS.items():
        at_door = door.point(x, THICKNESS, z)
        across = (x + GAP * (along == "x"), THICKNESS, z + GAP * (along == "z"))
        model.measure(f"gap {name}", at_door, to=body.point(*across), along=along, tolerance=2)
        model.measure(f"flush {name}", body.point(*across), to=at_door, along="y", tolerance=2)
    return model


if __name__ == "__main__":
    tc.main(assembly)  # the same as: tolcontact run models/door.py
