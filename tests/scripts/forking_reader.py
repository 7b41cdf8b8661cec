"""Runs Python files, one for each line of standard input, in processes that are forked when the libraries are imported.

A line is a JSON list: the folder to run in, the file and its arguments.
"""

import json
import os
import runpy
import sys
import tempfile

import netCDF4  # noqa: F401 (imported once, for all)

from tolcontact import vocabulary  # noqa: F401

for line in sys.stdin:
    folder, *arguments = json.loads(line)
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        process = os.fork()
        if process == 0:
            os.dup2(out.fileno(), 1)
            os.dup2(err.fileno(), 2)
            os.chdir(folder)
            sys.argv = arguments
            runpy.run_path(arguments[0], run_name="__main__")
            sys.stdout.flush()
            os._exit(0)
        code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        out.seek(0)
        err.seek(0)
        print(json.dumps([code, out.read().decode("latin-1"), err.read().decode("latin-1")]), flush=True)
