"""Realizations as lazy datasets: those of a run to the last bit, however they are asked for."""

import sys

import dask.array
import numpy as np
import psutil
import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tests.helpers import PAPER, compiled, nightly
from tolcontact.discretization import discretize


def rows_of(results, name):
    return (results["sample"].to_dataset() if name == "deviation" else results.to_dataset())[name]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "samples", "options"),
    [
        ("stack", 1500, {"solver": "daqp", "method": {"resolution": "exact"}}),
        *nightly(("ra1", 40_000, {"solver": "qpoases"}), ("spindle", 513, {"solver": "daqp"})),
    ],
)
def test_realizations_are_those_of_a_run(name, samples, options):
    model = getattr(cases, name, lambda: cases.model(name))()
    expected = tc.run(model, samples=samples, seed=3, surfaces=0, fields="none", **options)
    found = tc.simulate(model, samples, seed=3, **options)
    assert all(isinstance(of.data, dask.array.Array) for of in found.data_vars.values())
    loaded = found.compute()
    for variable, values in loaded.data_vars.items():
        of_run = rows_of(expected, variable)
        assert values.dims == of_run.dims and values.dtype == of_run.dtype
        np.testing.assert_array_equal(values, of_run)
        assert {k: str(v) for k, v in values.attrs.items()} == {k: str(v) for k, v in of_run.attrs.items()}
        for label in values.coords:
            np.testing.assert_array_equal(values[label], of_run[label])
    for setting in ("solver", "solver_options", "resolution", "seed", "samples", "sampler", "block_rows"):
        assert found.attrs[setting] == expected.attrs[setting]


def test_a_model_without_contact():
    a = tc.Assembly("alone")
    part = a.part("plate", tc.Box(100, 50, 10))
    a.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=10), tolerance=0.1)
    a.measure("corner", part.point(100, 50, 10), along="z")
    found = tc.simulate(a, 50).compute()
    assert found.sizes["pair"] == 0 and found.gap_min.shape == (50, 2, 0) and (found.status == tc.Status.UNTOUCHED).all()


@pytest.mark.slow
def test_deviations_of_ones_own():
    program = compiled(cases.ra1(), solver="daqp")
    labels = list(program.nominal.contributors)
    drawn = tc.run(program, samples=500, seed=4, surfaces=0, fields="none")
    mixed = (
        drawn["sample/deviation"]
        .reset_coords(drop=True)
        .assign_coords(contributor=labels)
        .isel(contributor=slice(None, None, -1))
    )
    given = tc.simulate(program, mixed.transpose())
    named = mixed.isel(realization=[3, 1]).assign_coords(realization=["part 4", "part 2"])
    assert np.array_equal(tc.simulate(program, named).measured.sel(realization="part 2"), drawn.measured[1])
    assert np.array_equal(given.measured, drawn.measured) and given.attrs["sampler"] == "given" and "seed" not in given.attrs
    chunked = xr.DataArray(dask.array.from_array(mixed.sel(contributor=labels).values, chunks=(77, 5)), dims=mixed.dims)
    found = tc.simulate(program, chunked)
    assert found.measured.chunks[0][0] == 77 and np.array_equal(found.measured, drawn.measured)
    wild = chunked.copy(data=np.where(np.arange(500)[:, None] == 7, np.nan, chunked.values))
    assert np.flatnonzero(tc.simulate(program, wild).status == tc.Status.NOT_CONVERGED).tolist() == [7]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (np.zeros((5, 3)), "deviations have 3 contributors; expected 12: base.A1, base.A2"),
        (np.full((5, 12), "x"), "deviations are <U1; expected numbers"),
        (np.zeros((0, 12)), "deviations have no realizations"),
        (np.zeros((5, 12, 1)), "deviations have the dimensions realization, contributor, other; expected realization and"),
    ],
)
def test_deviations_that_cannot_be_used(given, said):
    array = xr.DataArray(given, dims=("realization", "contributor", "other")[: given.ndim])
    with pytest.raises(tc.OptionError, match=said):
        tc.simulate(cases.ra1(), array)


