"""The lock on the netCDF library, which only one thread may use at a time."""

import contextlib
import sys


def library_lock() -> contextlib.AbstractContextManager[object]:
    """Return the lock that xarray holds while it reads and closes files; before xarray is imported, nobody else does."""
    locks = sys.modules.get("xarray.backends.locks")
    if locks is None:
        return contextlib.nullcontext()
    lock: contextlib.AbstractContextManager[object] = locks.combine_locks([locks.NETCDFC_LOCK, locks.HDF5_LOCK])
    return lock
