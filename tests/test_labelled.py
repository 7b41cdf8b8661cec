"""Tables of NumPy arrays: they hold and select what xarray does, from an archive too."""

import gzip
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import tolcontact as tc
from tolcontact.archive import open_tables
from tolcontact.labelled import Group, Table
from tolcontact.statistics import dataset_of, summary_table

ARCHIVES = sorted((Path(__file__).parent / "archives").glob("*.nc.gz"))


def datasets(numbers):
    """The same columns as a table and as a dataset."""
    columns = {
        "value": (("row", "state", "pair"), numbers, {"units": "mm"}),
        "share": (("pair",), numbers[0, 0], {}),
        "total": ((), numbers.sum(), {}),
    }
    coords = {"state": ["raw", "corrected"], "pair": ["a", "b", "c"], "kind": ("pair", ["round", "flat", "flat"])}
    return Table(columns, coords, {"title": "t"}), xr.Dataset(columns, coords, {"title": "t"})


@pytest.mark.parametrize(
    "select",
    [
        lambda data: data,
        lambda data: data.sel(state="corrected"),
        lambda data: data.isel({"row": slice(2, 9)}).isel({"row": slice(1, 3)}),
        lambda data: data.isel({"row": 3}).sel(pair=["c", "a"]),
        lambda data: data.sel(pair=["c", "a"]).isel({"pair": 1}),
        lambda data: data[["value"]].sel({"state": "raw"}, pair="b") if isinstance(data, Table) else data[["value"]].sel(
            {"state": "raw", "pair": "b"}
        ),
    ],
)  # fmt: skip
def test_tables_select_as_xarray_does(select):
    table, dataset = map(select, datasets(np.random.default_rng(1).normal(size=(12, 2, 3))))
    assert set(table.data_vars) == set(dataset.data_vars) and set(table.coords) == set(dataset.coords)
    assert table.sizes == dict(dataset.sizes) and table.attrs == dataset.attrs
    for name in dataset.variables:
        assert table[name].dims == dataset[name].dims and table[name].attrs == dataset[name].attrs
        np.testing.assert_array_equal(table[name].values, dataset[name].values)


def test_columns_turn_as_arrays_of_xarray_do():
    table, dataset = datasets(np.arange(72.0).reshape(12, 2, 3))
    for dims in (("pair", ...), ("state", "pair", "row")):
        turned, expected = table["value"].transpose(*dims), dataset["value"].transpose(*dims)
        assert turned.dims == expected.dims
        np.testing.assert_array_equal(turned.values, expected.values)


def check_group(group: Group, tree: xr.DataTree):
    table, dataset = group.to_dataset(), tree.to_dataset()
    assert set(group.children) == set(tree.children)
    for name in set(dataset.variables) - {"realization"}:
        assert table[name].dims == dataset[name].dims
        np.testing.assert_array_equal(table[name].values, dataset[name].values)
    for name, child in group.children.items():
        check_group(child, tree[name])


@pytest.mark.parametrize("stored", ARCHIVES, ids=lambda path: path.name)
def test_archives_are_read_and_summed_up_as_with_xarray(stored, tmp_path):
    path = tmp_path / "run.nc"
    path.write_bytes(gzip.decompress(stored.read_bytes()))
    with tc.open_archive(path) as tree:
        expected = tc.summarize(tree)
        tree.load()
    with open_tables(path) as tables:
        check_group(tables, tree)
        xr.testing.assert_identical(dataset_of(summary_table(tables)), expected)
