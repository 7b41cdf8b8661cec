"""The names of the bodies of a STEP file."""

import pytest

pytest.importorskip("OCP")
from tolcontact.kernel.step_document import BodyShape, Place, body_names

BASE, LID = Place(["root", "base"], "plate", None, None), Place(["root", ""], "plate", None, None)


def body(name, *, is_solid=True):
    return BodyShape([], [], is_solid, name)


def test_solids_at_one_place_have_their_own_names_and_a_single_one_that_of_the_place_without_its_own():
    assert body_names([(body("left"), BASE), (body("right"), BASE)]) == ["left", "right"]
    assert body_names([(body("left"), BASE)]) == ["left"]
    assert body_names([(body(""), BASE)]) == ["base"]


def test_surfaces_among_the_solids_of_a_place_leave_all_with_the_name_of_the_place():
    assert body_names([(body("left"), BASE), (body("", is_solid=False), BASE)]) == ["base", "base"]


def test_bodies_at_several_places_have_the_names_of_these_or_of_their_products():
    assert body_names([(body("left"), BASE), (body("right"), LID)]) == ["base", "plate"]
