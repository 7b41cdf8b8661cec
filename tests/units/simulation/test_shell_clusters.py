"""Schedulers and workers of dask that a user starts in shells: lost processes and slow lines change no result."""

import asyncio
import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading

import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import assert_same_archive, call, posix_only
from tolcontact.errors import ClusterError
from tolcontact.simulation import cluster
from tolcontact.simulation.cluster import running_cluster

pytestmark = pytest.mark.slow


@pytest.fixture
def dask_processes():
    """Begins a scheduler, or a worker of it, as a user does: in a shell."""
    begun = []

    def begin(command, *options):
        code = f"from distributed.cli.dask_{command} import main; main()"
        environment = {**os.environ, "DASK_DISTRIBUTED__NANNY__PRE_SPAWN_ENVIRON__MALLOC_TRIM_THRESHOLD_": "100000000"}
        begun.append(subprocess.Popen(
            [sys.executable, "-c", code, *map(str, options)], env=environment, stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, start_new_session=True,
        ))  # fmt: skip
        return begun[-1]

    yield begin
    for process in begun:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def free_port():
    with contextlib.closing(socket.socket()) as own:
        own.bind(("127.0.0.1", 0))
        return own.getsockname()[1]


def scheduler(begin, port):
    return begin("scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard")


def worker(begin, port):
    return begin("worker", f"tcp://127.0.0.1:{port}", "--nthreads", 1, "--no-dashboard")


@posix_only
def test_a_scheduler_and_workers_in_shells(dask_processes, tmp_path):
    port = free_port()
    first = scheduler(dask_processes, port)
    workers = [worker(dask_processes, port) for _ in range(2)]
    address, whole, path = f"tcp://127.0.0.1:{port}", tmp_path / "whole.nc", tmp_path / "run.nc"
    options = {"samples": 24_000, "solver": "daqp", "surfaces": 4}
    tc.run(cases.stack(), out=whole, **options).close()
    done = call(
        tmp_path, "run", cases.MODELS / "ra1.py", "--solver", "daqp", "--samples", "9000", "--scheduler", address, "--quiet"
    )
    assert done.returncode in (0, 1), done.stderr
    begun = []

    def restart(rows):
        """The scheduler dies and another one begins at its address; one of the workers is lost for good."""
        if rows >= 9000 and not begun:
            os.killpg(first.pid, signal.SIGKILL)
            os.killpg(workers[0].pid, signal.SIGKILL)
            first.wait()
            begun.append(scheduler(dask_processes, port))
            begun.append(worker(dask_processes, port))

    with running_cluster(address) as own:
        tc.run(cases.stack(), out=path, client=own, progress=restart, **options).close()
    assert begun
    assert_same_archive(path, whole)


class SlowLine:
    """Passes on what comes to a port, late and little by little."""

    DELAY, RATE = 0.03, 20e6  # s, bytes/s

    def __init__(self, target):
        self.port, self._target, self.passed = free_port(), target, 0
        threading.Thread(target=lambda: asyncio.run(self._serve()), daemon=True).start()

    async def _serve(self):
        async with await asyncio.start_server(self._connect, "127.0.0.1", self.port) as server:
            await server.serve_forever()

    async def _connect(self, reader, writer):
        there, back = await asyncio.open_connection("127.0.0.1", self._target)
        await asyncio.gather(self._pass_on(reader, back), self._pass_on(there, writer))

    async def _pass_on(self, reader, writer):
        with contextlib.suppress(OSError):
            while data := await reader.read(1 << 18):
                await asyncio.sleep(self.DELAY + len(data) / self.RATE)
                writer.write(data)
                await writer.drain()
                self.passed += len(data)
        writer.close()


@pytest.mark.nightly
def test_a_slow_network_changes_nothing(dask_processes, tmp_path):
    port, own = free_port(), free_port()
    scheduler(dask_processes, port)
    line = SlowLine(own)
    dask_processes(
        "worker", f"tcp://127.0.0.1:{port}", "--nthreads", 1, "--no-dashboard", "--no-nanny",
        "--listen-address", f"tcp://127.0.0.1:{own}", "--contact-address", f"tcp://127.0.0.1:{line.port}",
    )  # fmt: skip
    options = {"samples": 12_000, "solver": "daqp", "surfaces": 4}
    tc.run(cases.stack(), out=tmp_path / "whole.nc", **options).close()
    with running_cluster(f"tcp://127.0.0.1:{port}") as client:
        tc.run(cases.stack(), out=tmp_path / "run.nc", client=client, **options).close()
    assert line.passed > 5e6
    assert_same_archive(tmp_path / "run.nc", tmp_path / "whole.nc")


@pytest.mark.nightly
@posix_only
def test_a_run_that_all_workers_left_ends(dask_processes):
    port = free_port()
    scheduler(dask_processes, port)
    only = worker(dask_processes, port)
    program, done = tc.build(cases.stack(), solver="daqp"), []
    with running_cluster(f"tcp://127.0.0.1:{port}") as own:
        own.wait_for_workers(1, timeout=120)
        with pytest.raises(ClusterError, match="all workers are gone, and none came within 2 s"):
            for rows in cluster.Workers(own, timeout=2.0)(len, program, samples=200_000, seed=1):
                done.append(rows)
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(only.pid, signal.SIGKILL)
        assert 4096 <= sum(done) < 200_000
        with pytest.raises(ClusterError, match="no worker came within 1 s"):
            cluster.Workers(own, timeout=1.0)
