"""The standard streams: all three are open, and no letter that a terminal or its code page lacks ends a command."""

import io
import os
import sys


def open_closed() -> None:
    """Open a closed standard input, output or error as the null device: else the next file takes its number, and its output."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(number, True)
    os.close(number)
    sys.stdin = sys.stdin or os.fdopen(0)
    sys.stdout = sys.stdout or os.fdopen(1, "w")
    sys.stderr = sys.stderr or os.fdopen(2, "w")


def escape_unprintable() -> None:
    """Print letters that the encoding of standard output and error lacks as escapes."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
