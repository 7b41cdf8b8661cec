"""Workers of a dask cluster, as processes of their own: the same results to the last bit, whatever happens to them."""

import contextlib
import os
import random
import re
import signal
import socket
import ssl
import subprocess
import time
from importlib.metadata import version
from types import SimpleNamespace

import numpy as np
import psutil
import pytest

import tolcontact as tc
from tests import cases
from tests.helpers import COMMAND, PAPER, assert_same_archive, call, compiled, nightly, posix_only, start
from tolcontact.errors import ClusterError
from tolcontact.simulation import cluster
from tolcontact.simulation.cluster import local_cluster, running_cluster

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def client():
    with local_cluster(2) as client:
        yield client


@pytest.mark.parametrize(
    ("name", "samples", "method"), [("ra1", 10_000, {}), *nightly(("ra2", 6000, {}), ("cells", 40, {"solver": "qpoases"}))]
)
def test_results_are_those_of_one_process(name, samples, method, client, tmp_path):
    options = {"samples": samples, "solver": "daqp", "surfaces": 4, **method}
    tc.run(cases.MODELS / f"{name}.py", out=tmp_path / "one.nc", **options).close()
    tc.run(cases.MODELS / f"{name}.py", out=tmp_path / "two.nc", client=client, **options).close()
    assert_same_archive(tmp_path / "two.nc", tmp_path / "one.nc")


@pytest.mark.nightly
@pytest.mark.parametrize("workers", [1, 4])
def test_results_do_not_depend_on_the_number_of_workers(workers, tmp_path):
    tc.run(cases.ra1(), samples=20_000, solver="qpoases", out=tmp_path / "one.nc", surfaces=4).close()
    with local_cluster(workers) as own:
        tc.run(cases.ra1(), samples=20_000, solver="qpoases", out=tmp_path / "many.nc", surfaces=4, client=own).close()
    assert_same_archive(tmp_path / "many.nc", tmp_path / "one.nc")


def test_functions_of_users_and_plans_come_along(client, tmp_path):
    script = tmp_path / "bent.py"
    script.write_text(
        "import casadi as ca\nimport tolcontact as tc\nfrom models import ra1\nTWICE = 2\n\n\ndef bent(poses):\n"
        "    return TWICE * ca.sin(poses.position(POINT)[2] / 10)\n\n\n"
        "def assembly():\n    global POINT\n    a = ra1.assembly()\n    POINT = a.parts[1].point(50, 0, 10)\n"
        '    a.measure("bent", bent, units="1")\n    return a\n'
    )
    options = {"samples": 5000, "solver": "daqp", "plan": "sobol", "surfaces": 0, "keep": "measures", "fields": "none"}
    tc.run(script, out=tmp_path / "one.nc", **options).close()
    tc.run(script, out=tmp_path / "two.nc", client=client, **options).close()
    assert_same_archive(tmp_path / "two.nc", tmp_path / "one.nc")


def test_contributions_and_sensitivities_are_those_of_one_process(client):
    a = cases.stack()
    a.correlate(["upper.A1", "middle.A1"], 0.8)
    program = compiled(a, solver="daqp")
    for ask in (tc.analyses.contributions, tc.analyses.sensitivities):
        assert ask(program, samples=64, client=client).identical(ask(program, samples=64))


@pytest.mark.nightly
def test_searches_and_comparisons_are_those_of_one_process(client):
    program = tc.build(cases.ra1(), solver="daqp")
    for ask, model, options in (
        (tc.analyses.worst_case, tc.build(cases.one_dimensional(6), solver="daqp"), {"samples": 8}),
        (tc.analyses.tails, program, {"samples": 4000}),
        (tc.analyses.allocate, program, {"require": "corner height: ppm 10000", "by": "part", "samples": 1024}),
    ):
        assert ask(model, client=client, **options).identical(ask(model, **options)), ask
    asked = {"between": ((20, 12.5, 0), (80, 12.5, 0)), "least": "corner height: 6 sigma", "samples": 64, "solver": "daqp"}
    assert tc.analyses.relocate(cases.ra1(), "top.A3", client=client, **asked).identical(
        tc.analyses.relocate(cases.ra1(), "top.A3", **asked)
    )
    solvers = ["daqp", "qpoases"]
    found, expected = (tc.compare(cases.ra1(), solvers, samples=500, client=each) for each in (client, None))
    assert found.drop_vars("seconds").identical(expected.drop_vars("seconds")) and (found["seconds"] > 0).all()


