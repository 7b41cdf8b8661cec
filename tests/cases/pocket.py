"""A rectangular pocket with four freedoms (CASES C5)."""

import tolcontact as tc

WIDTH = 0.31


def pocket() -> tc.Assembly:
    """A male part in a pocket; the gap is the lesser one of both measures."""
    a = tc.Assembly("pocket")
    corners = {}
    for name, length in (("male", 99.8), ("pocket", 100.0)):
        part = a.part(name, tc.Box(length, 10, 5), fixed=True)
        part.feature("stop", part.face("-x"), datum="A")
        # Equal spreads t / 6 of the offset and of both tilts; the second tilt does nothing in the middle of the face.
        wall = part.feature("wall", part.face("+x"), tc.Position(WIDTH / 6 * 11.7683, "A"))
        corners[name] = [wall.point(length, y, 2.5) for y in (0, 10)]
    for k in (0, 1):
        a.measure(f"gap {k}", corners["male"][k], to=corners["pocket"][k], along="x")
    return a
