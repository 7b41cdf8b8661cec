"""The machine: its processors, its memory, and the plugins of its libraries."""

import os

import lazy_loader

from tolcontact.system.files import IS_POSIX

psutil = lazy_loader.load("psutil")  # on Windows


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
