"""A stack in one dimension: a first model.

Check it, simulate it, and divide its tolerances again (NAME is this file without its ending):

    tolcontact check NAME.py
    tolcontact run NAME.py --samples 10000 --seed 1 --out NAME.nc --report NAME.html
    tolcontact allocate NAME.py --require "gap: ppm 2700"
"""

import tolcontact as tc


def assembly() -> tc.Assembly:
    """Declare the links of the stack and the gap that they close. Lengths are in mm; units="in" labels them as inches."""
    stack = tc.Stack("starter")

    # A link has its nominal value and its limits as drawn: "±0.1", "+0.1/-0.05", a class such as "h9", or a full width.
    stack.link("housing", 100.4, "±0.15")

    # The gap shrinks as the parts inside grow. A link that is twice in the loop has the sensitivity 2 or -2.
    stack.link("block", 60, "+0/-0.16", sensitivity=-1)
    stack.link("spacer", 40, tc.Tolerance(0.1, "uniform"), sensitivity=-1)

    # Links may also come from a table, stack.read("links.csv"), with columns name, nominal, tolerance and sensitivity.
    stack.gap("gap", limits=(0.1, 0.8))
    return stack


if __name__ == "__main__":
    tc.main(assembly)
