"""Calls of the functions in a model script: whatever they do, a run goes on as it would without it, or ends in one message."""

import os
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np


class FunctionError(Exception):
    """What a user's function raised, in words that follow "its function"."""


def called(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a user's function returns.

    The working folder, the standard streams, signal handlers and NumPy's error handling are afterwards as before.
    Raises FunctionError for whatever it raises, sys.exit included, and if it closed a standard stream. Ctrl-C passes.
    """
    streams, errors = (sys.stdin, sys.stdout, sys.stderr), np.geterr()
    folder = Path.cwd() if Path().exists() else None
    is_main = threading.current_thread() is threading.main_thread()
    handlers = {number: signal.getsignal(number) for number in signal.valid_signals()} if is_main else {}
    try:
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
        np.seterr(**errors)
        for number, handler in handlers.items():
            if handler is not None and signal.getsignal(number) is not handler:
                signal.signal(number, handler)
    if any(stream is not None and stream.closed for stream in streams[1:]):
        raise FunctionError("closed a standard stream; other results are printed to it")
    return result
