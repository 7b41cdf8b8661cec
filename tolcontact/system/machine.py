"""The machine, its processors, its memory, and how much of them this process may use and has used."""

import contextlib
import math
import os
import sys
import time
from pathlib import Path

import lazy_loader

from tolcontact.system.files import IS_POSIX

psutil = lazy_loader.load("psutil")  # on Windows
try:
    import resource
except ImportError:  # on Windows, where nothing is limited
    resource = None  # type: ignore[assignment]

# What `limit_resources` limits here; a watch over the process limits the rest.
ENFORCED = frozenset(() if resource is None else ("time",) if sys.platform == "darwin" else ("time", "memory"))
_PEAK_UNIT = 1 if sys.platform == "darwin" else 1024  # bytes; of the peak memory that the system states


def limit_resources(memory: int, *, seconds: float | None = None) -> None:
    """Limit this process to `memory` [byte] and to `seconds` of processor time from now on, and let it leave no core."""
    if resource is None:
        return
    limits = {resource.RLIMIT_AS: memory, resource.RLIMIT_CORE: 0}
    if seconds is not None:
        limits[resource.RLIMIT_CPU] = math.ceil(time.process_time() + seconds)
    for name, limit in limits.items():
        _, hard = resource.getrlimit(name)
        allowed = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
        with contextlib.suppress(OSError, ValueError):  # some systems lack a limit
            resource.setrlimit(name, (allowed, hard))


def address_space() -> int | None:
    """Return the address space [byte] that this process may use; None without a limit."""
    if resource is None:
        return None
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    return None if limit == resource.RLIM_INFINITY else limit


def free_address_space() -> float:
    """Return the address space [byte] that this process may still take; infinite without a limit."""
    limit, statistics = address_space(), Path("/proc/self/statm")
    if limit is None or not statistics.exists():
        return math.inf
    return limit - int(statistics.read_text().split()[0]) * resource.getpagesize()


def peak_memory() -> int | None:
    """Return the largest memory [byte] that this process has used so far; None where the system does not tell."""
    if resource is None:
        return getattr(psutil.Process().memory_info(), "peak_wset", None)
    return int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * _PEAK_UNIT)


def processors() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def machine_memory() -> int:
    """Return the memory [byte] of this machine."""
    if hasattr(os, "sysconf"):
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return int(psutil.virtual_memory().total)


def skip_plugins() -> None:
    """Let the HDF5 library use no plugins on Windows, where it looks at all of them for each variable of an archive.

    They are for compressions that archives do not have. Only before the library is imported.
    """
    if not IS_POSIX:
        os.environ.setdefault("HDF5_PLUGIN_PRELOAD", "::")
