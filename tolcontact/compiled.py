"""Functions compiled by Numba and kept on disk between runs, if that can be done: a cache only saves time.

Compiled functions lie in the package's own `__pycache__`, else in the user's cache folder. Numba alone refuses to import
if neither can be written, and to continue once a file there has been cut off.
"""

import contextlib
import functools
from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core.caching import FunctionCache


def compiled(function: Callable[..., Any], *, inline: bool = False, counts: bool = True) -> Any:
    """Return the function, compiled when it is first called; `inline`, it becomes part of those that call it.

    counts   whether it counts references to arrays. A function that creates no array need not; if it passes on tuples of many
             arrays, counting takes longer than the arithmetic.
    """
    # `_nrt` is Numba's own option for code without reference counts, as on graphics processors.
    dispatcher = njit(nogil=True, error_model="numpy", forceinline=inline, _nrt=counts)(function)
    with contextlib.suppress(RuntimeError):  # there is no folder to write to
        dispatcher._cache = _Cache(function)  # what njit(cache=True) does, with Numba's own class
    return dispatcher


inlined = functools.partial(compiled, inline=True)
uncounted = functools.partial(compiled, counts=False)
inlined_uncounted = functools.partial(compiled, counts=False, inline=True)


class _Cache(FunctionCache):  # type: ignore[misc]
    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # unpickling a damaged file may raise anything
            with contextlib.suppress(OSError):
                self.flush()  # else the damaged index would be read again, to be added to
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        with contextlib.suppress(OSError):  # the disk is full, or the folder was writable once
            super().save_overload(sig, data)
