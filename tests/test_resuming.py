"""A run goes on to what it would have come to at once, or is refused."""

import netCDF4
import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tests.helpers import PAPER, contents, nightly
from tolcontact.errors import ArchiveError


@pytest.mark.slow
@pytest.mark.parametrize(("solver", "keep"), nightly(("daqp", "all"), ("qpoases", "measures")))
def test_resume_gives_the_same_data_as_an_undisturbed_run(solver, keep, tmp_path):
    paths = [tmp_path / "grown.nc", tmp_path / "whole.nc"]
    for samples in (300, 5000, 5000, 9000):
        tc.run(cases.stack(), samples=samples, seed=3, solver=solver, out=paths[0], resume=True, keep=keep).close()
    tc.run(cases.stack(), samples=9000, seed=3, solver=solver, out=paths[1], keep=keep).close()
    for group in (None, "sample", "contact", "field/bottom", "field/middle", "field/upper"):
        grown, whole = (contents(path, group) for path in paths)
        assert grown.identical(whole), group
    assert xr.load_dataset(paths[0]).attrs["history"].count("resumed after 4096") == 2


@pytest.mark.slow
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
    with pytest.raises(ArchiveError, match="contact points differ"):
        tc.run(cases.stack(), samples=300, seed=3, solver="daqp", out=path, resume=True)


@pytest.mark.slow
def test_resuming_another_run_or_model_is_refused_and_leaves_the_file_alone(archive):
    before = archive.read_bytes()
    with pytest.raises(ArchiveError, match="seed = 3, now it is 4"):
        tc.run(cases.stack(), samples=300, seed=4, solver="daqp", out=archive, resume=True)
    with pytest.raises(tc.TolcontactError, match="choose one of the two"):
        tc.run(cases.stack(), samples=300, seed=3, solver="daqp", out=archive, resume=True, overwrite=True)
    with pytest.raises(ArchiveError, match="another model"):
        tc.run(cases.ra1(), samples=300, seed=3, solver="daqp", out=archive, resume=True)
    with pytest.raises(ArchiveError, match="resolution = exact, now it is linearized"):
        tc.run(cases.stack(), samples=300, seed=3, solver="daqp", method=PAPER, out=archive, resume=True)
    with pytest.raises(ArchiveError, match="exists"):
        tc.run(cases.stack(), samples=300, seed=3, solver="daqp", out=archive)
    assert archive.read_bytes() == before
