"""A model script in parts, of which a test may replace some."""

HEADER = """
import math
import tolcontact as tc

def assembly():
    a = tc.Assembly("A")
    base = a.part("base", tc.Box(100, 50, 10))
    top = a.part("top", tc.Box(50, 25, 10), at=(50, 12.5, 10))
    held = tc.three_two_one(base.face("-z"), base.face("-y"), base.face("-x"), inset=5)
    scheme = tc.three_two_one(top.face("-z"), top.face("+y"), top.face("-x"), inset=5)
"""

GOOD = {
    "base": "    a.locate(base, held, tolerance=10)\n",
    "top": "    a.locate(top, scheme, tolerance=10)\n",
    "contact": "    a.contact('interface', moving=top.face('-z'), reference=base.face('+z'), points=20)\n",
    "measure": "    a.measure('height', top.point(50, 0, 10), along='z', tolerance=1)\n",
    "end": "    return a\n",
}


def write_model(folder, changes=None):
    """The path of a good model, but for the `changes` of its parts, or of the "whole" script."""
    changes = changes or {}
    path = folder / "model.py"
    path.write_text(changes.get("whole") or HEADER + "".join({**GOOD, **changes}.values()))
    return path
