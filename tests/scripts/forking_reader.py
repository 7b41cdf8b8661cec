"""Runs Python files, one for each line of standard input, in processes that are forked when the libraries are imported.

A line is a JSON list: the folder to run in, the file and its arguments.
"""

import functools
import json
import os
import sys
import tempfile
from pathlib import Path

import netCDF4  # noqa: F401 (imported once, for all)

from tolcontact import vocabulary  # noqa: F401


@functools.cache
def code_of(path):
    """The code of a file. What it imports is imported once, for all."""
    code = compile(Path(path).read_bytes(), path, "exec")
    exec(code, {"__name__": "imported", "__file__": path})
    return code


for line in sys.stdin:
    folder, *arguments = json.loads(line)
    code_of(arguments[0])
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = os.fork()
        if process == 0:
            os.dup2(out.fileno(), 1)
            os.dup2(err.fileno(), 2)
            os.chdir(folder)
            sys.argv = arguments
            exec(code_of(arguments[0]), {"__name__": "__main__", "__file__": arguments[0]})
            sys.stdout.flush()
            os._exit(0)
        code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        out.seek(0)
        err.seek(0)
        print(json.dumps([code, out.read().decode("latin-1"), err.read().decode("latin-1")]), flush=True)
