"""RA1: a block set down on a larger block. What does contact do to its corner height?

Lengths in mm. A tolerance is the full width of its zone: 10 means -5 to +5.
"""

import tolcontact as tc


def assembly() -> tc.Assembly:
    ra1 = tc.Assembly("RA1", method=tc.Method(resolution="linearized"))
    base = ra1.part("base", tc.Box(100, 50, 10))
    top = ra1.part("top", tc.Box(50, 25, 10), at=(50, 12.5, 10))
    ra1.locate(base, tc.three_two_one(base.face("-z"), base.face("-y"), base.face("-x"), inset=5), tolerance=10)
    ra1.locate(top, tc.three_two_one(top.face("-z"), top.face("+y"), top.face("-x"), inset=5), tolerance=10)
    ra1.contact("interface", moving=top.face("-z"), reference=base.face("+z"), points=202)
    ra1.measure("corner height", top.point(50, 0, 10), along="z", tolerance=1)
    return ra1


if __name__ == "__main__":
    tc.main(assembly)  # the same as: tolcontact run models/ra1.py