@posix_only
@pytest.mark.parametrize("seed", [0, *nightly(1)])
def test_a_worker_may_be_killed(seed, client, tmp_path):
    lot = random.Random(seed)
    whole, path = tmp_path / "whole.nc", tmp_path / "killed.nc"
    options = {"samples": 12_000, "solver": "daqp", "method": PAPER, "surfaces": 4}
    tc.run(cases.stack(), out=whole, **options).close()
    killed, at = [], lot.randrange(1, 8_000)

    def kill(rows):
        if rows >= at and not killed:
            killed.extend(client.run(os.getpid).values())
            os.kill(lot.choice(killed), signal.SIGKILL)

    tc.run(cases.stack(), out=path, client=client, progress=kill, **options).close()
    assert killed
    assert_same_archive(path, whole)


@posix_only
@pytest.mark.parametrize("seed", [1, *nightly(0)])
def test_a_killed_run_goes_on_with_other_workers_and_leaves_none_behind(seed, tmp_path):
    path, whole = tmp_path / "run.nc", tmp_path / "whole.nc"
    options = [
        "run",
        cases.MODELS / "ra1.py",
        "--solver",
        "daqp",
        "--surfaces",
        4,
        "--samples",
        30_000,
        "--keep",
        "poses",
        "--quiet",
        "--out",
    ]
    begun = start([*COMMAND, *map(str, [*options, path, "--workers", 2])], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    while not path.exists():
        time.sleep(0.1)
        assert begun.poll() is None
    time.sleep(random.Random(seed).uniform(0.1, 0.7))
    children = psutil.Process(begun.pid).children(recursive=True)
    begun.send_signal(signal.SIGKILL if seed else signal.SIGINT)
    begun.wait()
    gone, alive = psutil.wait_procs(children, timeout=20)
    assert not alive and len(gone) >= 2
    with tc.open_archive(path) as results:
        assert results.sizes["realization"] < 30_000
    done = call(tmp_path, *options, path, "--resume", "--workers", "1")
    assert done.returncode == 0, done.stderr
    assert call(tmp_path, *options, whole).returncode == 0
    assert_same_archive(path, whole)


def test_a_shard_that_fails_says_why_once(client, tmp_path):
    class Wild:
        """Gives no numbers from realization 9000 on."""

        def __init__(self, draws):
            self.draws, self.plan = draws, draws.plan

        def __call__(self, *, seed, start, stop):
            if stop > 9000:
                raise tc.ModelError("wild", ['variable "heat" yields non-finite deviations'])
            return self.draws(seed=seed, start=start, stop=stop)

    program = compiled(cases.ra1(), solver="daqp")
    found = []
    with pytest.raises(tc.ModelError, match='variable "heat" yields') as raised:
        found.extend(cluster.Workers(client)(len, program, samples=40_000, seed=1, start=0, draws=Wild(program.draws)))
    assert str(raised.value).count("heat") == 1 and raised.value.faults and sum(found) in (0, 4096, 8192)


@pytest.mark.parametrize("library", ["numba", "tolcontact"])
def test_a_worker_with_other_versions_is_refused_by_name(library, client):
    class Outdated:
        """The client, to which its workers tell an older version."""

        wait_for_workers = client.wait_for_workers

        def run(self, function, name, **options):
            return (
                dict.fromkeys(client.run(function, name, **options), "0.0.1") if name == library else client.run(function, name)
            )

    with pytest.raises(ClusterError, match=rf"worker .*has {library} 0\.0\.1.*this process {re.escape(version(library))}"):
        tc.run(cases.ra1(), samples=100, solver="daqp", client=Outdated())


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--workers", "0"), "workers is 0; expected a whole number from 1"),
        (("--workers", "2", "--scheduler", "tcp://127.0.0.1:1"), "choose one of --workers and --scheduler"),
        *nightly((("--scheduler", "tcp://127.0.0.1:1"), 'no dask scheduler answers at "tcp://127.0.0.1:1"')),
        (("--scheduler", "nowhere"), 'no dask scheduler answers at "nowhere"'),
    ],
)
def test_what_cannot_be_is_told_in_one_line(options, said, tmp_path):
    done = call(tmp_path, "run", cases.MODELS / "ra1.py", "--samples", "100", *options)
    assert done.returncode == 2 and said in " ".join(done.stderr.split()) and "Traceback" not in done.stderr


