"""Insides of `geometry` under the claims of `tests/test_face_measures.py`."""

from dataclasses import replace

import numpy as np
import pytest

import tolcontact as tc
from tests.shapes import shape
from tests.test_cad import COVER, triangles
from tests.test_whole_surfaces import AS1
from tolcontact.geometry.brep_face import DESCRIPTIONS, describe_faces
from tolcontact.geometry.files import BREP, STATED_FACES
from tolcontact.geometry.files.product import product
from tolcontact.geometry.files.step_text import StepText
from tolcontact.shape_worker import Job, Worker


def test_points_lie_on_their_faces():
    mesh = shape(tc.Mesh(COVER))
    for face, stated in zip(tc.io.faces_in(COVER), mesh.metadata[STATED_FACES], strict=True):
        assert abs(stated.surface.distance(np.array([face.point]))[0][0]) < 1e-12
        assert triangles(tc.select.Brep(face.point)) == triangles(tc.select.Brep(face.number))


@pytest.mark.parametrize("body", ["nut_1", "plate_1"])
def test_a_listing_with_few_triangles_says_what_many_would(body):
    mesh = shape(tc.Mesh(AS1, body=body)).copy()
    mesh.metadata.pop(DESCRIPTIONS, None)
    mesh.metadata[STATED_FACES] = [replace(face, measure=None) for face in mesh.metadata[STATED_FACES]]
    for face, drawn in zip(tc.io.faces_in(AS1, body), describe_faces(mesh), strict=True):
        assert (face.centre is None) == (drawn.centre is None)
        if face.centre is not None:  # beside the point
            np.testing.assert_allclose(face.centre, drawn.centre, atol=1e-9)
        assert replace(face, point=drawn.point, centre=drawn.centre) == replace(drawn, area=face.area)
        assert drawn.area == pytest.approx(face.area, rel=1e-3)


def test_a_face_without_triangles_keeps_its_number():
    chord = 0.5
    with Worker() as worker:
        content = worker.read(COVER, Job(str(COVER), "step", chord, angle=0.5, seconds=60, memory=2**33, triangles=10_000))
    text, (cover,) = StepText(COVER.read_bytes()), content["shapes"]
    assert product(COVER, content, text, chord).missing_faces == 0
    drawn = cover["brep"] != 4
    sheet = cover | {"triangles": cover["triangles"][drawn], "brep": cover["brep"][drawn], "face_count": 0}
    cut = product(COVER, content | {"shapes": [sheet]}, text, chord)  # a solid would be refused
    assert cut.missing_faces == 1
    mesh = cut.part(None)
    assert set(mesh.face_attributes[BREP]) == set(range(15)) - {4}
    for face, whole in zip(describe_faces(mesh), tc.io.faces_in(COVER), strict=True):
        assert (face.number, face.area) == (whole.number, pytest.approx(whole.area))
        assert face.kind == ("general" if face.number == 5 else whole.kind)
