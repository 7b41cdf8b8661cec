"""Certified realizations of planes with form lie in each other nowhere by more than bodies may, by a referee of its own."""

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests.cases import Frame
from tests.cases.seats import sliding
from tests.form_referee import Rectangle, deepest
from tests.helpers import compiled, nightly
from tolcontact.vocabulary import Status

TURNED = Frame((0.4, -0.7, 0.3), (12.0, -5.0, 31.0))
TABLE, BLOCK = (100, 60, 10), (50, 30, 20)
AT = (25, 15, 10)


def box_on_box(faces, *, whole=False, spacing=None, frame=None, form=None):
    """A block on a table. The forms of both faces are wider than the tolerances of the locators."""
    frame, form = frame or Frame(), form or tc.Form()
    a = tc.Assembly("seat")
    table = a.part("table", tc.Box(*TABLE), fixed=True, **frame.place(0, 0, 0))
    block = a.part("block", tc.Box(*BLOCK), **frame.place(*AT))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5), tolerance=0.2)
    if "block" in faces:
        block.feature("bottom", block.face("-z"), tc.Profile(0.4, form=form))
    if "table" in faces:
        table.feature("top", table.face("+z"), tc.Profile(0.4, form=form))
    a.contact("seat", moving=block.face() if whole else block.face("-z"), reference=table.face("+z"), spacing=spacing)
    a.measure("height", block.point(50, 30, 20), along=frame.along(0, 0, 1))
    return a


def rectangles(frame=None):
    """The underside of the block, and the top of the table."""
    frame = frame or Frame()

    def rectangle(corner, size, up):
        at, rotate = frame.place(*corner)["at"], frame.R.apply
        return Rectangle(at, rotate([(size[0], 0, 0), (0, size[1], 0)]), rotate((0, 0, up)))

    return rectangle(AT, BLOCK, -1), rectangle((0, 0, 10), TABLE, 1)


def check(model, moving, reference, samples=6):
    run = tc.run(compiled(model, solver="graph"), samples=samples, seed=3, fields="none", surfaces=samples)
    certified = np.isin(run.status.values, (Status.UNTOUCHED, Status.RESOLVED))
    depths = deepest(run, moving, reference)[certified]
    allowed = model.smallest_zone() / 1000
    assert certified.mean() > 0.95 and depths.max() < allowed
    assert depths.max() > -allowed  # they touch
    assert run["surface"].surface_penetration.max() < allowed
    return run


@pytest.mark.parametrize("spacing", [None, *nightly(1.2, 0.6)])
@pytest.mark.parametrize(
    ("faces", "whole"), [("block", False), ("table", True), *nightly(("table", False), ("block table", False))]
)
def test_a_box_on_a_box(faces, whole, spacing):
    check(box_on_box(faces, whole=whole, spacing=spacing), *rectangles(), samples=60 if spacing else 6)


def test_a_box_on_a_box_that_stand_anywhere():  # both with form
    check(box_on_box("block table", frame=TURNED), *rectangles(TURNED))


@pytest.mark.parametrize("covariance", ["matern 3/2", *nightly("matern 5/2")])
def test_rougher_forms(covariance):
    check(box_on_box("block", form=tc.Form(covariance, length=15.0, modes=30)), *rectangles())


def test_a_block_over_the_end_of_a_table():
    over = Rectangle(np.array([70.0, 10, 0]), np.array([(60.0, 0, 0), (0, 40, 0)]), np.array([0.0, 0, -1]))
    top = Rectangle(np.array([0.0, 0, 0]), np.array([(100.0, 0, 0), (0, 60, 0)]), np.array([0.0, 0, 1]))
    check(sliding(), over, top)


def feet(step):
    """A bar of 50 x 30 x 10 on two feet along its ends, one of them higher by a step."""
    outline = np.array([(0, 0), (20, 0), (20, 4), (40, 4), (40, step), (50, step), (50, 10), (0, 10)], dtype=float)
    triangles = np.array([(0, 1, 2), (0, 2, 7), (2, 6, 7), (2, 3, 6), (3, 5, 6), (3, 4, 5)])
    bar = trimesh.creation.extrude_triangulation(outline, triangles, 30)
    bar.apply_transform(np.array([(1, 0, 0, 0), (0, 0, -1, 30), (0, 1, 0, 0), (0, 0, 0, 1.0)]))
    a = tc.Assembly("feet")
    table, part = a.part("table", tc.Box(*TABLE), fixed=True), a.part("bar", tc.Mesh(bar), at=AT)
    table.feature("top", table.face("+z"), tc.Profile(0.4))
    stands = [tc.Locator(f"Z{k}", place, "z", 0.2) for k, place in enumerate([(2, 2, 0), (45, 2, 0), (25, 28, 0)])]
    sides = [tc.Locator("X", (0, 15, 5), "x", 0.1), *(tc.Locator(f"Y{x}", (x, 0, 5), "y", 0.1) for x in (5, 45))]
    a.locate(part, [*stands, *sides])
    a.contact("seat", moving=part.face(), reference=table.face("+z"))
    a.measure("height", part.point(25, 15, 10), along="z")
    return a


@pytest.mark.parametrize(("step", "certified"), [(0.0, 0.95), (0.02, 0.1)])
def test_feet_of_a_body(step, certified):
    """Feet of one height touch the plane between contact points, too; of others, answers are compared alone."""
    run = tc.run(compiled(feet(step), solver="graph"), samples=30, seed=3, fields="none", surfaces=30)
    assert np.isin(run.status.values, (Status.UNTOUCHED, Status.RESOLVED)).mean() > certified
    assert run["surface"].surface_penetration.max() < 0.1 / 1000
