"""Analyses kept in archives, and what the page shows of them."""

import json
import shutil
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tests.helpers import PAPER, call, compiled
from tests.test_report import data_of, unpacked
from tolcontact.report import write_page

FAST = {"solver": "daqp", "method": PAPER}


@pytest.fixture(scope="module")
def ra1():
    return compiled(cases.ra1(), **FAST)


@pytest.fixture(scope="module")
def run_of_ra1(ra1, tmp_path_factory):
    path = tmp_path_factory.mktemp("ra1") / "ra1.nc"
    tc.run(ra1, samples=300, out=path, surfaces=4, fields=64).close()
    return path


@pytest.fixture
def archive(run_of_ra1, tmp_path):
    """A copy, to be changed."""
    return Path(shutil.copy(run_of_ra1, tmp_path))


@pytest.mark.slow
def test_an_archive_keeps_what_was_asked_of_its_model(ra1, archive):
    kept = {
        "contributions": tc.analyses.contributions(ra1, samples=256, into=archive),
        "sensitivities": tc.analyses.sensitivities(ra1, samples=16, into=archive),
        "worst_case": tc.analyses.worst_case(ra1, samples=16, into=archive),
        "tails": tc.analyses.tails(ra1, samples=30_000, into=archive),
        "allocation": tc.analyses.allocate(ra1, "corner height: ppm 700000", samples=256, by="part", into=archive),
    }
    with tc.open_archive(archive) as results:
        assert results.sizes["realization"] == 300 and tc.summarize(results).attrs["realizations"] == 300
        for name, found in kept.items():
            there = results[f"statistics/{name}"].to_dataset()
            for each in found.data_vars:
                np.testing.assert_array_equal(there[each], found[each])
                assert there[each].dims == found[each].dims and "long_name" in there[each].attrs
            assert there.attrs.items() >= {"title": found.attrs["title"]}.items()
        write_page(results, tc.summarize(results), archive.with_suffix(".html"))
    page = archive.with_suffix(".html").read_text(encoding="utf-8")
    assert '<h2 id="answers">Contributors' in page and "Worst cases: corner height [mm]" in page and "Rare events" in page
    assert "beyond linear: sensitivities change" in page
    assert "Allocation" in page and "Cost 2 before" in page
    drawn = data_of(page)["scene"]["realizations"]
    assert drawn["names"][:2] == [f"worst-case {end}: corner height" for end in ("minimum", "maximum")]
    measured, worst = unpacked(drawn["measured"]), kept["worst_case"].worst.sel(state="corrected").values[0]
    assert measured[:2, 1, 0] == pytest.approx(worst, rel=1e-6) and len(unpacked(drawn["motions"])) == len(drawn["names"])
    case = kept["worst_case"].sel(case="least corner height", state="corrected", part="top")
    corner = case.rotation.values @ [100, 12.5, 20] + case.translation.values
    assert corner[2] - 20 == pytest.approx(float(case.measured[0]), abs=1e-9)
    assert '"groups":["base.A2"' in page
    with netCDF4.Dataset(archive) as file:  # without us
        assert file["statistics/contributions/total"].units == "1"
    tc.run(ra1, samples=600, out=archive, resume=True, surfaces=4, fields=64).close()
    with xr.open_datatree(archive) as longer:
        assert longer.sizes["realization"] == 600 and "tails" in longer["statistics"].children


def test_a_model_without_contact_can_be_asked_as_well():
    a = tc.Assembly("alone")
    part = a.part("plate", tc.Box(100, 50, 10))
    a.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=10), tolerance=0.1)
    a.measure("corner", part.point(100, 50, 10), along="z", tolerance=0.1)
    program = compiled(a, **FAST)
    worst = tc.analyses.worst_case(program, samples=64)
    assert np.abs(worst.worst.values - worst.bound.values).max() < 1e-3
    assert float(tc.analyses.contributions(program, samples=256).missed.max()) < 1e-3
    nominal = tc.analyses.sensitivities(program, samples=4).nominal.values[0]
    assert worst.bound.values[0, 0, 1] == pytest.approx(0.05 * np.abs(nominal).sum(), abs=1e-9)
    assert tc.analyses.tails(program, samples=30_000).sizes["event"] == 1


