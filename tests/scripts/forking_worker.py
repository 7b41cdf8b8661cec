"""Reads shape files in processes that are forked from this one, which has loaded the CAD kernel once for all.

An order comes on the socket that is standard input. It is a folder, with four files: standard input, output and errors of the
process, and a pipe for its number and its exit code.
"""

import contextlib
import importlib.util
import os
import socket

from tolcontact import shape_worker

specification = importlib.util.spec_from_file_location("worker", shape_worker.PROGRAM)
worker = importlib.util.module_from_spec(specification)
specification.loader.exec_module(worker)
with contextlib.suppress(worker.Refusal):  # the fault of a STEP file, if one comes
    worker.step_document()


def serve(folder, files, report):
    """Fork the process that reads, and report its number and its exit code."""
    process = os.fork()
    if process == 0:
        os.close(report)
        for number, file in enumerate(files):
            os.dup2(file, number)
        os.closerange(3, 256)
        os.chdir(folder)
        worker.work()
        os._exit(0)
    for file in files:
        os.close(file)
    os.write(report, f"{process}\n".encode())
    os.write(report, f"{os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])}\n".encode())


orders = socket.socket(fileno=0)
while True:
    folder, files, _, _ = socket.recv_fds(orders, 4096, 4)
    if not folder:
        break
    if os.fork() == 0:
        serve(folder, files[:3], files[3])
        os._exit(0)
    for file in files:
        os.close(file)
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
