"""Archives are inspected in processes that are forked from one in which the libraries are imported.

A process of its own takes a third of a second to import them, and tests open hundreds of archives.
"""

import json
import os
import subprocess
import threading
from pathlib import Path
from typing import NamedTuple

from tests.helpers import script
from tolcontact.child import environment

OWN = ("PYTEST_CURRENT_TEST", "PYTHONPATH")  # variables that may differ without a difference to the reader


class Answer(NamedTuple):
    """A process that has ended, as far as somebody who waits for its end looks at it."""

    returncode: int
    output: bytes
    errors: bytes

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def communicate(self):
        return self.output, self.errors


class ForkedReader:
    """Runs Python files as `subprocess.Popen` does, in the environment of the first call."""

    def __init__(self):
        self._process, self._lock = None, threading.Lock()
        self._environment = shared(environment())

    def reads(self, command, options):
        """Whether a command inspects an archive, in no other environment."""
        if not hasattr(os, "fork"):
            return False
        is_inspection = isinstance(command, list) and len(command) > 3 and str(command[2]).endswith("archive/inspection.py")
        return is_inspection and shared(options.get("env") or {}) == self._environment

    def answer(self, command):
        with self._lock:
            if self._process is None:
                pipes = dict.fromkeys(("stdin", "stdout"), subprocess.PIPE)
                self._process = subprocess.Popen(script("forking_reader"), env=environment(), text=True, **pipes)
            print(json.dumps([str(Path.cwd()), *map(str, command[2:])]), file=self._process.stdin, flush=True)
            code, out, err = json.loads(self._process.stdout.readline())
        return Answer(code, out.encode("latin-1"), err.encode("latin-1"))

    def close(self):
        if self._process is not None:
            self._process.stdin.close()
            self._process.wait()


def shared(variables):
    return {name: value for name, value in variables.items() if name not in OWN}
