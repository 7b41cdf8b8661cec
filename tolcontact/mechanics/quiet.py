"""Suppression of plugin output: banners and messages that no option turns off reliably.

CasADi passes plugin output to Python's streams, in the calling thread. While any thread is in `quiet`, these streams are
replaced by streams that pass on only the output of the other threads.
"""

import contextlib
import sys
import threading
from collections import deque
from collections.abc import Iterator
from typing import Any

CONSTRUCTION_LOCK = threading.RLock()  # only one thread at a time may construct CasADi objects

_LOCK = threading.Lock()
_THREAD = threading.local()
_depth = 0  # number of `quiet` contexts that are open in all threads


class _Muffled:
    """A stream that drops the output of threads in `quiet`."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        return len(text) if getattr(_THREAD, "depth", 0) else self.stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


# The latest streams are kept alive: `print` in another thread holds no reference to the stream that it writes to.
_streams: deque[_Muffled] = deque(maxlen=16)


def _muffled(stream: Any) -> _Muffled:
    for muffled in _streams:
        if muffled.stream is stream:
            return muffled
    _streams.append(_Muffled(stream))
    return _streams[-1]


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Drop the output of plugins in this thread; other threads print as before."""
    global _depth  # noqa: PLW0603  the streams are global, so is their replacement
    with _LOCK:
        _depth += 1
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
            _depth -= 1
            for name in ("stdout", "stderr") if not _depth else ():
                stream = getattr(sys, name)
                if isinstance(stream, _Muffled):  # otherwise another replacement has been installed in the meantime
                    setattr(sys, name, stream.stream)