def test_what_is_no_number_of_realizations():
    for wrong in (np.zeros((5, 12)), "5", 5.0):
        with pytest.raises(tc.OptionError, match=f"samples is a {type(wrong).__name__}; expected a number of realizations, or"):
            tc.simulate(cases.ra1(), wrong)


def test_deviations_of_unknown_or_repeated_contributors():
    labels = list(discretize(cases.ra1()).contributors)
    for wrong in ([*labels[:-1], "nobody"], [*labels, labels[0]]):
        array = xr.DataArray(np.zeros((2, len(wrong))), {"contributor": wrong}, ("realization", "contributor"))
        with pytest.raises(tc.OptionError, match=r'deviations of "(nobody|base\.A1)" are missing, unknown, or given twice'):
            tc.simulate(cases.ra1(), array)


def test_without_dask_the_message_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "dask.array", None)
    with pytest.raises(tc.OptionError, match=r"need dask; install it with: pip install 'tolcontact\[dask\]'"):
        tc.simulate(cases.ra1(), 100)


@pytest.mark.slow
def test_what_is_written_is_streamed(tmp_path):
    """Netcdf and zarr hold what a run gives, and memory does not grow with their size."""
    program, own = compiled(cases.ra1(), solver="daqp", method=PAPER), psutil.Process()
    some = tc.simulate(program, 10_000, seed=2)[["measured", "status"]]
    some.to_netcdf(tmp_path / "some.nc")
    some.to_zarr(tmp_path / "some.zarr")
    expected = tc.run(program, samples=10_000, seed=2, surfaces=0, fields="none", keep="measures")
    for found in (xr.open_dataset(tmp_path / "some.nc"), xr.open_zarr(tmp_path / "some.zarr")):
        with found:
            np.testing.assert_array_equal(found.measured, expected.measured)
            assert found.measured.attrs["units"] == "mm" and found.measure.values.tolist() == ["corner height"]
    tc.simulate(program, 30_000, seed=2).measured.mean("realization").compute()  # after which threads have their memory
    before = own.memory_info().rss
    mean = tc.simulate(program, 300_000, seed=2).measured.mean("realization").values  # 170 MB if it were all in memory
    assert own.memory_info().rss - before < 90e6
    assert mean[:, 0] == pytest.approx(expected.measured.mean("realization").values[:, 0], abs=0.05)


@pytest.mark.slow
def test_designs_are_one_graph_by_xarray_alone():
    models = {"narrow": cases.one_dimensional(2), "wide": cases.one_dimensional(6), "stack": cases.stack()}
    designs = [(n, r, s) for n in models for r in ("linearized", "exact") for s in (1, 7)]
    programs = {(n, r): compiled(models[n], solver="daqp", method={"resolution": r}) for n, r, _ in designs}
    alone = [tc.simulate(programs[n, r], 100, seed=s) for n, r, s in designs]
    names = xr.Variable("design", [", ".join(map(str, design)) for design in designs])
    found = xr.concat(alone, names, join="outer", combine_attrs="drop_conflicts")
    assert found.measured.dims == ("design", "realization", "state", "measure") and found.sizes["design"] == 12
    loaded = found.compute()
    for k, run in enumerate(alone):
        for variable, values in run.compute().data_vars.items():
            own = loaded[variable].isel(design=k).sel({dim: run[dim] for dim in values.dims if dim != "realization"})
            np.testing.assert_array_equal(own, values)
    there = loaded.sel(design="narrow, linearized, 1")
    assert np.isnan(there.measured.sel(measure="top")).all() and np.isnan(there.active.sel(pair="upper joint")).all()


@pytest.mark.parametrize(
    ("model", "options", "said"),
    [
        (cases.ra1, {"method": "exact"}, "method is 'exact'; expected a tc.Method, or some of its choices"),
        (lambda: compiled(cases.ra1()), {"solver": "daqp"}, "a Program has its solver and method"),
    ],
)
def test_a_lazy_run_refuses_what_a_run_refuses(model, options, said):
    with pytest.raises(tc.OptionError, match=said):
        tc.simulate(model(), 100, **options)
