"""Battery cells in a row between two end plates: do their terminals stay in pitch for the busbar?

Each cell is set into a tray, off its place by the tolerance of its pocket, and tilted accordingly; two neighbours are
nominally 0.2 mm apart. Without contact they pass through each other; with contact they push each other along, the plates hold
the row, and there is always room, since the clearances add up. Expected: contact reduces the variation of a terminal along the
row, but least in the middle, where cells have most room to move; a pitch varies much less. All cells move together, so the
model asks for the exact resolution and all points. Dimensions are those of a prismatic car battery cell; ranges are guesses.

x along the row, z up. Lengths in mm. A tolerance is the full width of its zone.
"""

import itertools

import tolcontact as tc

CELLS = 8
THICKNESS, WIDTH, HEIGHT = 26.5, 148.0, 102.0
CLEARANCE = 0.2  # between two neighbours, and to the end plates
PITCH = THICKNESS + CLEARANCE
PLATE = 10.0
POCKET, FLOOR = 1.0, 0.4  # tolerances of a pocket: along and across the row, upright
TERMINAL = (THICKNESS / 2, 30.0, HEIGHT)


def pocket() -> list[tc.Locator]:
    """How the tray holds a cell: its large face at three points along the row, its floor at two, its side at one."""
    return [
        tc.Locator("A1", (0, 10, 10), "x", POCKET),
        tc.Locator("A2", (0, WIDTH - 10, 10), "x", POCKET),
        tc.Locator("A3", (0, WIDTH / 2, HEIGHT - 10), "x", POCKET),
        tc.Locator("B1", (THICKNESS / 2, 10, 0), "z", FLOOR),
        tc.Locator("B2", (THICKNESS / 2, WIDTH - 10, 0), "z", FLOOR),
        tc.Locator("C1", (THICKNESS / 2, 0, HEIGHT / 2), "y", POCKET),
    ]


def assembly() -> tc.Assembly:
    model = tc.Assembly("cells", method=tc.Method(resolution="exact", objective="all points"))
    row = [model.part("first plate", tc.Box(PLATE, WIDTH, HEIGHT), at=(-PLATE - CLEARANCE, 0, 0), fixed=True)]
    for k in range(CELLS):
        row.append(model.part(f"cell {k + 1}", tc.Box(THICKNESS, WIDTH, HEIGHT), at=(k * PITCH, 0, 0)))
        model.locate(row[-1], pocket())
    row.append(model.part("last plate", tc.Box(PLATE, WIDTH, HEIGHT), at=(CELLS * PITCH, 0, 0), fixed=True))
    for left, right in itertools.pairwise(row):
        sides = [right.face("-x"), left.face("+x")]
        moving, reference = sides if right is not row[-1] else sides[::-1]  # the plates stay
        model.contact(f"{left.name}, {right.name}", moving=moving, reference=reference, points=30)
    first, middle, after = row[1], row[CELLS // 2], row[CELLS // 2 + 1]
    model.measure("first terminal", first.point(*TERMINAL), along="x", tolerance=1)
    model.measure("middle terminal", middle.point(*TERMINAL), along="x", tolerance=1)
    model.measure("pitch in the middle", middle.point(*TERMINAL), to=after.point(*TERMINAL), along="x", tolerance=1)
    return model


if __name__ == "__main__":
    tc.main(assembly)  # the same as: tolcontact run models/cells.py
