"""Insides of `archive` under the claims of `tests/test_archive.py`."""

import numpy as np

from tolcontact.archive.netcdf_files import open_netcdf
from tolcontact.archive.writer import choose


def test_values_are_not_masked(archive):
    with open_netcdf(archive, "r") as file:
        assert all(type(file[name][:5]) is np.ndarray for name in ("status", "measured", "contact/moving_point"))


def test_rows_are_not_read_where_none_are_to_be_checked():
    no_file = None
    assert [len(values) for values in choose(no_file, 0, seed=1)] == [0, 0]
