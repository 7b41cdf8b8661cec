"""Calls of the functions in a model script: whatever they do, a run goes on as it would without it, or ends in one message."""

import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable
from contextvars import ContextVar
from pathlib import Path
from typing import Any

import numpy as np

_IS_RUNNING = ContextVar("is_running", default=False)


class FunctionError(Exception):
    """What a user's function raised, in words that follow "its function"."""


def called(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a user's function returns.

    The working folder, the standard streams, signal handlers, filters of warnings, the limit of recursion, the path of
    modules and NumPy's error handling are afterwards as before.
    Raises FunctionError for whatever it raises, sys.exit included, and if it closed a standard stream. Ctrl-C passes.
    """
    streams, errors = (sys.stdin, sys.stdout, sys.stderr), np.geterr()
    folder = _working_folder()
    is_main = threading.current_thread() is threading.main_thread()
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)} if is_main else {}
    recursion, modules, token = sys.getrecursionlimit(), list(sys.path), _IS_RUNNING.set(True)
    try:
        with warnings.catch_warnings():
            result = function(*arguments)
    except KeyboardInterrupt:
        raise
    except SystemExit as ended:
        raise FunctionError(f"ended the program with sys.exit({ended.code!r})") from ended
    except BaseException as error:
        first_line = next(iter(str(error).splitlines()), "")
        raise FunctionError(f"failed with {type(error).__name__}: {first_line}") from error
    finally:
        if folder is not None and folder.exists():
            os.chdir(folder)
        sys.stdin, sys.stdout, sys.stderr = streams
        _IS_RUNNING.reset(token)
        sys.setrecursionlimit(recursion)
        sys.path[:] = modules
        np.seterr(**errors)
        for number, handler in handlers.items():
            if handler is not None and signal.getsignal(number) is not handler:
                signal.signal(number, handler)
    if any(stream is not None and stream.closed for stream in streams[1:]):
        raise FunctionError("closed a standard stream; other results are printed to it")
    return result


def _working_folder() -> Path | None:
    try:
        return Path.cwd()
    except FileNotFoundError:  # it has been removed
        return None


def refuse_in_functions() -> None:
    """Raise RuntimeError while a user's function runs: the model it belongs to is being built, and must not change."""
    if _IS_RUNNING.get():
        raise RuntimeError("it declares something while the model is being built; declare it before, in assembly()")
