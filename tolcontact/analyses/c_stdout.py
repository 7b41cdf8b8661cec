"""Silence for C code that prints: HiGHS has prints in its integer programs that none of its options turns off.

With glibc the stream `stdout` of C is a variable. While any thread is in `muted_c_stdout` it is a stream to the null device.
The file descriptor stays as it is, so Python's own output, of this thread and of all others, is not touched.
"""

import contextlib
import ctypes
import functools
import os
import platform
import threading
from collections.abc import Iterator

_LOCK = threading.Lock()
_inside = 0  # how many times threads are in `muted_c_stdout`
_stream: int | None = None  # the address of the stream that was replaced


@functools.cache
def _null_stream() -> int | None:
    """Return the address of a C stream to the null device; it stays open, as another thread may be printing to it."""
    library = ctypes.CDLL(None)
    library.fopen.restype = ctypes.c_void_p
    return library.fopen(os.devnull.encode(), b"w")


@contextlib.contextmanager
def muted_c_stdout() -> Iterator[None]:
    """Drop what C code prints to its stream `stdout`; without glibc, drop nothing."""
    global _inside, _stream  # noqa: PLW0603  the stream is global, so is its replacement
    if platform.libc_ver()[0] != "glibc":
        yield
        return
    variable = ctypes.c_void_p.in_dll(ctypes.CDLL(None), "stdout")
    with _LOCK:
        _inside += 1
        if _inside == 1:
            _stream, variable.value = variable.value, _null_stream()
    try:
        yield
    finally:
        with _LOCK:
            _inside -= 1
            if not _inside:
                variable.value = _stream
