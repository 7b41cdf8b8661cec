"""A block on a table: a model to begin with.

Check it, look at it, simulate it (NAME is this file without its ending):

    tolcontact check NAME.py
    tolcontact view NAME.py
    tolcontact run NAME.py --samples 1000 --seed 1 --out NAME.nc --report NAME.html
"""

import tolcontact as tc


def assembly() -> tc.Assembly:
    """What may vary, what may touch, and what is measured. Lengths are in mm, angles in rad."""
    a = tc.Assembly("starter")

    # Parts: a box, or a file (tc.Mesh("block.stl"), tc.Mesh("assembly.step", body="block")), and where its own frame stands.
    table = a.part("table", tc.Box(100, 60, 10), fixed=True)
    block = a.part("block", tc.Box(50, 30, 20), at=(25, 15, 10))

    # How a part is located: three points on a first face, two on a second one, one on a third. 0.2 means -0.1 to +0.1.
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=0.2)

    # Which faces may touch: after locating, the parts are moved until they are no longer inside each other.
    a.contact("seat", moving=block.face("-z"), reference=table.face("+z"))

    # What the assembly is judged by: here how far a corner of the block rises, and its limits.
    a.measure("corner height", block.point(50, 30, 20), along="z", limits=(-0.2, 0.3))
    return a


if __name__ == "__main__":
    tc.main(assembly)