@pytest.mark.slow
def test_a_page_without_analyses_has_no_such_section(archive, tmp_path):
    with tc.open_archive(archive) as results:
        write_page(results, tc.summarize(results), tmp_path / "page.html")
    assert "What matters" not in (tmp_path / "page.html").read_text(encoding="utf-8")


@pytest.mark.slow
def test_what_does_not_fit_leaves_the_archive_as_it_was(ra1, archive, tmp_path):
    before = archive.read_bytes()
    with pytest.raises(tc.errors.ArchiveError, match="another model"):
        tc.analyses.sensitivities(cases.one_dimensional(0), samples=4, into=archive, **FAST)
    with pytest.raises(tc.errors.ArchiveError, match="does not exist"):
        tc.analyses.sensitivities(ra1, samples=4, into=tmp_path / "none.nc")
    (tmp_path / "text.nc").write_text("no archive")
    with pytest.raises(tc.errors.ArchiveError, match=r"text\.nc"):
        tc.analyses.sensitivities(ra1, samples=4, into=tmp_path / "text.nc")
    assert archive.read_bytes() == before
    tc.analyses.sensitivities(ra1, samples=4, into=archive)
    once = archive.read_bytes()
    with pytest.raises(tc.errors.ArchiveError, match="already has statistics/sensitivities"):
        tc.analyses.sensitivities(ra1, samples=4, into=archive)
    assert archive.read_bytes() == once and not [path for path in tmp_path.iterdir() if path.name.startswith(".")]


@pytest.mark.slow
def test_numbers_that_were_damaged_are_not_shown(ra1, archive):
    tc.analyses.contributions(ra1, samples=16, into=archive)
    content = bytearray(archive.read_bytes())
    with netCDF4.Dataset(archive) as file:
        values = file["statistics/contributions/linear"][:].tobytes()
    assert content.count(values) == 1
    content[content.index(values) + 24] ^= 1
    archive.write_bytes(content)
    with (
        tc.open_archive(archive) as results,
        pytest.raises(tc.errors.ArchiveError, match="contributions in the archive is not what"),
    ):
        write_page(results, tc.summarize(results), archive.with_suffix(".html"))


@pytest.mark.slow
def test_the_command_keeps_it_too(tmp_path):
    model, out = cases.MODELS / "ra1.py", tmp_path / "a.nc"
    assert call(tmp_path, "run", model, "--samples", "64", "--solver", "daqp", "--out", out).returncode == 0
    options = ("sensitivities", model, "--samples", "4", "--solver", "daqp", "--into", out)
    done = call(tmp_path, *options)
    assert done.returncode == 0, done.stderr
    with xr.open_datatree(out) as results:
        assert results["statistics/sensitivities"].attrs["realizations"] == 4
    assert call(tmp_path, *options).returncode == 2


@pytest.mark.slow
def test_the_model_of_an_archive_is_analysed_by_the_method_seed_and_solver_of_its_run(tmp_path):
    path = tmp_path / "ra1.nc"
    method = tc.Method(resolution="exact", objective="all points", active_set="initial")
    program = compiled(cases.ra1(), solver="daqp", method=method)
    tc.run(program, samples=4, seed=7, out=path, surfaces=0).close()
    expected = tc.analyses.sensitivities(program, samples=8, seed=7)
    done = call(tmp_path, "sensitivities", path, "--samples", "8", "--json")
    assert done.returncode == 0, done.stderr
    found = xr.Dataset.from_dict(json.loads(done.stdout))
    assert found.attrs["seed"] == 7 and found.attrs["solver"] == "daqp" and found.attrs["resolution"] == "exact"
    np.testing.assert_allclose(found.sensitivity.astype(float), expected.sensitivity, atol=1e-9)
    assert tc.build(path).method == method
    assert tc.build(path, method={"objective": "active points"}).method.active_set == "initial"
    other = call(tmp_path, "sensitivities", path, "--samples", "8", "--seed", "8", "--json")
    assert json.loads(other.stdout)["attrs"]["seed"] == 8


def test_an_archive_without_a_usable_model_is_refused_by_name(tmp_path, archive):
    with netCDF4.Dataset(archive, "a") as file:
        file.resolution = "approximate"
    for path, reason in (
        (archive, "the model in .*ra1.nc. cannot be rebuilt.*approximate"),
        (tmp_path / "no.nc", "does not exist"),
    ):
        with pytest.raises(tc.errors.ArchiveError, match=reason):
            tc.analyses.tails(path)
