"""Several B-rep faces as one face: unions, and holes that a file splits into halves."""

import warnings
from pathlib import Path

import numpy as np
import pytest

import tolcontact as tc
from tests.test_json_models import load_model, written
from tolcontact.discretization import discretize

AS1 = Path(__file__).resolve().parents[1] / "studies" / "cad" / "as1-oc-214.stp"
HALVES = [(6, 7), (8, 9), (10, 11), (12, 13), (14, 15), (16, 17)]  # of the plate's six holes


def plate_with(*selections, **toleranced):
    model = tc.Assembly("plate")
    plate = model.part("plate", tc.Mesh(AS1, body="plate_1"), fixed=True)
    plate.feature("top", plate.face(tc.Brep(1)), datum="A")
    feature = plate.feature("hole", plate.face(*selections), tc.Size(10, 0.1, -0.1), tc.Position(0.2, "A"))
    model.measure("corner", of=plate.point(0, 0, 0), along="z")
    return model, plate, feature


def chosen(selection):
    model, plate, _ = plate_with(tc.Brep(6, whole=True))
    return list(discretize(model).triangles(plate.face(selection)))


def test_a_union_has_the_triangles_of_all_its_faces():
    apart = [set(chosen(tc.Brep(number))) for number in (3, 7, 12)]
    assert set(chosen(tc.Brep(3, 7, 12))) == set.union(*apart) and sum(map(len, apart)) == len(set.union(*apart))
    assert (
        chosen(tc.Brep(3) | tc.Brep(7, 12)) == chosen(tc.Brep(12, 3, 7)) == chosen(tc.Brep(12, 7) | tc.Brep((180, 100, 13.33)))
    )
    with pytest.raises(TypeError, match="whole for both, or for none"):
        tc.Brep(3) | tc.Brep(6, whole=True)
    assert tc.Brep(np.int64(3), np.array([1.0, 2.0, 3.0])).which == (3, (1.0, 2.0, 3.0))
    assert "need numbers" in next(tc.Brep().faults())


def test_halves_of_a_hole_are_one_surface_by_each_of_their_numbers():
    faces = tc.faces_in(AS1, "plate_1")
    assert [face.whole for face in faces] == [(), (), (), (), (), *(pair for pair in HALVES for _ in pair), ()]
    assert "one surface with 7" in str(faces[5])
    for pair in HALVES:
        both = chosen(tc.Brep(*pair))
        point = faces[pair[0] - 1].point
        assert all(chosen(tc.Brep(which, whole=True)) == both for which in (*pair, point))
    assert chosen(tc.Brep(1, whole=True)) == chosen(tc.Brep(1))


def test_a_feature_on_half_a_hole_is_doubted_and_a_whole_one_has_its_axis():
    with pytest.warns(tc.FaceWarning, match=r'"hole".*1 of the 2 faces of one cylinder.*tc.Brep\(6, whole=True\)'):
        discretize(plate_with(tc.Brep(6))[0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        whole = discretize(plate_with(tc.Brep(7, whole=True))[0])
        discretize(plate_with(tc.Brep(6, 7))[0])
        discretize(plate_with(tc.Brep(6), tc.Inside((0, 0, 2), (200, 200, 18)))[0])  # a part of the hole is what was asked for
    hole = next(nominal for nominal in whole.features if nominal.feature.name == "hole")
    assert np.allclose(hole.geometry.centre[:2], [47.5, 75 + 7.5 * 3**0.5], atol=1e-5)
    with pytest.raises(tc.ModelError, match="spans more than one surface"):
        discretize(plate_with(tc.Brep(6, 8, whole=True))[0])


def test_unions_and_whole_surfaces_come_with_json(tmp_path):
    model, _, _ = plate_with(tc.Brep(6, (47.46, 82.99, 6.667), whole=True))
    document = written(model, tmp_path / "first.json")
    again = load_model(tmp_path / "first.json")
    assert again.parts[0].features[1].faces[0].selections == (tc.Brep(6, (47.46, 82.99, 6.667), whole=True),)
    assert written(again, tmp_path / "second.json") == document
    text = (tmp_path / "first.json").read_text()
    for wrong in ('"all"', '"any ones"'):
        (tmp_path / "wrong.json").write_text(text.replace('"any"', wrong))
        with pytest.raises(tc.TolcontactError, match='faces under the key "any"'):
            load_model(tmp_path / "wrong.json")
