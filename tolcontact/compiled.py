"""Functions compiled by Numba, whose machine code is kept in the cache of machine code.

Numba's own cache would trust whatever lies in its folders, does not notice a change in a function that another one calls, and
refuses to import if no folder can be written.
"""

import functools
import hashlib
import io
import pickle
import sys
from collections.abc import Callable, Iterator, Sequence
from types import CodeType
from typing import Any

import numba
import numpy as np
from numba import njit
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.core.environment import Environment, lookup_environment
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from tolcontact import code_cache

_REBUILDER = ("numba.core.environment", "_rebuild_env")  # what Numba stores to get an environment back
CONSTANTS = (bool, int, float, str, bytes, tuple, type(None))


def compiled(function: Callable[..., Any], *, inline: bool = False, counts: bool = True, inner: bool = False) -> Any:
    """Return the function, compiled when it is first called; with `inline`, it becomes part of its callers.

    counts   whether it counts references to arrays. A function that creates no array need not; if it passes on tuples of many
             arrays, counting takes longer than the arithmetic.
    inner    whether only compiled functions call it, so that it needs no entrance from Python, which takes long to compile
    """
    # `_nrt` is Numba's own option for code without reference counts, as on graphics processors.
    dispatcher = njit(
        nogil=True, error_model="numpy", forceinline=inline, _nrt=counts, no_cpython_wrapper=inner, no_cfunc_wrapper=inner
    )(function)
    dispatcher._cache = _Cache(dispatcher)
    return dispatcher


inlined = functools.partial(compiled, inline=True)
uncounted = functools.partial(compiled, counts=False)
inlined_uncounted = functools.partial(compiled, counts=False, inline=True)
inner = functools.partial(compiled, counts=False, inner=True)
inlined_inner = functools.partial(compiled, counts=False, inline=True, inner=True)


class _Cache(NullCache):  # type: ignore[misc]
    """What a dispatcher asks for the code that it needs, and gives the code that it compiled."""

    def __init__(self, dispatcher: Dispatcher) -> None:
        self._dispatcher = dispatcher

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        # Code that is ready needs the runtime alone; what a compiler needs takes as long to load as all the code together.
        rtsys.initialize(target_context)
        code = code_cache.load(self._key(sig, target_context.codegen()))
        try:
            return None if code is None else CompileResult._rebuild(target_context, *_Unpickler(io.BytesIO(code)).load())
        except Exception:  # another build of the same version may lack anything
            return None

    def save_overload(self, sig: Any, result: Any) -> None:
        # Another process could not use code that holds addresses of this one.
        if not result.library.has_dynamic_globals and all(part.can_cache for part in result.lifted):
            code_cache.store(self._key(sig, result.codegen), dumps(result._reduce()))

    def _key(self, sig: Any, codegen: Any) -> str:
        parts = [numba.__version__, sys.version, repr(sig), repr(codegen.magic_tuple()), *_description(self._dispatcher, set())]
        return hashlib.blake2b("\n".join(parts).encode(), digest_size=20).hexdigest()


class _Unpickler(pickle.Unpickler):
    """The reader of stored code, which does not import the modules of Numba that the functions in it come from.

    It takes as long to import these as to load the code, and only a compiler needs their names.
    """

    def find_class(self, module: str, name: str) -> Any:
        return _environment if (module, name) == _REBUILDER else super().find_class(module, name)


def _environment(module: str, constants: Sequence[Any], name: str) -> Environment:
    """Return the environment of a function: objects that its code may need, such as those of an exception."""
    environment = lookup_environment(name)
    if environment is None:
        environment = Environment(sys.modules[module].__dict__ if module in sys.modules else {"__name__": module})
        environment.consts[:] = constants
        environment.env_name = name
        Environment._memo[name] = environment
    return environment


def _description(dispatcher: Dispatcher, known: set[Dispatcher]) -> Iterator[str]:
    """Yield texts on which the code of a function depends: its instructions, and those of compiled functions that it calls."""
    known.add(dispatcher)
    function = dispatcher.py_func
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    yield f"{function.__module__}.{function.__qualname__} {sorted(dispatcher.targetoptions.items())}"
    for code in _codes(function.__code__):
        yield code.co_code.hex()
        values = [function.__globals__.get(name, name) for name in code.co_names]
        for value in (*(constant for constant in code.co_consts if not isinstance(constant, CodeType)), *values, *cells):
            if isinstance(value, Dispatcher):
                yield from () if value in known else _description(value, known)
            elif isinstance(value, np.ndarray):
                yield value.tobytes().hex()
            else:
                yield repr(value) if isinstance(value, CONSTANTS) else getattr(value, "__name__", type(value).__name__)


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield the code of a function, and of those inside it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)
