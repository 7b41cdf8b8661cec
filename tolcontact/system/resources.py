"""The memory and the processor time of this process: how much it may use, and how much it has used."""

import contextlib
import math
import sys
import time
from pathlib import Path

import lazy_loader

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
