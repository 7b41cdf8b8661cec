"""Areas of faces, points on them and boxes of bodies come from the CAD kernel, not from triangles."""

import numpy as np
import pytest

import tolcontact as tc
from studies.cad.exact_edges import Text
from studies.cad.trimmed_faces import area
from tests.test_cad import COVER
from tests.test_whole_surfaces import AS1


def test_areas_and_boxes_are_exact():
    """The cover is a plate of 120 x 80 x 8 with corners of radius 6 and two holes of radius 4.05, one of them 4 longer."""
    found = tc.io.faces_in(COVER)
    plate = 120 * 80 - (4 - np.pi) * 6**2 - 2 * np.pi * 4.05**2 - 4 * 8.1
    hole = 2 * np.pi * 4.05 * 8
    exact = {2: plate, 3: 6 * np.pi / 2 * 8, 6: 108 * 8, 11: hole, 12: 4 * 8, 13: hole / 2}
    for number, expected in exact.items():
        assert found[number - 1].area == pytest.approx(expected, rel=1e-11)
    (body,) = tc.io.bodies_in(COVER)
    assert body.lower == pytest.approx((0, 0, 0), abs=1e-9) and body.upper == pytest.approx((120, 80, 8), abs=1e-9)
    turned = next(body for body in tc.io.bodies_in(AS1) if body.name == "l-bracket_1 (2)")
    assert max(map(abs, turned.rotation)) > 1
    assert np.subtract(turned.upper, turned.lower) == pytest.approx((50, 100, 60), abs=1e-6)


def test_areas_are_integrals_around_the_edges_in_the_text():
    text = Text(COVER.read_text())
    faces = [text.face(number) for number, body in sorted(text.bodies.items()) if body.startswith("ADVANCED_FACE")]
    expected = sorted(area(face)[0] for face in faces)
    assert sorted(face.area for face in tc.io.faces_in(COVER)) == pytest.approx(expected, rel=1e-11)
