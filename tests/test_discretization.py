"""Contact points, locators and faces in the nominal assembly."""

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests import cases
from tolcontact.discretization import discretize


def test_ra1_has_the_papers_202_points_on_its_interface():
    (pair,) = discretize(cases.model("ra1")).pairs
    assert pair.P_m.shape == (202, 3)
    assert (pair.P_m == pair.P_r).all()
    assert (pair.n_r == [0, 0, 1]).all()
    assert (pair.P_m.min(axis=0) == [50, 12.5, 10]).all() and (pair.P_m.max(axis=0) == [100, 37.5, 10]).all()


def test_points_that_overhang_the_rim_do_not_take_part():
    a = tc.Assembly("overhang")
    table = a.part("table", tc.Box(10, 10, 10), at=(0, 0, -10), fixed=True)
    plate = a.part("plate", tc.Box(30, 10, 2), at=(-10, 0, 0.5))
    a.locate(plate, tc.three_two_one(plate.face("-z"), plate.face("-y"), plate.face("-x"), inset=1), tolerance=1)
    a.contact("rest", moving=plate.face("-z"), reference=table.face("+z"), spacing=1.0)
    a.measure("height", plate.point(0, 0, 0), along="z")
    (pair,) = discretize(a).pairs
    assert pair.P_m[:, 0].min() >= 0 and pair.P_m[:, 0].max() <= 10
    assert np.allclose(pair.P_m[:, 2] - pair.P_r[:, 2], 0.5)


def test_a_three_two_one_scheme_stands_inside_the_edges_of_its_faces():
    base, top = discretize(cases.model("ra1")).parts
    assert base.locators.points.tolist() == [[5, 5, 0], [95, 5, 0], [50, 45, 0], [5, 0, 5], [95, 0, 5], [0, 25, 5]]
    assert top.locators.points[:3, :2].tolist() == [[55, 32.5], [95, 32.5], [75, 17.5]]
    assert base.locators.directions.tolist() == [[0, 0, 1]] * 3 + [[0, 1, 0]] * 2 + [[1, 0, 0]]


def test_every_declared_thing_prints_as_one_row_and_remembers_its_line():
    a = cases.model("ra1")
    rows = str(a).splitlines()
    assert len(rows) == 1 + 2 + 2 + 1 + 1
    assert "202 points" in rows[5] and "top -z (moving) against base +z (reference)" in rows[5]
    assert a.parts[0].declared_at == "ra1.py:11"
    assert a.measures[0].declared_at == "ra1.py:16"
    with pytest.raises(AttributeError):
        a.parts[0].name = "other"


def lying(mesh, inset):
    """The points of a 3-2-1 scheme on the faces -z, -y and -x of a mesh."""
    a = tc.Assembly("plate")
    plate = a.part("plate", tc.Mesh(mesh))
    a.locate(plate, tc.three_two_one(plate.face("-z"), plate.face("-y"), plate.face("-x"), inset=inset), tolerance=0.1)
    a.measure("m", plate.point(0, 0, 0), along="z")
    return discretize(a).locators.points


def box(lower, upper):
    return trimesh.creation.box(bounds=[lower, upper])


def test_points_of_a_scheme_beside_the_material_move_to_the_widest_support_on_it():
    angled = trimesh.boolean.union([box((0, 0, 0), (100, 20, 5)), box((0, 0, 0), (20, 80, 5))])
    points = lying(angled, 5)
    assert points == pytest.approx(
        np.array([(5, 5, 0), (95, 5, 0), (15, 75, 0), (5, 0, 2.5), (95, 0, 2.5), (0, 40, 2.5)]), abs=1e-9
    )
    notched = trimesh.boolean.difference([box((0, 0, 0), (100, 60, 5)), box((40, 50, -1), (60, 61, 6))])
    A1, A2, A3 = lying(notched, 5)[:3]
    assert A1 == pytest.approx([5, 5, 0], abs=1e-9) and A2 == pytest.approx([95, 5, 0], abs=1e-9)
    assert A3[1:] == pytest.approx([55, 0], abs=1e-9) and 2.6 > min(35 - A3[0], abs(A3[0] - 65)) >= -1e-6


def test_points_of_a_scheme_stand_at_the_level_of_the_material():
    stepped = trimesh.boolean.union([box((0, 0, 0), (100, 60, 5)), box((0, 0, -3), (10, 60, 5))])
    assert lying(stepped, 5)[:3] == pytest.approx(np.array([(5, 5, -3), (95, 5, 0), (50, 55, 0)]), abs=1e-9)


def test_a_face_without_a_place_inside_its_edges_is_refused():
    frame = trimesh.boolean.difference([box((0, 0, 0), (100, 60, 5)), box((4, 4, -1), (96, 56, 6))])
    with pytest.raises(tc.ModelError, match=r'part "plate".*beside the material of face .*-z.* 10 mm from its edges'):
        lying(frame, 10)
