"""Archives of every format are read for good; those of earlier formats are not resumed.

Formats 6 and 7, of runs with stations and springs alone, are read by the tests of these.

The files in `tests/archives` are written once, by the version whose format they have: see `tests/scripts/write_archive.py`.
"""

import gzip
import sys
from pathlib import Path

import netCDF4
import pytest

import tolcontact as tc
from tests.helpers import SCRIPTS, model_in, run
from tolcontact.errors import ArchiveError
from tolcontact.testing import assert_gaps_recompute, assert_resolved, assert_same_run
from tolcontact.vocabulary import FORMAT

STORED = {int(path.name.split("_")[1].split(".")[0]): path for path in Path(__file__).parent.glob("archives/format_*.nc.gz")}
# Of the corner, raw and corrected: points count once each in archives before format 5, and by their areas since.
PINNED = {
    "mean": (0.006953289641898, 0.03176192756255),
    "6 sigma": (0.7870888491507, 0.3424490287245),
    "largest": (0.5591756338771934, 0.45877503188437524),
}
PINNED_BY_AREA = {
    "mean": (0.006953289641898, 0.02640833319761937),
    "6 sigma": (0.7870888491507, 0.2838545733289374),
    "largest": (0.5591756338771934, 0.4441624193425243),
}
BY_AREA = 5  # the first format of archives whose points count by area

AS_THEN = tc.Method(search="fixed", objective="active points")  # of the archives


@pytest.fixture(params=sorted(STORED), ids=lambda number: f"format {number}")
def stored(request, tmp_path):
    """An archive of each format."""
    path = tmp_path / "bars.nc"
    path.write_bytes(gzip.decompress(STORED[request.param].read_bytes()))
    return path


def format_of(path):
    with netCDF4.Dataset(path) as file:
        return int(getattr(file, "format", 1))


def test_there_is_an_archive_of_every_format():
    assert sorted(STORED) == [1, 2, 3, 4, 5, FORMAT], "write the missing one with tests/scripts/write_archive.py"


@pytest.mark.slow
def test_it_is_opened_and_summarized(stored):
    summary, by_area = tc.summarize(stored), format_of(stored) >= BY_AREA
    pinned = PINNED_BY_AREA if by_area else PINNED
    corner = summary["statistic_value"].sel(measure="corner", interval="estimate")
    for statistic in ("mean", "6 sigma"):
        assert corner.sel(statistic=statistic).values == pytest.approx(pinned[statistic], rel=1e-9)
    assert summary["by_status"].values.tolist() == [0, 8, 0, 0, 0]
    largest = summary["field_extreme"].sel(part="block", extreme="largest", interval="estimate")
    assert largest.values == pytest.approx(pinned["largest"], rel=1e-9)
    assert_resolved(stored)
    assert_gaps_recompute(stored)


@pytest.mark.slow
def test_its_model_is_rebuilt_and_comes_to_the_same(stored):
    model = model_in(stored)
    assert tc.build(model).nominal.locators.labels[:6] == tuple(f"block.{name}" for name in ("A1", "A2", "A3", "B1", "B2", "C"))
    with tc.open_archive(stored) as then:
        now = tc.run(model, samples=8, seed=1, solver="daqp", method=AS_THEN, surfaces=4)
        apart = abs(now["measured"] - then["measured"]).max(["realization", "measure"]).values
        # Of the corrected state gaps alone: contact points counted once each, and count now by the areas that they stand for.
        assert apart[0] < 1e-9 and (apart[1] < 1e-9) == (format_of(stored) >= BY_AREA)
        assert (now["gap_min"].sel(state="corrected") > -1e-9).all()
        assert (now["status"].values == then["status"].values).all()


@pytest.mark.slow
def test_it_is_read_without_this_package(stored):
    done = run([sys.executable, "-I", SCRIPTS / "read_plainly.py", stored])
    assert (done.returncode, done.stdout) == (0, "1 1 1 1 1 1 1 1\n"), done.stderr
    with netCDF4.Dataset(stored) as file:
        assert file["measured"].dimensions == ("realization", "state", "measure") and file["measured"].units


@pytest.mark.slow
@pytest.mark.parametrize("stored", range(1, BY_AREA + 1), indirect=True, ids=lambda number: f"format {number}")
def test_an_earlier_format_is_not_resumed_and_the_file_is_left_alone(stored):
    model, before = model_in(stored), stored.read_bytes()
    with pytest.raises(ArchiveError) as refused:
        tc.run(model, samples=16, seed=1, solver="daqp", method=AS_THEN, surfaces=4, out=stored, resume=True)
    assert str(refused.value) == f'"{stored}" was begun by an earlier version of tolcontact: it can be read, not resumed'
    assert stored.read_bytes() == before and [*stored.parent.iterdir()] == [stored]


@pytest.mark.slow
@pytest.mark.parametrize("stored", [FORMAT], indirect=True, ids=lambda number: f"format {number}")
def test_the_present_format_is_resumed_but_not_with_points_that_count_otherwise(stored, tmp_path):
    settings = {"seed": 1, "solver": "daqp", "method": AS_THEN, "surfaces": 4, "fields": 16_384}
    other = tmp_path / "other.nc"
    other.write_bytes(stored.read_bytes())
    with netCDF4.Dataset(other, "a") as file:
        file.weighting = "active points"
    with pytest.raises(tc.TolcontactError, match="weighting = active points, now it is active points, by area"):
        tc.run(model_in(stored), samples=16, out=other, resume=True, **settings)
    tc.run(model_in(stored), samples=16, out=stored, resume=True, **settings).close()
    assert_same_run(stored, tc.run(model_in(stored), samples=16, **settings))


def test_tolerances_of_form_drew_nothing_in_earlier_formats():
    a = tc.Assembly("block")
    block = a.part("block", tc.Box(10, 10, 10))
    block.feature("top", block.face("+z"), tc.Flatness(0.1))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=1), tolerance=0.1)
    a.measure("corner", block.point(0, 0, 0), along="z")
    results = tc.run(a, samples=2, seed=1)
    (feature,) = tc.model_of(results).features
    assert feature.tolerances == (tc.Flatness(0.1),)
    results.attrs["format"] = 4
    (feature,) = tc.model_of(results).features
    assert feature.tolerances == (tc.Flatness(0.1, form=None),)
