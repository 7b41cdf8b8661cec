"""Functions compiled by Numba, whose machine code is kept in the user's cache folder for later processes.

Numba notices a change in the file of a function, but not in a file whose functions it calls. So the folder is named after the
content of all files with compiled functions.
"""

import functools
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

from tolcontact import code_cache
from tolcontact.system.ownership import is_private


def compiled(function: Callable[..., Any], *, inline: bool = False, counts: bool = True, inner: bool = False) -> Any:
    """Return the function, compiled when it is first called; with `inline`, it becomes part of its callers.

    counts   whether it counts references to arrays. A function that creates no array need not; if it passes on tuples of many
             arrays, counting takes longer than the arithmetic.
    inner    whether only compiled functions call it, so that it needs no entrance from Python, which takes long to compile
    """
    folder, usual_folder = _cache_folder(), numba.config.CACHE_DIR
    options = {"forceinline": inline, "no_cpython_wrapper": inner, "no_cfunc_wrapper": inner, "cache": folder is not None}
    try:
        numba.config.CACHE_DIR = usual_folder if folder is None else str(folder)
        return numba.njit(nogil=True, error_model="numpy", **options, **({} if counts else _without_counts()))(function)
    finally:
        numba.config.CACHE_DIR = usual_folder


inlined = functools.partial(compiled, inline=True)
uncounted = functools.partial(compiled, counts=False)
inlined_uncounted = functools.partial(compiled, counts=False, inline=True)
inner = functools.partial(compiled, counts=False, inner=True)
inlined_inner = functools.partial(compiled, counts=False, inline=True, inner=True)


@functools.cache
def _without_counts() -> dict[str, bool]:
    """Return Numba's option for code without reference counts, as on graphics processors; none if this version has none.

    The option is not public. Without it, exact runs take 1.3 times as long (models/ra2.py 646 and 495 us of CPU time for each
    realization, tower.py 3.79 and 2.95 ms, Numba 0.68), nearly all of it in geometry/places_kernel.py, which passes on tuples
    of many arrays; linearized runs, and exact ones of ra1.py, take as long. Inlining these functions does not help.
    """
    option = {"_nrt": False}
    try:
        numba.njit(**option)(lambda: None)
    except KeyError:
        return {}
    return option


@functools.cache
def _cache_folder() -> Path | None:
    """Return the folder for these sources; None if there is none that this user alone can write to."""
    package, content = Path(__file__).parent, hashlib.blake2b(numba.__version__.encode(), digest_size=8)
    for path in (Path(__file__), *sorted(package.rglob("*kernel.py"))):
        content.update(path.read_bytes())
    folder = code_cache.cache_folder().with_name("numba") / content.hexdigest()
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        return folder if is_private(folder) else None
    except OSError:
        return None
