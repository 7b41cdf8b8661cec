"""Shape files are read in processes that are forked from one in which trimesh and the CAD kernel are imported.

A process of its own takes a second to import them, and tests read hundreds of files.
"""

import json
import os
import signal
import socket
import subprocess
import threading
import time
from pathlib import Path

from tests.forked_reader import shared
from tests.helpers import script
from tolcontact.child import environment


class ForkedShapeReader:
    """Starts the program that reads shape files, as `subprocess.Popen` does, in the environment of the first call."""

    def __init__(self):
        self._process, self._lock = None, threading.Lock()
        self._environment = shared(environment() | {"MALLOC_ARENA_MAX": "4"})

    def reads(self, command, options):
        """Whether a command reads shape files, in no other environment."""
        if not (hasattr(os, "fork") and hasattr(socket, "send_fds")):
            return False
        is_reader = isinstance(command, list) and len(command) > 2 and str(command[2]).endswith("geometry/files/worker.py")
        return is_reader and shared(options.get("env") or {}) == self._environment

    def start(self, command, errors):
        """A process that reads files; what goes wrong there is written to a file `errors`."""
        return Fork(self, [str(Path.cwd()), *map(str, command[2:])], errors)

    def ask(self, request, streams=()):
        with self._lock:
            if self._process is None:
                self._connection, other = socket.socketpair()
                with other:
                    command, inherited = script("forking_shape_reader", other.fileno()), [other.fileno()]
                    env = environment() | {"MALLOC_ARENA_MAX": "4"}
                    self._process = subprocess.Popen(command, env=env, pass_fds=inherited, stdin=subprocess.DEVNULL)
            socket.send_fds(self._connection, [json.dumps(request).encode()], streams)
            return json.loads(self._connection.recv(2**16))

    def close(self):
        if self._process is not None:
            self._connection.close()
            self._process.wait()


class Fork:
    """A process that reads files, as far as `shape_worker` and its tests look at it."""

    def __init__(self, reader, request, errors):
        self._reader, self.returncode = reader, None
        (theirs_in, ours_in), (ours_out, theirs_out) = os.pipe(), os.pipe()
        self.pid = reader.ask(request, [theirs_in, theirs_out, errors.fileno()])
        os.close(theirs_in)
        os.close(theirs_out)
        self.stdin, self.stdout = os.fdopen(ours_in, "wb"), os.fdopen(ours_out, "rb")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stdout.close()
        try:
            self.stdin.close()
        finally:
            self.wait()

    def poll(self, is_waiting=False):
        if self.returncode is None:
            self.returncode = self._reader.ask([self.pid, is_waiting])
        return self.returncode

    def wait(self, timeout=None):
        if timeout is None:
            return self.poll(is_waiting=True)
        end = time.monotonic() + timeout
        while self.poll() is None:
            if time.monotonic() > end:
                raise subprocess.TimeoutExpired("a reader of shapes", timeout)
            time.sleep(0.01)
        return self.returncode

    def kill(self):
        if self.poll() is None:
            os.kill(self.pid, signal.SIGKILL)
