"""What is said of points that lie far off their part."""

import warnings

import pytest
import trimesh

import tolcontact as tc

PLACES = [
    ((10, 10, 0), "z"),
    ((190, 10, 0), "z"),
    ((100, 140, 0), "z"),
    ((10, 0, 10), "y"),
    ((190, 0, 10), "y"),
    ((0, 75, 10), "x"),
]


def lid(path, units=None, places=PLACES):
    """A lid of 200 x 150 x 20 mm on a table, held by locators whose places are said in mm."""
    a = tc.Assembly("lid")
    part = a.part("lid", tc.Mesh(path, units))
    a.locate(part, [tc.Locator(f"L{k}", *place, 1) for k, place in enumerate(places)])
    a.measure("height", part.point(100, 75, 20), along="z")
    return a


def warned(assembly) -> list[str]:
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        tc.build(assembly)
    return [str(one.message) for one in found]


def box(path, factor):
    trimesh.creation.box(bounds=[[0, 0, 0], [200 * factor, 150 * factor, 20 * factor]]).export(path)
    return path


@pytest.mark.slow
@pytest.mark.parametrize(("unit", "length"), [("in", 25.4), ("cm", 10.0), ("m", 1000.0), ("ft", 304.8)])
def test_the_unit_that_explains_it_is_named(unit, length, tmp_path):
    (told,) = warned(lid(box(tmp_path / "lid.stl", 1 / length)))
    assert "mm away from it; if the file is in other units" in told
    assert f'units="{unit}") it would be 250.8 mm' in told


@pytest.mark.slow
def test_metres_of_a_glb_that_are_mm(tmp_path):
    places = [((x * 1000, y * 1000, z * 1000), along) for (x, y, z), along in PLACES]
    assert not warned(lid(box(tmp_path / "lid.glb", 1e-3)))
    told = warned(lid(box(tmp_path / "mm.stl", 1.0), "um"))
    assert len(told) == 1 and 'units="mm") it would be 250.8 mm' in told[0]
    assert "check the coordinates" in warned(lid(box(tmp_path / "far.stl", 1.0), None, places[:1] + PLACES[1:]))[0]


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [(1900, 10, 0), (190, 10, 4321), (-777, 10, 0)])
def test_one_wrong_coordinate_is_no_matter_of_units(wrong, tmp_path):
    places = [PLACES[0], (wrong, "z"), *PLACES[2:]]
    (told,) = warned(lid(box(tmp_path / "lid.stl", 1.0), None, places))
    assert 'locator "L1": its point ({:.4g}, {:.4g}, {:.4g}) lies'.format(*wrong) in told and "tc.Mesh(" not in told
    assert told.startswith("[point]") and told.endswith("; check the coordinates, which are in the part's own frame [mm]")


def test_coordinates_of_the_assembly_are_no_matter_of_units(tmp_path):
    places = [((x + 3000, y - 2000, z), along) for (x, y, z), along in PLACES]
    (told,) = warned(lid(box(tmp_path / "lid.stl", 1.0), None, places))
    assert "check the coordinates" in told and "tc.Mesh(" not in told


def test_a_mesh_that_states_its_units_is_not_said_to_have_others():
    mesh = trimesh.creation.box(bounds=[[0, 0, 0], [20, 15, 2]])
    mesh.units = "mm"
    (told,) = warned(lid(mesh))
    assert "check the coordinates" in told
