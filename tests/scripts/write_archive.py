"""Write a small archive, compressed, to be kept for good and read by all later versions: write_archive.py ARCHIVE.nc.gz.

It holds something of everything: two bars as meshes, locators with and without a distribution, one of them one-sided, a pair of
faces, measures of three kinds, a force, features with form, and a variable; its bodies are watched.
The bars have so many sections that they need no more points for their fields.
"""

import gzip
import sys
import tempfile
from pathlib import Path

import numpy as np
import trimesh
from scipy import stats

import tolcontact as tc


def bar(length, side):
    """A square bar along x, of few triangles with short edges."""
    square = side * np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    sections = [np.c_[np.full(4, x), square] for x in np.linspace(0, length, 16)]
    faces = [(0, 3, 2), (0, 2, 1), (60, 61, 62), (60, 62, 63)]
    for start in range(0, 60, 4):
        for k in range(4):
            one, other = start + k, start + (k + 1) % 4
            faces += [(one, other, other + 4), (one, other + 4, one + 4)]
    return tc.Mesh(trimesh.Trimesh(np.vstack(sections), faces))


def assembly():
    a = tc.Assembly("bars")
    base = a.part("base", bar(60, 4), fixed=True)
    block = a.part("block", bar(50, 3), at=(5, 0, 4))
    six = [
        tc.Locator("A1", (1, 1, 0), "z", 0.3),
        tc.Locator("A2", (49, 1, 0), "z", stats.norm(0, 0.05)),
        tc.Locator("A3", (25, 2, 0), "z", 0.3, one_sided=True),
        tc.Locator("B1", (1, 0, 2), "y", 0.1),
        tc.Locator("B2", (49, 0, 2), "y", 0.1),
        tc.Locator("C", (0, 1, 2), "x", 0.1),
    ]
    a.locate(block, six)
    a.contact("interface", moving=block.face("-z"), reference=base.face("+z"), points=8)
    a.force("weight", at=block.point(25, 1, 3), vector=(0, 0, -1))
    post = a.part("post", bar(20, 2), at=(0, 10, 0))
    post.feature("foot", post.face("-z"), datum="A")
    side = post.feature("side", post.face("-y"), tc.Perpendicularity(0.1, "A"), tc.Flatness(0.05, form=tc.Form(modes=3)))
    held = [("z1", (1, 1, 0), "z"), ("z2", (19, 1, 0), "z"), ("z3", (10, 2, 0), "z"), ("x", (0, 1, 1), "x")]
    a.locate(
        post,
        [*(tc.Locator(*one) for one in held), *(tc.Locator(f"y{x}", (x, 0, 1), "y", on=side) for x in (1, 19))],
        tolerance=0.2,
    )
    top = post.feature("top", post.face("+z"), tc.Profile(0.2, "A"))
    a.variable("warmth", 6, drives={"post.top.offset": 0.01}, units="K")
    a.measure("post", top.point(10, 1, 2), along="z")
    a.measure("corner", block.point(50, 3, 3), along="z", tolerance=0.2)
    a.measure("gap", base.point(5, 0, 4), to=block.point(0, 0, 0), along="z")
    a.measure("tilt", lambda poses: poses.rotation(block)[2, 0], units="rad")
    return a


with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "bars.nc"
    tc.run(
        assembly(),
        samples=8,
        seed=1,
        solver="daqp",
        method=tc.Method(search="fixed", objective="active points"),
        surfaces=4,
        fields=16_384,
        out=path,
    ).close()
    Path(sys.argv[1]).write_bytes(gzip.compress(path.read_bytes(), mtime=0))
