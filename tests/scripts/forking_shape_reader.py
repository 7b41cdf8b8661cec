"""Runs the program that reads shape files in processes that are forked when trimesh and the CAD kernel are imported.

forking_shape_reader.py SOCKET. A request is a JSON list: a folder, the file and its arguments, with the standard streams of
the new process; the answer is its number. Or it is the number of such a process, and whether to wait for its end; the answer
is its exit code, or null.
"""

import contextlib
import gc
import io
import json
import os
import runpy
import socket
import sys

import trimesh

from tolcontact.child import Refusal
from tolcontact.shape_worker import PROGRAM

with contextlib.suppress(Refusal):  # there may be no kernel
    runpy.run_path(str(PROGRAM))["step_document"]()  # imported once, for all
trimesh.load_scene(io.BytesIO(trimesh.creation.box().export(file_type="stl")), file_type="stl")  # it imports more
gc.freeze()


def begin(streams, folder, arguments):
    """Run a file in a new process; return its number."""
    if (process := os.fork()) == 0:
        for number, stream in enumerate(streams):
            os.dup2(stream, number)
        os.closerange(3, max(connection.fileno(), *streams) + 1)
        os.chdir(folder)
        sys.argv = arguments
        runpy.run_path(arguments[0], run_name="__main__")
        os._exit(0)
    for stream in streams:
        os.close(stream)
    return process


def ended(process, is_waiting):
    """The exit code of a process, where it has ended."""
    number, status = os.waitpid(process, 0 if is_waiting else os.WNOHANG)
    return os.waitstatus_to_exitcode(status) if number else None


connection = socket.socket(fileno=int(sys.argv[1]))
while True:
    request, streams, _, _ = socket.recv_fds(connection, 2**16, 3)
    if not request:
        break
    first, *others = json.loads(request)
    answer = begin(streams, first, others) if streams else ended(first, *others)
    connection.sendall(json.dumps(answer).encode())
