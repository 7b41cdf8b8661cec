"""The archive alone: what it holds, recomputes, rebuilds, and survives."""

from dataclasses import replace

import cf_xarray  # noqa: F401
import netCDF4
import numpy as np
import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tests.helpers import ALL_POINTS, EXACT, SEATED, contents, finish, run, script, start
from tolcontact import vocabulary
from tolcontact.checksums import crc32
from tolcontact.errors import ArchiveError

DATA = ("measured", "translation", "rotation", "gap_min", "active", "status", "kkt_residual")


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    path = tmp_path_factory.mktemp("archive") / "stack.nc"
    tc.run(cases.stack(), samples=300, seed=3, solver="daqp", out=path).close()
    return path


def rows(path):
    root, sample = xr.load_dataset(path), xr.load_dataset(path, group="sample")
    return {name: root[name].values for name in DATA} | {"deviation": sample["deviation"].values}


def test_it_is_read_with_xarray_alone_and_recomputes_its_own_gaps(archive):
    root, contact = xr.load_dataset(archive), xr.load_dataset(archive, group="contact")
    for pair in range(root.sizes["pair"]):
        points = contact.isel(point=np.flatnonzero(contact.pair_of_point == pair))
        moving, reference = int(contact.moving_part[pair]), int(contact.reference_part[pair])
        where = [
            root.rotation.isel(part=part).values @ p.values.T + root.translation.isel(part=part).values[..., None]
            for part, p in ((moving, points.moving_point), (reference, points.reference_point))
        ]
        n = root.rotation.isel(part=reference).values @ points.reference_normal.values.T
        n /= np.linalg.norm(n, axis=2, keepdims=True)
        gaps = ((where[0] - where[1]) * n).sum(axis=2)
        assert np.abs(gaps.min(axis=2) - root.gap_min.isel(pair=pair).values).max() < 1e-9


def test_it_recomputes_its_own_measures(archive):
    root = xr.load_dataset(archive)
    corner = np.array([15.0, 15, 30])
    moved = root.rotation.sel(part="upper").values @ corner + root.translation.sel(part="upper").values
    assert np.abs(moved[..., 2] - 30 - root.measured.sel(measure="top").values).max() < 1e-12


