"""A model is rebuilt from its archive, and gives the same results."""

from dataclasses import replace
from functools import partial

import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tests.cases.round_contact import pinned
from tests.helpers import ALL_POINTS, SEATED, compiled, nightly
from tolcontact.testing import assert_gaps_recompute, assert_same_run


@pytest.mark.slow
def test_a_model_is_rebuilt_from_its_archive_and_gives_the_same_results(tmp_path):
    tc.run(compiled(cases.everything_of_meshes(tmp_path), solver="daqp"), samples=60, seed=2, out=tmp_path / "first.nc").close()
    (tmp_path / "block.stl").unlink()
    with tc.open_archive(tmp_path / "first.nc") as archive:
        first = archive.load()
    rebuilt = tc.io.model_of(first)
    second = tc.run(compiled(rebuilt, solver="daqp"), samples=60, seed=2)
    assert_same_run(first, second)
    assert list(first["measure_units"].values) == ["mm", "mm", "rad"]


@pytest.mark.slow
@pytest.mark.parametrize("model", [pinned, *nightly(partial(cases.model, "cover"))], ids=["pin", "cover"])
def test_faces_of_step_files_are_rebuilt_without_the_files(model):
    first = tc.run(compiled(model(), solver="daqp", method=ALL_POINTS), samples=50, seed=2, surfaces=4)
    rebuilt = compiled(tc.io.model_of(first), solver="daqp", method=ALL_POINTS)
    second = tc.run(rebuilt, samples=50, seed=2, surfaces=4)
    assert_same_run(first, second)
    assert (first["contact/moving_point"].values == second["contact/moving_point"].values).all()


@pytest.mark.slow
def test_forces_supports_and_stiffness_are_rebuilt_and_gaps_of_supports_recomputed(tmp_path):
    path, method = tmp_path / "table.nc", replace(SEATED, search="fixed")
    with tc.run(cases.table(), samples=100, seed=2, solver="daqp", method=method, out=path) as results:
        first = results.load()
    second = tc.run(tc.io.model_of(first), samples=100, seed=2, solver="daqp", method=method)
    assert_same_run(first, second)
    assert_gaps_recompute(path)
    root, contact = (xr.load_dataset(path, group=group) for group in (None, "contact"))
    assert [root.attrs[word] for word in ("resolution", "objective", "search")] == ["exact", "seating", "fixed"]
    assert root.reaction.attrs["units"] == "N"
    assert list(contact.reference_part) == [-1]
    assert (contact.locator_of_point >= 0).all()
