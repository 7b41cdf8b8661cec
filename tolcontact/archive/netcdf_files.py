"""NetCDF files that are opened with small caches, by one thread at a time, as the netCDF library demands."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import netCDF4
from xarray.backends import NetCDF4DataStore

from tolcontact.system import files

CACHE_BYTES = 1 << 20  # a chunk of most variables; with the usual size, all caches would take as much memory as all else

with netCDF4.Dataset("in memory", "w", diskless=True) as _file:
    XARRAY_LOCK = NetCDF4DataStore(_file).lock  # type: ignore[no-untyped-call]  # held while xarray uses the library


@contextlib.contextmanager
def open_netcdf(path: Path, mode: Literal["w", "r+", "r"]) -> Iterator[netCDF4.Dataset]:
    """Open a file whose values are read and written as they are, without masks. Meanwhile xarray uses no netCDF file."""
    with XARRAY_LOCK, small_caches(), netCDF4.Dataset(files.plain_path(path), mode, format="NETCDF4") as file:
        file.set_auto_maskandscale(False)
        yield file


@contextlib.contextmanager
def small_caches() -> Iterator[None]:
    """Give each variable of a file that is opened meanwhile a small cache."""
    usual = netCDF4.get_chunk_cache()
    try:
        netCDF4.set_chunk_cache(CACHE_BYTES)
        yield
    finally:
        netCDF4.set_chunk_cache(*usual)
