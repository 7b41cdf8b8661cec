"""A model is rebuilt from its archive, and gives the same results."""

import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import ALL_POINTS
from tolcontact.testing import assert_same_run


@pytest.mark.slow
def test_a_model_is_rebuilt_from_its_archive_and_gives_the_same_results(tmp_path):
    tc.run(cases.everything_of_meshes(tmp_path), samples=200, seed=2, solver="daqp", out=tmp_path / "first.nc").close()
    (tmp_path / "block.stl").unlink()
    with tc.open_archive(tmp_path / "first.nc") as archive:
        first = archive.load()
    rebuilt = tc.io.model_of(first)
    second = tc.run(rebuilt, samples=200, seed=2, solver="daqp")
    assert_same_run(first, second)
    assert list(first["measure_units"].values) == ["mm", "mm", "rad"]


@pytest.mark.slow
def test_faces_of_step_files_are_rebuilt_without_the_files():
    first = tc.run(cases.model("cover"), samples=50, seed=2, solver="daqp", method=ALL_POINTS, surfaces=4)
    rebuilt = tc.io.model_of(first)
    second = tc.run(rebuilt, samples=50, seed=2, solver="daqp", method=ALL_POINTS, surfaces=4)
    assert_same_run(first, second)
    assert (first["contact/moving_point"].values == second["contact/moving_point"].values).all()
