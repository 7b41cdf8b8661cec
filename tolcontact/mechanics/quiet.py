"""Plugins print: banners, and messages about problems that cannot be solved, which no option turns off for good.

CasADi passes all of that on to Python's streams, in the thread that called it. So those streams are replaced, while any thread
is in `quiet`, by ones that let through what the other threads write.
"""

import contextlib
import sys
import threading
from collections import deque
from collections.abc import Iterator
from typing import Any

MAKING = threading.RLock()  # CasADi's objects are made one after the other, whatever the thread

_LOCK = threading.Lock()
_THREAD = threading.local()
_inside = 0  # how many times threads are in `quiet`


class _Muffled:
    """A stream that drops what the threads in `quiet` write."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        return len(text) if getattr(_THREAD, "depth", 0) else self.stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


# Those of the last streams: `print` of another thread does not keep the one alive that it writes to.
_kept: deque[_Muffled] = deque(maxlen=16)


def _muffled(stream: Any) -> _Muffled:
    for muffled in _kept:
        if muffled.stream is stream:
            return muffled
    _kept.append(_Muffled(stream))
    return _kept[-1]


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Swallow what plugins print in this thread; other threads print on."""
    global _inside  # noqa: PLW0603  the streams are global, so is who has replaced them
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