def test_memory_of_the_client_does_not_grow(client):
    program, received, memory = compiled(cases.ra1(), solver="daqp", method=PAPER), [0], [0]
    own = psutil.Process()
    for block in cluster.Workers(client)(lambda b: b, program, samples=250_000, seed=1, start=0, draws=program.draws):
        received.append(received[-1] + sum(array.nbytes for array in vars(block).values() if isinstance(array, np.ndarray)))
        memory.append(own.memory_info().rss)
    assert received[60] - received[20] > 60e6
    assert memory[60] - memory[20] < 0.7 * (received[60] - received[20])


class LastMoment:
    """A future that ends when one has just stopped waiting for it."""

    def __init__(self, end):
        self.status, self._end, self._asked = "pending", end, 0

    def result(self, timeout=None):
        self._asked += 1
        if self._asked == 1:
            self.status = "error" if isinstance(self._end, Exception) else "finished"
            raise TimeoutError
        if self.status == "error":
            raise self._end
        return self._end


def test_a_shard_may_end_when_one_has_just_stopped_waiting():
    client = SimpleNamespace(nthreads=lambda: {"worker": 1})
    assert cluster.shard_result(client, LastMoment(7)) == 7
    with pytest.raises(TimeoutError, match="of its own"):
        cluster.shard_result(client, LastMoment(TimeoutError("of its own")))


def test_nobody_without_its_credentials_can_talk_to_the_scheduler(client):
    """Any user of the machine can connect to it, and it runs the code of whoever it talks to."""
    host, port = client.scheduler.address.removeprefix("tls://").split(":")
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    for wrapped in (context.wrap_socket, lambda plain: plain):
        answer = b""
        with contextlib.suppress(OSError), wrapped(socket.create_connection((host, int(port)), 30)) as connection:
            connection.send(bytes(100))
            answer = connection.recv(1000)
        assert answer[:1] in (b"", b"\x15"), wrapped  # closed, perhaps after an alert of TLS


def test_nothing_of_a_cluster_is_served_to_other_machines(client):
    pids = [os.getpid(), *(child.pid for child in psutil.Process().children(recursive=True))]
    addresses = {
        connection.laddr.ip
        for pid in pids
        for connection in psutil.Process(pid).net_connections("inet")
        if connection.status == psutil.CONN_LISTEN
    }
    assert addresses <= {"127.0.0.1", "::1"} and addresses


@posix_only
def test_ctrl_c_in_a_terminal_is_for_the_command_and_not_for_its_workers(client):
    """The terminal sends it to all of them."""
    workers = [child for child in psutil.Process().children() if "spawn_main" in " ".join(child.cmdline())]
    assert len(workers) >= 2
    for worker in workers:
        worker.send_signal(signal.SIGINT)
    assert client.submit(sum, [1, 2], pure=False).result(timeout=60) == 3 and all(worker.is_running() for worker in workers)


def test_a_scheduler_with_certificates_needs_them_here():
    with pytest.raises(ClusterError, match="asks for certificates, and dask has none"), running_cluster("tls://127.0.0.1:1"):
        pass
