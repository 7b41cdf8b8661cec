"""Blocks of realizations on the workers of a dask cluster, in order, and the same to the last bit as in one process.

A worker receives the discretized model once, and compiles it. It simulates shards: several blocks that take about a second
together. A bounded number of shards is in progress, so memory does not grow with the number of realizations. Dask reassigns
shards of lost workers to other workers. Shards that a restarted scheduler does not know are submitted again.
"""

import logging
import os
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from importlib.metadata import version
from importlib.util import find_spec
from typing import Any, TypeVar

import lazy_loader

from tolcontact.compilation import Program
from tolcontact.errors import ClusterError, OptionError
from tolcontact.simulation.block import Block
from tolcontact.simulation.packing import (
    MISSING_VERSION,
    Packed,
    check_version,
    pack_model,
    prepare_worker,
    simulate_shard,
    versions,
)
from tolcontact.simulation.threads import Sampler, Threads, block_rows
from tolcontact.system.machine import processors
from tolcontact.system.worker_signals import interrupts_blocked, worker_options

dask = lazy_loader.load("dask", error_on_import=False)
distributed = lazy_loader.load("distributed", error_on_import=False)
log = logging.getLogger(__name__)

SHARDS_AHEAD = 4  # shards in progress for each thread of a worker
SHARD_SECONDS, MAX_SHARD_ROWS = 1.0, 1 << 15
WORKERS_PER_CORE = 16  # more than any run can use: each takes some 200 MB
WORKER_TIMEOUT = 60.0  # s: for a lost connection, and for the first worker
LOOPBACK = "127.0.0.1:0"  # any port; by default, the dashboard of a cluster is served on all interfaces
LOOP_TIMEOUT, SCHEDULER_TIMEOUT = 1.0, 5.0  # s: for the end of an event loop, for an answer of the scheduler

T = TypeVar("T")
MapBlocks = Callable[..., Iterator[Any]]  # `map_blocks`, or the same on workers


@contextmanager
def client_of(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """Open the client of new processes on this machine, or of a running scheduler; yield None if neither is given."""
    if workers is not None and scheduler is not None:
        raise OptionError("workers are started here, a scheduler has its own; choose one of --workers and --scheduler")
    with ExitStack() as stack:
        if workers is not None:
            yield stack.enter_context(local_cluster(workers))
        else:
            yield stack.enter_context(running_cluster(scheduler)) if scheduler is not None else None


@contextmanager
def local_cluster(workers: int) -> Iterator[Any]:
    """Open the client of new processes on this machine, with one thread each; they always end with the client."""
    most = WORKERS_PER_CORE * (os.cpu_count() or 1)
    if isinstance(workers, bool) or not isinstance(workers, int) or not 1 <= workers <= most:
        raise OptionError(f"workers is {workers!r}; expected a whole number from 1 to {most}, {WORKERS_PER_CORE} for each core")
    with needs_dask():
        local_cluster_type, security = distributed.LocalCluster, distributed.Security.temporary()
        default_environ = dask.config.get("distributed.nanny.pre-spawn-environ")
    settings = {
        # By default, workers return every freed array to the system at once, which makes them take 50 % longer.
        "distributed.nanny.pre-spawn-environ": {
            name: value for name, value in default_environ.items() if name != "MALLOC_TRIM_THRESHOLD_"
        },
        # By default, a worker that is lost again within 15 s is not restarted; here all workers are restarted, however often.
        "distributed.deploy.lost-worker-timeout": "1000 days",
        "distributed.worker.profile.enabled": False,  # profiling takes 5 % of their time
    }
    with dask.config.set(settings), _event_loop() as loop:
        try:
            cluster = local_cluster_type(
                n_workers=workers, threads_per_worker=1, processes=True, memory_limit=0, silence_logs=logging.CRITICAL,
                # Any user of this machine can reach the scheduler, which runs code for everyone who has the credentials.
                security=security, dashboard_address=LOOPBACK, worker_dashboard_address=LOOPBACK, loop=loop,
                **worker_options(),
            )  # fmt: skip
        except (OSError, RuntimeError) as error:
            raise ClusterError(f"worker processes cannot be started: {error.__cause__ or error}") from error
        with cluster, distributed.Client(cluster) as client:
            _log_dashboard(client)
            yield client


@contextmanager
def _event_loop() -> Iterator[Any]:
    """Yield an event loop for a cluster whose processes Ctrl-C does not reach."""
    runner = distributed.utils.LoopRunner()
    with interrupts_blocked():
        runner.start()
    try:
        yield runner.loop
    finally:
        with suppress(TimeoutError):  # if a cluster was stopped during its start; its processes end with this process
            runner.stop(timeout=LOOP_TIMEOUT)


def _log_dashboard(client: Any) -> None:
    if find_spec("bokeh"):
        log.warning("dask dashboard: %s", client.dashboard_link)


@contextmanager
def running_cluster(address: str) -> Iterator[Any]:
    """Open the client of the scheduler at an address, for example tcp://10.0.0.1:8786."""
    with needs_dask():
        if address.startswith("tls:") and not distributed.Security().get_connection_args("client").get("ssl_context"):
            raise ClusterError(
                f'the scheduler at "{address}" asks for certificates, and dask has none; set '
                "DASK_DISTRIBUTED__COMM__TLS__CA_FILE, ..._TLS__CLIENT__CERT and ..._TLS__CLIENT__KEY"
            )
        try:
            distributed.comm.get_address_host_port(address)  # else a client would fail again when it is collected
            distributed.Client(address, timeout=SCHEDULER_TIMEOUT, set_as_default=False).close()
            # The timeout is also how long this client waits for a lost scheduler.
            client = distributed.Client(address, timeout=WORKER_TIMEOUT, set_as_default=False)
        except (OSError, ValueError) as error:
            advice = "start one with: dask scheduler; if it asks for certificates, its address begins with tls://"
            raise ClusterError(f'no dask scheduler answers at "{address}": {error}; {advice}') from error
    logger = logging.getLogger("distributed.client")
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)  # this module reports a lost scheduler
    try:
        with client:
            _log_dashboard(client)
            yield client
    finally:
        logger.setLevel(level)


