"""Shape files are read in processes that are forked from one in which the CAD kernel is loaded.

A process of its own takes more than a second to load it, and tests read hundreds of STEP files.
"""

import contextlib
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from select import select

from tests.helpers import SCRIPTS
from tolcontact import shape_worker
from tolcontact.child import environment

PROGRAM = os.fspath(shape_worker.PROGRAM)
OWN = ("PYTEST_CURRENT_TEST", "MALLOC_ARENA_MAX")  # variables that may differ without a difference to the worker


class ForkedProcess:
    """A process of a worker, like one of `subprocess.Popen`, of which another process is the parent."""

    returncode = None

    def __init__(self, orders, errors):
        own_in, self.stdin = os.pipe()
        self.stdout, own_out = os.pipe()
        report, own_report = os.pipe()
        files = [own_in, own_out, errors.fileno(), own_report]
        socket.send_fds(orders, [os.fsencode(Path.cwd())], files)
        for file in (own_in, own_out, own_report):
            os.close(file)
        self.stdin, self.stdout = os.fdopen(self.stdin, "wb"), os.fdopen(self.stdout, "rb")
        self._report = os.fdopen(report)
        self.pid = int(self._report.readline())

    def wait(self):
        if self.returncode is None:
            with self._report:
                self.returncode = int(self._report.readline())
        return self.returncode

    def poll(self):
        if self.returncode is None and select([self._report], [], [], 0)[0]:
            self.wait()
        return self.returncode

    def kill(self):
        if self.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self.pid, signal.SIGKILL)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stdout.close()
        self.stdin.close()
        self.wait()


class ForkedWorkers:
    """Starts workers in the environment that the tests begin with."""

    def __init__(self):
        self._process, self._environment = None, shared(environment())

    def forks(self, command, options):
        """Whether a command starts a worker, in no other environment."""
        if not hasattr(os, "fork") or not isinstance(command, list) or command[:3] != [sys.executable, "-P", PROGRAM]:
            return False
        return shared(options["env"]) == self._environment

    def process(self, options):
        if self._process is None:
            self._orders, theirs = socket.socketpair()
            with theirs:
                command = [sys.executable, "-P", SCRIPTS / "forking_worker.py"]
                self._process = subprocess.Popen(command, env=options["env"], stdin=theirs)
        return ForkedProcess(self._orders, options["stderr"])

    def close(self):
        if self._process is not None:
            self._orders.close()
            self._process.wait()


def shared(variables):
    return {name: value for name, value in variables.items() if name not in OWN}


def forking(popen, workers):
    """The class of processes, but for workers."""

    class Popen(popen):
        def __new__(cls, *arguments, **options):
            is_worker = cls is Popen and workers.forks(next(iter(arguments), None), options)
            return workers.process(options) if is_worker else super().__new__(cls)

    return Popen
