"""The netCDF library: its lock, since only one thread may use it at a time, and the memory of its caches."""

import contextlib
import sys
from collections.abc import Iterator

import netCDF4

CACHE_BYTES = 1 << 20  # a chunk of most variables; with the size that is usual, all would take as much memory as all else


def library_lock() -> contextlib.AbstractContextManager[object]:
    """Return the lock that xarray holds while it reads and closes files; before xarray is imported, nobody else does."""
    locks = sys.modules.get("xarray.backends.locks")
    if locks is None:
        return contextlib.nullcontext()
    lock: contextlib.AbstractContextManager[object] = locks.combine_locks([locks.NETCDFC_LOCK, locks.HDF5_LOCK])
    return lock


@contextlib.contextmanager
def small_caches() -> Iterator[None]:
    """Give each variable of a file that is opened meanwhile a small cache."""
    usual = netCDF4.get_chunk_cache()
    try:
        netCDF4.set_chunk_cache(CACHE_BYTES)
        yield
    finally:
        netCDF4.set_chunk_cache(*usual)
