"""Archives of the present format are read for good; those of another one are refused with what to do.

`tests/archives/format_1.nc.gz` is written once: see `tests/scripts/write_archive.py`.
"""

import gzip
import sys
from pathlib import Path

import netCDF4
import pytest

import tolcontact as tc
from tests.helpers import SCRIPTS, compiled, model_in, run
from tolcontact.errors import ArchiveError
from tolcontact.testing import assert_gaps_recompute, assert_resolved, assert_same_run
from tolcontact.vocabulary import BY_REALIZATION, FORMAT, LOCATOR_OFFSET

STORED = Path(__file__).parent / f"archives/format_{FORMAT}.nc.gz"
# Of the corner, raw and corrected.
PINNED = {
    "mean": (0.006953289641898, 0.02640833319761937),
    "6 sigma": (0.7870888491507, 0.2838545733289374),
    "largest": (0.5591756338771934, 0.4441624193425243),
}
METHOD = tc.Method(search="fixed", objective="active points")  # of the archive


@pytest.fixture
def stored(tmp_path):
    """The archive that is kept for good."""
    path = tmp_path / "bars.nc"
    path.write_bytes(gzip.decompress(STORED.read_bytes()))
    return path


def test_the_archive_is_opened_and_summarized(stored):
    summary = tc.summarize(stored)
    corner = summary["statistic_value"].sel(measure="corner", interval="estimate")
    for statistic in ("mean", "6 sigma"):
        assert corner.sel(statistic=statistic).values == pytest.approx(PINNED[statistic], rel=1e-9)
    assert summary["by_status"].values.tolist() == [0, 8, 0, 0, 0]
    largest = summary["field_extreme"].sel(part="block", extreme="largest", interval="estimate")
    assert largest.values == pytest.approx(PINNED["largest"], rel=1e-9)
    assert_resolved(stored)
    assert_gaps_recompute(stored)


@pytest.mark.slow
def test_its_model_is_rebuilt_and_gives_the_same_results(stored):
    model = model_in(stored)
    program = compiled(model, method=METHOD)
    assert program.nominal.locators.labels[:6] == tuple(f"block.{name}" for name in ("A1", "A2", "A3", "B1", "B2", "C"))
    with tc.open_archive(stored) as then:
        now = tc.run(model, samples=8, seed=1, solver="daqp", method=METHOD, surfaces=4)
        assert abs(now["measured"] - then["measured"]).max() < 1e-9
        assert (now["gap_min"].sel(state="corrected") > -1e-9).all()
        assert (now["status"].values == then["status"].values).all()


def test_it_is_read_without_this_package(stored):
    done = run([sys.executable, "-I", SCRIPTS / "read_plainly.py", stored])
    assert (done.returncode, done.stdout) == (0, "1 1 1 1 1 1 1 1\n"), done.stderr
    with netCDF4.Dataset(stored) as file:
        assert file["measured"].dimensions == ("realization", "state", "measure") and file["measured"].units


@pytest.mark.slow
def test_it_is_resumed_but_not_with_points_that_count_otherwise(stored, tmp_path):
    settings = {"seed": 1, "solver": "daqp", "method": METHOD, "surfaces": 4, "fields": 16_384}
    other = tmp_path / "other.nc"
    other.write_bytes(stored.read_bytes())
    with netCDF4.Dataset(other, "a") as file:
        file.weighting = "active points"
    with pytest.raises(tc.TolcontactError, match="weighting = active points, now it is active points, by area"):
        tc.run(model_in(stored), samples=16, out=other, resume=True, **settings)
    tc.run(model_in(stored), samples=16, out=stored, resume=True, **settings).close()
    written = [
        variable.name for variable in BY_REALIZATION if variable is not LOCATOR_OFFSET
    ]  # which is newer than the archive
    assert_same_run(stored, tc.run(model_in(stored), samples=16, **settings), variables=written)


def test_an_archive_of_another_format_is_neither_read_nor_resumed_and_left_alone(stored):
    model = model_in(stored)
    with netCDF4.Dataset(stored, "a") as file:
        file.format = FORMAT + 1
    before = stored.read_bytes()
    for use in (tc.open_archive, tc.summarize, lambda path: tc.run(model, samples=16, method=METHOD, out=path, resume=True)):
        with pytest.raises(ArchiveError, match=f"has format {FORMAT + 1}, and this version of tolcontact reads"):
            use(stored)
    assert stored.read_bytes() == before and [*stored.parent.iterdir()] == [stored]
