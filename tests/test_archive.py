"""What an archive holds, and that it needs nothing else: it recomputes its own numbers."""

import sys

import cf_xarray  # noqa: F401
import netCDF4
import numpy as np
import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tests.helpers import SCRIPTS, compiled, run, script
from tolcontact.archive import bytes_of_rows
from tolcontact.errors import ArchiveError
from tolcontact.testing import assert_gaps_recompute, assert_same_run
from tolcontact.vocabulary import BY_REALIZATION


@pytest.fixture(scope="module")
def program():
    return compiled(cases.stack(), solver="daqp")


@pytest.mark.slow
@pytest.mark.parametrize("search", ["fixed", "bounded"])
def test_it_is_read_with_xarray_alone_and_recomputes_its_own_gaps(search, tmp_path):
    path = tmp_path / "stack.nc"
    tc.run(
        compiled(cases.stack(), solver="daqp", method=tc.Method(search=search)), samples=60, seed=3, out=path, surfaces=4
    ).close()
    done = run([sys.executable, "-I", SCRIPTS / "read_plainly.py", path])
    assert done.returncode == 0 and len(done.stdout.split()) == 60, done.stderr
    assert_gaps_recompute(path)
    contact = xr.load_dataset(path, group="contact")
    assert ("bounded" in contact) == ("plane_error" in contact) == (search == "bounded")


@pytest.mark.slow
def test_it_recomputes_its_own_measures(archive):
    root = xr.load_dataset(archive)
    corner = np.array([15.0, 15, 30])
    moved = root.rotation.sel(part="upper").values @ corner + root.translation.sel(part="upper").values
    assert np.abs(moved[..., 2] - 30 - root.measured.sel(measure="top").values).max() < 1e-12


def test_it_follows_the_cf_conventions(archive):
    root = xr.load_dataset(archive)
    assert root.attrs["Conventions"].startswith("CF-1.")
    assert {"title", "history", "source", "references", "solver", "seed", "active_set", "regularization"} <= set(root.attrs)
    assert root.realization.attrs["standard_name"] == "realization"
    assert (root.status.cf == "resolved").sum() > 100
    with netCDF4.Dataset(archive) as file:
        assert file.dimensions["realization"].isunlimited()
        assert file["rotation"].chunking()[0] == 4096
        groups = [file, *file.groups.values(), *file["field"].groups.values()]
        for variable in (v for group in groups for v in group.variables.values()):
            assert variable.long_name
            is_label = "_Encoding" in variable.ncattrs() or variable.name in ("faces", "status") or "part" in variable.name
            assert (
                is_label
                or "_of_" in variable.name
                or variable.name == "one_sided"
                or "measure_" in variable.name
                or variable.name.endswith("_by_objective")  # statuses, and values in the units of their measures
                or variable.units
            )


def test_fields_are_those_of_the_archived_poses(archive):
    tree = xr.load_datatree(archive)
    field = tree["field/upper"].to_dataset()
    for state in ("raw", "corrected"):
        R, t = (tree[name].sel(part="upper", state=state).values for name in ("rotation", "translation"))
        v = field.vertices.values[:7]
        u = np.einsum("kij,vj->kvi", R, v) + t[:, None] - v
        u = np.concatenate([u, np.linalg.norm(u, axis=2, keepdims=True)], axis=2)
        assert np.abs(field["mean"].sel(state=state).values[:7] - u.mean(axis=0)).max() < 1e-12
        assert np.abs(field.six_sigma.sel(state=state).values[:7] - 6 * u.std(axis=0, ddof=1)).max() < 1e-11


@pytest.mark.slow
def test_it_may_be_read_while_its_results_are_open(tmp_path):
    """The netCDF library crashed on that while labels were text of variable length."""
    assert run(script("read_while_open", tmp_path / "open.nc")).returncode == 0


@pytest.mark.slow
def test_a_run_in_memory_is_the_same_as_its_archive(archive, program):
    assert_same_run(tc.run(program, samples=300, seed=3), archive)


def test_an_archive_without_finished_realizations_has_no_statistics(archive, tmp_path):
    with tc.open_archive(archive) as tree:
        empty = tree.map_over_datasets(lambda group: group.isel(realization=[]) if "realization" in group.dims else group)
        empty.to_netcdf(tmp_path / "begun.nc")
    with tc.open_archive(tmp_path / "begun.nc") as tree, pytest.raises(ArchiveError, match="continue with --resume"):
        tc.summarize(tree)


@pytest.mark.slow
@pytest.mark.parametrize("keep", ["measures", "poses", "all"])
def test_what_is_kept_of_each_realization_can_be_chosen(keep, archive, program, tmp_path):
    tc.run(program, samples=300, seed=3, out=tmp_path / "some.nc", keep=keep).close()
    some, every = xr.load_datatree(tmp_path / "some.nc"), xr.load_datatree(archive)
    assert ("rotation" in some) == ("translation" in some) == (keep != "measures")
    assert ("deviation" in some["sample"]) == (keep == "all")
    lost = {"measures": ("translation", "rotation", "deviation"), "poses": ("deviation",), "all": ()}[keep]
    assert_same_run(some, every, variables=[variable.name for variable in BY_REALIZATION if variable.name not in lost])
    for name in ("mean", "six_sigma", "magnitude_six_sigma_interval"):
        assert (some["field/middle"][name].values == every["field/middle"][name].values).all()
    assert tc.summarize(some).identical(tc.summarize(every))
    with pytest.raises(tc.TolcontactError, match="expected one of: measures, poses, all"):
        tc.run(program, samples=300, keep="everything")


@pytest.mark.slow
def test_a_model_without_contact_has_an_archive_too(tmp_path):
    a = tc.Assembly("alone")
    block = a.part("block", tc.Box(10, 20, 30))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=1), tolerance=1)
    a.measure("corner", block.point(10, 20, 30), along="z", tolerance=1)
    path, alone = tmp_path / "alone.nc", compiled(a, solver="daqp")
    tc.run(alone, samples=50, out=path).close()
    assert tc.summarize(path)["by_status"].values.tolist() == [50, 0, 0, 0, 0]
    tc.run(alone, samples=60, out=path, resume=True).close()
    with tc.open_archive(path) as tree:
        assert tree.sizes["realization"] == 60 and [part.name for part in tc.io.model_of(tree).parts] == ["block"]


@pytest.mark.slow
@pytest.mark.parametrize("keep", ["measures", "poses", "all"])
def test_the_bytes_of_a_row_are_foreseen(keep, program, tmp_path):
    path = tmp_path / "run.nc"
    tc.run(program, samples=50, out=path, keep=keep, surfaces=0).close()
    with netCDF4.Dataset(path) as file:
        rows = [v for group in (file, file["sample"]) for v in group.variables.values() if "realization" in v.dimensions]
        stored = sum(v.dtype.itemsize * v.size for v in rows)
    assert bytes_of_rows(program.nominal, keep, 50) == stored