@contextmanager
def needs_dask() -> Iterator[None]:
    """Raise OptionError if dask is not installed."""
    try:
        yield
    except ImportError as error:
        raise OptionError("workers and lazy datasets need dask; install it with: pip install 'tolcontact[dask]'") from error


def mapping(client: Any) -> MapBlocks:
    """Return `map_blocks`, or the same on the workers of a client. Raises ClusterError if they cannot be used."""
    return Threads() if client is None else Workers(client)


def threads_of(client: Any) -> int:
    """Return the number of blocks that are simulated in parallel, by this process or by the workers of a client."""
    return processors() if client is None else max(1, sum(map(int, client.nthreads().values())))


class Workers:
    """`map_blocks` on the workers of a client. They receive a program once, however often it is simulated.

    Raises ClusterError if there are no workers, if the versions of a worker differ from this process, or if a shard repeatedly
    ends its worker; raises any error of a shard.

    timeout   time limit [s] for a lost connection, and for the first worker
    """

    def __init__(self, client: Any, timeout: float = WORKER_TIMEOUT) -> None:
        self._client, self._timeout = client, timeout
        try:
            client.wait_for_workers(1, timeout=timeout)
        except TimeoutError as error:
            raise ClusterError(
                f"no worker came within {timeout:.0f} s; start some with: dask worker {client.scheduler.address} --nthreads 1"
            ) from error
        except OSError as error:
            raise ClusterError(f"the scheduler was lost before it had work: {error}; resume the run later") from error
        for library, expected in versions().items():
            for worker, actual in client.run(version, library, on_error="return").items():
                check_version(worker, library, actual if isinstance(actual, str) else MISSING_VERSION, expected)
        self._sent: list[Any] = []

    def __call__(
        self, function: Callable[[Block], T], program: Program, *, samples: int, seed: int, start: int = 0,
        block: int | None = None, draws: Sampler | None = None,
    ) -> Iterator[T]:  # fmt: skip
        """Yield the result of `function` for each block of `simulate_blocks`, in order; it is called on the workers."""
        job = Packed.of((draws or program.draws, function), program.nominal)
        shards = _Shards(self._client, pack_model(program), job, seed, self._timeout)
        self._sent = shards.sent  # so that workers keep the program until the next call
        rows, blocks = block or block_rows(program), 1
        try:
            while start < samples or shards:
                while start < samples and len(shards) < SHARDS_AHEAD * shards.threads:
                    stop = min(start + blocks * rows, samples)
                    shards.begin(start, stop)
                    start = stop
                seconds, results = shards.finish()
                blocks = min(int(SHARD_SECONDS * len(results) / max(seconds, 1e-3)), MAX_SHARD_ROWS // rows, 2 * blocks)
                blocks = max(1, blocks)
                yield from results
        finally:
            shards.cancel()

    def get_ready(self, function: Callable[[Block], Any], program: Program) -> None:
        """Make all present workers import and compile the program; otherwise their first shard takes longer."""
        self._client.run(prepare_worker, pack_model(program), Packed.of(function, program.nominal).data)


def shard_result(client: Any, future: Any, timeout: float = WORKER_TIMEOUT) -> Any:
    """Return the result of a shard; wait for it while there are workers, and up to `timeout` [s] without any."""
    last_contact = time.monotonic()
    while True:
        try:
            return future.result(timeout=SCHEDULER_TIMEOUT)
        except TimeoutError:
            if future.status == "error":
                return future.result()  # raises the error of the shard
            if client.nthreads():
                last_contact = time.monotonic()
            elif time.monotonic() > last_contact + timeout:
                raise ClusterError(
                    f"all workers are gone, and none came within {timeout:.0f} s; resume the run later"
                ) from None


class _Shards:
    """Shards in progress, in order. Workers pass a model and a job on to each other as dask results."""

    def __init__(self, client: Any, model: Packed, job: Packed, seed: int, timeout: float) -> None:
        self._client, self._model, self._job, self._seed, self._timeout = client, model, job, seed, timeout
        self._pending: deque[tuple[int, int, Any]] = deque()
        self._send()

    def __len__(self) -> int:
        return len(self._pending)

    @property
    def threads(self) -> int:
        """The number of shards that can be simulated in parallel; 1 if the scheduler is lost: the next shard reports this."""
        try:
            return threads_of(self._client)
        except OSError:
            return 1

    def begin(self, start: int, stop: int) -> None:
        """Submit the shard of realizations `start` to `stop`."""
        tokens = self._model.token, self._job.token
        future = self._client.submit(
            simulate_shard, *self.sent, tokens, self._model.versions, self._seed, start, stop, pure=False
        )  # fmt: skip
        self._pending.append((start, stop, future))

    def finish(self) -> tuple[float, list[Any]]:
        """Wait for the first shard, and return its time [s] and its results."""
        while True:
            start, stop, future = self._pending[0]
            try:
                seconds, results = shard_result(self._client, future, self._timeout)
            except distributed.KilledWorker as error:
                raise ClusterError(
                    f"realizations {start} to {stop - 1} ended the workers that simulated them: {error}"
                ) from error
            except (distributed.client.FutureCancelledError, OSError):  # any lost connection is an OSError
                if future.status == "error":  # raised by the shard
                    raise
                self._begin_again()
            else:
                self._pending.popleft()
                return seconds, results

    def cancel(self) -> None:
        """Cancel all shards."""
        if self._pending and self._client.status == "running":
            self._client.cancel([future for _, _, future in self._pending], force=True)
        self._pending.clear()

    def _send(self) -> None:
        self.sent = [self._client.submit(bytes, packed.data, key=packed.token) for packed in (self._model, self._job)]

    def _begin_again(self) -> None:
        """Wait for a scheduler that has lost the shards in progress, and submit them again."""
        log.warning("the scheduler was lost; waiting for it")
        deadline = time.monotonic() + self._timeout
        while True:
            with suppress(OSError):  # the connection may be lost between reading the status and the request
                if self._client.status == "running" and self._client.nthreads():
                    break
            if time.monotonic() > deadline:
                raise ClusterError(
                    "the scheduler was lost, and did not come back with its workers "
                    f"within {self._timeout:.0f} s; resume the run later"
                )
            time.sleep(0.2)
        self._send()
        lost = list(self._pending)
        self._pending.clear()
        for start, stop, _ in lost:
            self.begin(start, stop)
