"""A U-channel pushed into a U-channel without clearance: two opposed pairs of flanges and a web.

One linear step cannot open all gaps here: it enlarges a part that turns, and an enlarged part does not fit. The model
therefore asks for the exact resolution. Lengths in mm, angles in degrees. A tolerance is the full width of its zone.
"""

import numpy as np
import trimesh

import tolcontact as tc

WIDTH, DEPTH, HEIGHT, SHEET = 100.0, 50.0, 30.0, 3.0


def channel(half_width: float, floor: float, opening: float) -> trimesh.Trimesh:
    """Return a sheet-metal U along y: outer faces at z = `floor` and, where z = 0, x = +-half_width; flanges open upwards."""
    right = [(half_width + np.tan(np.radians(opening)) * z, z) for z in (floor, HEIGHT)]
    inside = [(half_width - SHEET + np.tan(np.radians(opening)) * z, z) for z in (HEIGHT, floor + SHEET)]
    half = right + inside
    profile = np.array([(-x, z) for x, z in half[1::-1]] + half + [(-x, z) for x, z in half[:1:-1]])
    corners = np.array([(x, y, z) for y in (0.0, DEPTH) for x, z in profile])
    front = [(0, 1, 6), (0, 6, 7), (1, 2, 5), (1, 5, 6), (2, 3, 4), (2, 4, 5)]
    back = [(a + 8, c + 8, b + 8) for a, b, c in front]
    around = [tri for i in range(8) for j in [(i + 1) % 8] for tri in ((i, i + 8, j + 8), (i, j + 8, j))]
    return trimesh.Trimesh(corners, front + back + around, process=False)


def assembly(opening: float = 0.0) -> tc.Assembly:
    """Declare the U in a U. The flanges lean outwards by the angle `opening` [deg]: only leaning ones let a part escape."""
    model = tc.Assembly("channel", method=tc.Method(resolution="exact"))
    outer = model.part("outer", tc.Mesh(channel(WIDTH / 2 + SHEET, -SHEET, opening)), fixed=True)
    inner = model.part("inner", tc.Mesh(channel(WIDTH / 2, 0, opening)))
    model.locate(
        inner,
        [
            tc.Locator("A1", (-25, 10, 0), "z"),
            tc.Locator("A2", (25, 10, 0), "z"),
            tc.Locator("A3", (0, 40, 0), "z"),
            tc.Locator("B1", (-50, 17, 15), "x"),
            tc.Locator("B2", (-50, 33, 15), "x"),
            tc.Locator("C1", (0, 0, 1.5), "y"),
        ],
        tolerance=5,
    )
    model.contact(
        "web", moving=inner.face("-z"), reference=outer.face(lambda c, n: (n[:, 2] > 0.9) & (c[:, 2] < 1)), points=100
    )
    for side, sign in (("left", -1), ("right", 1)):
        model.contact(
            side,
            moving=inner.face(lambda c, n, sign=sign: (n[:, 0] * sign > 0.9) & (c[:, 0] * sign > 49)),
            reference=outer.face(lambda c, n, sign=sign: (n[:, 0] * sign < -0.9) & (c[:, 0] * sign > 49)),
            points=100,
        )
    edge = inner.point(WIDTH / 2 + np.tan(np.radians(opening)) * HEIGHT, DEPTH, HEIGHT)
    model.measure("edge height", edge, along="z", tolerance=1)
    model.measure("edge offset", edge, along="x", tolerance=1)
    return model


if __name__ == "__main__":
    tc.main(assembly)
