"""Silence for plugins, which print banners and messages that no option turns off for good.

CasADi passes their output to Python's streams, in the thread that called it. While any thread is in `quiet`, other streams take
their place, which pass on only the output of the other threads.
"""

import contextlib
import sys
import threading
from collections import deque
from collections.abc import Iterator
from typing import Any

CONSTRUCTION_LOCK = threading.RLock()  # CasADi's objects must be made one after the other, in all threads

_LOCK = threading.Lock()
_THREAD = threading.local()
_inside = 0  # how many times threads are in `quiet`


class _Muffled:
    """A stream that drops the output of threads in `quiet`."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        return len(text) if getattr(_THREAD, "depth", 0) else self.stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


# The latest ones are kept alive: `print` in another thread holds no reference to the stream that it writes to.
_kept: deque[_Muffled] = deque(maxlen=16)


def _muffled(stream: Any) -> _Muffled:
    for muffled in _kept:
        if muffled.stream is stream:
            return muffled
    _kept.append(_Muffled(stream))
    return _kept[-1]


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Drop the output of plugins in this thread; other threads print as before."""
    global _inside  # noqa: PLW0603  the streams are global, so is their replacement
    with _LOCK:
        _inside += 1
        for name in ("stdout", "stderr"):
            stream = getattr(sys, name)
            if stream is not None and not isinstance(stream, _Muffled):
                setattr(sys, name, _muffled(stream))
    _THREAD.depth = getattr(_THREAD, "depth", 0) + 1
    try:
        yield
    finally:
        _THREAD.depth -= 1
        with _LOCK:
            _inside -= 1
            for name in ("stdout", "stderr") if not _inside else ():
                stream = getattr(sys, name)
                if isinstance(stream, _Muffled):  # else ours have been replaced meanwhile
                    setattr(sys, name, stream.stream)
