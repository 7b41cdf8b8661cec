"""A block on a table: a first model.

Check it, look at it, simulate it (NAME is this file without its ending):

    tolcontact check NAME.py
    tolcontact view NAME.py
    tolcontact run NAME.py --samples 1000 --seed 1 --out NAME.nc --report NAME.html
"""

import tolcontact as tc


def assembly() -> tc.Assembly:
    """Declare the parts, their locations, contact and measures. Lengths are in mm, angles in rad."""
    a = tc.Assembly("starter")

    # A part is a box or a file (tc.Mesh("block.stl"), tc.Mesh("assembly.step", body="block")); `at` places its frame.
    table = a.part("table", tc.Box(100, 60, 10), fixed=True)
    block = a.part("block", tc.Box(50, 30, 20), at=(25, 15, 10))

    # Three points on a first face, two on a second and one on a third locate the part. Tolerance 0.2 means -0.1 to +0.1.
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=0.2)

    # These faces may touch: after locating, parts that are inside each other are moved apart.
    a.contact("seat", moving=block.face("-z"), reference=table.face("+z"))

    # The assembly is judged by its measures: here the rise of a corner of the block, with limits.
    a.measure("corner height", block.point(50, 30, 20), along="z", limits=(-0.2, 0.3))
    return a


if __name__ == "__main__":
    tc.main(assembly)