def test_it_follows_the_cf_conventions(archive):
    root = xr.load_dataset(archive)
    assert root.attrs["Conventions"].startswith("CF-1.")
    assert {"title", "history", "source", "references", "solver", "seed", "eta", "regularization"} <= set(root.attrs)
    assert root.realization.attrs["standard_name"] == "realization"
    assert (root.status.cf == "resolved").sum() > 100
    with netCDF4.Dataset(archive) as file:
        assert file.dimensions["realization"].isunlimited()
        assert file["rotation"].chunking()[0] == 1000
        groups = [file, *file.groups.values(), *file["field"].groups.values()]
        for variable in (v for group in groups for v in group.variables.values()):
            assert variable.long_name
            is_label = "_Encoding" in variable.ncattrs() or variable.name in ("faces", "status") or "part" in variable.name
            assert (
                is_label
                or variable.name.endswith("of_point")
                or variable.name == "one_sided"
                or "measure_" in variable.name
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


def test_a_model_is_rebuilt_from_its_archive_and_gives_the_same_results(tmp_path):
    tc.run(cases.everything_of_meshes(tmp_path), samples=200, seed=2, solver="daqp", out=tmp_path / "first.nc").close()
    (tmp_path / "block.stl").unlink()
    with tc.open_archive(tmp_path / "first.nc") as archive:
        first = archive.load()
    rebuilt = tc.model_of(first)
    second = tc.run(rebuilt, samples=200, seed=2, solver="daqp")
    for name in DATA:
        assert (first[name].values == second[name].values).all(), name
    assert list(first["measure_units"].values) == ["mm", "mm", "rad"]


def test_faces_of_step_files_are_rebuilt_without_the_files():
    first = tc.run(cases.model("cover"), samples=50, seed=2, solver="daqp", method=ALL_POINTS)
    rebuilt = tc.model_of(first)
    second = tc.run(rebuilt, samples=50, seed=2, solver="daqp", method=ALL_POINTS)
    for name in (*DATA, "carrying", "iterations"):
        assert (first[name].values == second[name].values).all(), name
    assert (first["contact/moving_point"].values == second["contact/moving_point"].values).all()


def test_forces_supports_and_stiffness_are_rebuilt_and_gaps_of_supports_recomputed(tmp_path):
    path, method = tmp_path / "table.nc", replace(SEATED, search="iterated")
    with tc.run(cases.table(), samples=100, seed=2, solver="daqp", method=method, out=path) as results:
        first = results.load()
    second = tc.run(tc.model_of(first), samples=100, seed=2, solver="daqp", method=method)
    for name in (*DATA, "carrying", "reaction", "iterations"):
        assert (first[name].values == second[name].values).all(), name
    root, contact, sample = (xr.load_dataset(path, group=group) for group in (None, "contact", "sample"))
    assert [root.attrs[word] for word in ("resolution", "objective", "search")] == ["exact", "seating", "iterated"]
    assert root.reaction.attrs["units"] == "N"
    assert list(contact.reference_part) == [-1]
    feet = root.rotation.isel(part=0).values @ contact.moving_point.values.T + root.translation.isel(part=0).values[..., None]
    apart = ((feet.swapaxes(2, 3) - contact.reference_point.values) * contact.reference_normal.values).sum(axis=3)
    gaps = apart - sample.deviation.values[:, None, contact.locator_of_point.values]
    assert np.abs(gaps.min(axis=2) - root.gap_min.isel(pair=0).values).max() < 1e-9


def test_it_may_be_read_while_its_results_are_open(tmp_path):
    """The netCDF library crashed on that while labels were text of variable length."""
    assert run(script("read_while_open", tmp_path / "open.nc")).returncode == 0


def test_a_run_in_memory_is_the_same_as_its_archive(archive):
    tree = tc.run(cases.stack(), samples=300, seed=3, solver="daqp")
    for name, values in rows(archive).items():
        there = tree["sample"][name] if name == "deviation" else tree[name]
        assert (there.values == values).all()


@pytest.mark.parametrize(("solver", "keep"), [("daqp", "all"), ("qpoases", "measures")])
def test_resume_gives_the_same_data_as_an_undisturbed_run(solver, keep, tmp_path):
    paths = [tmp_path / "grown.nc", tmp_path / "whole.nc"]
    for samples in (300, 5000, 5000, 9000):
        tc.run(cases.stack(), samples=samples, seed=3, solver=solver, out=paths[0], resume=True, keep=keep).close()
    tc.run(cases.stack(), samples=9000, seed=3, solver=solver, out=paths[1], keep=keep).close()
    for group in (None, "sample", "field/bottom", "field/middle", "field/upper"):
        grown, whole = (contents(path, group) for path in paths)
        assert grown.identical(whole), group
    assert xr.load_dataset(paths[0]).attrs["history"].count("resumed after 4096") == 2


@pytest.mark.parametrize(("after", "keep"), [(4096, "all"), (12_000, "measures")])
def test_a_killed_run_keeps_its_rows_and_goes_on(after, keep, tmp_path):
    path = tmp_path / "killed.nc"
    with start(script("run_stack", path, 40_000, "--keep", keep)) as begun:
        for line in begun.stdout:
            if int(line) >= after:
                break
        begun.kill()
    with netCDF4.Dataset(path) as file:
        written = int((file["status"][:] != -1).sum())
    assert after <= written < 40_000
    tc.run(cases.stack(), samples=40_000, seed=3, solver="daqp", out=path, keep=keep, resume=True).close()
    whole = tmp_path / "whole.nc"
    tc.run(cases.stack(), samples=40_000, seed=3, solver="daqp", out=whole, keep=keep).close()
    for group in (None, "sample", "field/middle"):
        assert contents(path, group).identical(contents(whole, group)), group


@pytest.mark.parametrize("when", ["before", "after"])
def test_a_run_may_be_killed_at_any_of_its_writes(when, tmp_path):
    done = run(script("kill_at_each_write", tmp_path, when), timeout=600)
    assert done.returncode == 0, done.stderr


def test_resuming_with_fewer_realizations_completes_what_was_begun(archive, tmp_path):
    path = tmp_path / "copy.nc"
    path.write_bytes(archive.read_bytes())
    tc.run(cases.stack(), samples=100, seed=3, solver="daqp", out=path, resume=True).close()
    one, other = (xr.load_dataset(p, group="field/upper") for p in (path, archive))
    assert one.identical(other)


def test_resuming_is_refused_where_contact_points_were_others(archive, tmp_path):
    path = tmp_path / "copy.nc"
    path.write_bytes(archive.read_bytes())
    with netCDF4.Dataset(path, "r+") as file:
        points = file["contact/moving_point"]
        points[3, 1] += 0.01
        points.crc32 = crc32(vocabulary.MOVING_POINT, points[:])
    with pytest.raises(ArchiveError, match="contact points were others"):
        tc.run(cases.stack(), samples=300, seed=3, solver="daqp", out=path, resume=True)


@pytest.mark.parametrize("how", ["resume", "overwrite"])
def test_an_archive_is_not_taken_from_the_run_that_writes_it(how, tmp_path):
    path = tmp_path / "live.nc"
    with start(script("run_stack", path, 1000, "--step")) as begun:
        begun.stdout.readline()
        with pytest.raises(ArchiveError, match="being written by another run"):
            tc.run(cases.stack(), samples=1000, seed=3, solver="daqp", out=path, **{how: True})
        done = finish(begun, "go on\n")
    assert done.returncode == 0
    with tc.open_archive(path) as tree:
        assert (tree["status"].values != -1).all()
    assert [p.name for p in tmp_path.iterdir()] == ["live.nc"]


def test_a_full_disk_is_told_and_leaves_nothing_behind(tmp_path):
    assert run(script("run_on_a_full_disk", tmp_path / "full.nc")).returncode == 7
    assert not list(tmp_path.iterdir())


def test_an_archive_without_finished_realizations_has_no_statistics(archive, tmp_path):
    path = tmp_path / "begun.nc"
    path.write_bytes(archive.read_bytes())
    with netCDF4.Dataset(path, "r+") as file:
        file["status"][:] = -1
    with tc.open_archive(path) as tree, pytest.raises(ArchiveError, match="go on with --resume"):
        tc.summarize(tree)


@pytest.mark.parametrize("keep", ["measures", "poses", "all"])
def test_what_is_kept_of_each_realization_can_be_chosen(keep, archive, tmp_path):
    tc.run(cases.stack(), samples=300, seed=3, solver="daqp", out=tmp_path / "some.nc", keep=keep).close()
    some, every = xr.load_datatree(tmp_path / "some.nc"), xr.load_datatree(archive)
    assert ("rotation" in some) == ("translation" in some) == (keep != "measures")
    assert ("deviation" in some["sample"]) == (keep == "all")
    for name in ("measured", "gap_min", "active", "carrying", "reaction", "status", "iterations", "kkt_residual"):
        assert (some[name].values == every[name].values).all(), name
    for name in ("mean", "six_sigma", "magnitude_six_sigma_interval"):
        assert (some["field/middle"][name].values == every["field/middle"][name].values).all()
    assert tc.summarize(some).identical(tc.summarize(every))
    with pytest.raises(tc.TolcontactError, match="expected one of: measures, poses, all"):
        tc.run(cases.stack(), samples=300, keep="everything")


def test_resuming_another_run_or_model_is_refused_and_leaves_the_file_alone(archive):
    before = archive.read_bytes()
    with pytest.raises(ArchiveError, match="seed = 3, now it is 4"):
        tc.run(cases.stack(), samples=300, seed=4, solver="daqp", out=archive, resume=True)
    with pytest.raises(tc.TolcontactError, match="choose one of the two"):
        tc.run(cases.stack(), samples=300, seed=3, solver="daqp", out=archive, resume=True, overwrite=True)
    with pytest.raises(ArchiveError, match="another model"):
        tc.run(cases.ra1(), samples=300, seed=3, solver="daqp", out=archive, resume=True)
    with pytest.raises(ArchiveError, match="resolution = linearized, now it is exact"):
        tc.run(cases.stack(), samples=300, seed=3, solver="daqp", method=EXACT, out=archive, resume=True)
    with pytest.raises(ArchiveError, match="exists"):
        tc.run(cases.stack(), samples=300, seed=3, solver="daqp", out=archive)
    assert archive.read_bytes() == before
