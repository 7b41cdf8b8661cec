"""A tower of blocks, each set down on the one below: how high and how far out of place is the top?

Each block is placed by its own fixture, shifted and tilted as its locators vary. If it would sink into the one below, contact
pushes the two apart; where it hangs over a gap, it stays, since nothing presses it down. Expected: blocks do not sink into
each other, so the top is hardly ever lower than nominal; it is higher on average, and varies much less than without contact.
One free body per block: change BLOCKS to see how the time grows with the number of bodies.

The model asks for the exact resolution and all points: with "active points" a block that its neighbours hardly touch may slide
far away, and its realization is then doubtful.

z up. Lengths in mm. A tolerance is the full width of its zone.
"""

import tolcontact as tc

BLOCKS = 9
SIZE = (40.0, 40.0, 10.0)
FIXTURE = 1.0


def assembly(blocks: int = BLOCKS) -> tc.Assembly:
    """So many free `blocks` on a fixed one."""
    model = tc.Assembly("tower", method=tc.Method(resolution="exact", objective="all points"))
    below = model.part("block 0", tc.Box(*SIZE), fixed=True)
    for k in range(1, blocks + 1):
        block = model.part(f"block {k}", tc.Box(*SIZE), at=(0, 0, k * SIZE[2]), fixed=False)
        model.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=4), tolerance=FIXTURE)
        model.contact(f"joint {k}", moving=block.face("-z"), reference=below.face("+z"), points=30)
        below = block
    model.measure("top", below.point(40, 40, 10), along="z", tolerance=1)
    model.measure("lean", below.point(20, 20, 10), along="x", tolerance=1)
    return model


if __name__ == "__main__":
    tc.main(assembly)  # the same as: tolcontact run models/tower.py
