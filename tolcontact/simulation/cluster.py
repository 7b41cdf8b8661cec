"""Blocks of realizations on the workers of a dask cluster, in order, and the same to the last bit as in one process.

A worker gets a model as discretized numbers, once, and compiles it itself. It simulates shards: some blocks, which take about a
second. A bounded number of shards is under way, so memory does not grow with the number of realizations. Shards of workers
that are lost are simulated again by others, as dask has it. Shards that a restarted scheduler does not know are sent again.
"""

import logging
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import version
from importlib.util import find_spec
from multiprocessing import resource_tracker
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
from tolcontact.simulation.threads import Sampler, Threads, block_rows, processors

dask = lazy_loader.load("dask", error_on_import=False)
distributed = lazy_loader.load("distributed", error_on_import=False)
log = logging.getLogger(__name__)

SHARDS_AHEAD = 4  # under way for each thread of a worker
SHARD_SECONDS, MAX_SHARD_ROWS = 1.0, 1 << 15
WORKER_TIMEOUT = 60.0  # s: for a lost connection, and for the first worker
LOOPBACK = "127.0.0.1:0"  # any port; by default, pages of a cluster are served on all interfaces
LOOP_TIMEOUT, SCHEDULER_TIMEOUT = 1.0, 5.0  # s: for the end of an event loop, for an answer of the scheduler

T = TypeVar("T")
MapBlocks = Callable[..., Iterator[Any]]  # `map_blocks`, or the same on workers


@contextmanager
def client_of(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """Open the client of new processes on this machine, or of a running scheduler; None if there is neither."""
    if workers is not None and scheduler is not None:
        raise OptionError("workers are started here, a scheduler has its own; choose one of --workers and --scheduler")
    if workers is not None:
        with local_cluster(workers) as client:
            yield client
    elif scheduler is not None:
        with running_cluster(scheduler) as client:
            yield client
    else:
        yield None


@contextmanager
def local_cluster(workers: int) -> Iterator[Any]:
    """Open the client of new processes on this machine, with one thread each; they end with it, however it ends."""
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise OptionError(f"workers is {workers!r}; expected a whole number, at least 1")
    with needs_dask():
        started, security = distributed.LocalCluster, distributed.Security.temporary()
        usual = dask.config.get("distributed.nanny.pre-spawn-environ")
    settings = {
        # Dask makes workers give back every freed array to the system at once, which takes them half as long again.
        "distributed.nanny.pre-spawn-environ": {
            name: value for name, value in usual.items() if name != "MALLOC_TRIM_THRESHOLD_"
        },
        # It gives up a worker for good that is lost and 15 s later is lost again; here all are begun again, however often.
        "distributed.deploy.lost-worker-timeout": "1000 days",
        "distributed.worker.profile.enabled": False,  # which takes a twentieth of their time
    }
    with dask.config.set(settings), _event_loop() as loop:
        try:
            cluster = started(
                n_workers=workers, threads_per_worker=1, processes=True, memory_limit=0, silence_logs=logging.CRITICAL,
                # Any user of this machine can reach the scheduler, which runs the code of whoever has the credentials.
                security=security, dashboard_address=LOOPBACK, worker_dashboard_address=LOOPBACK, loop=loop,
            )  # fmt: skip
        except (OSError, RuntimeError) as error:
            raise ClusterError(f"worker processes cannot be started: {error.__cause__ or error}") from error
        with cluster, distributed.Client(cluster) as client:
            _say_where(client)
            yield client


@contextmanager
def _event_loop() -> Iterator[Any]:
    """Yield an event loop for a cluster. Ctrl-C in a terminal goes to its processes, too; there it is blocked.

    A thread inherits the signals that are blocked in the thread that starts it, and a process those of its parent's thread.
    """
    runner = distributed.utils.LoopRunner()
    resource_tracker.ensure_running()  # the thread that starts it has SIGINT unblocked
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        runner.start()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    try:
        yield runner.loop
    finally:
        with suppress(TimeoutError):  # of a cluster that was stopped while it began; its processes end with this one
            runner.stop(timeout=LOOP_TIMEOUT)


def _say_where(client: Any) -> None:
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
            distributed.Client(address, timeout=SCHEDULER_TIMEOUT, set_as_default=False).close()
            client = distributed.Client(address, timeout=WORKER_TIMEOUT, set_as_default=False)  # waits as long for a lost one
        except (OSError, ValueError) as error:
            advice = "start one with: dask scheduler; if it asks for certificates, its address begins with tls://"
            raise ClusterError(f'no dask scheduler answers at "{address}": {error}; {advice}') from error
    with _silent("distributed.client"), client:  # a lost scheduler is told here
        _say_where(client)
        yield client


@contextmanager
def _silent(name: str) -> Iterator[None]:
    logger = logging.getLogger(name)
    level = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(level)


@contextmanager
def needs_dask() -> Iterator[None]:
    """Raise OptionError if dask turns out not to be installed."""
    try:
        yield
    except ImportError as error:
        raise OptionError("workers and lazy datasets need dask; install it with: pip install 'tolcontact[dask]'") from error


def mapping(client: Any) -> MapBlocks:
    """Return `map_blocks`, or the same on the workers of a client. Raises ClusterError if they cannot be used."""
    return Threads() if client is None else Workers(client)


def threads_of(client: Any) -> int:
    """Return how many blocks are simulated together: by this process, or by the workers of a client."""
    return processors() if client is None else max(1, sum(map(int, client.nthreads().values())))


class Workers:
    """`map_blocks` on the workers of a client. They get a program once, however often it is simulated.

    Raises ClusterError if there are no workers, if one has other versions than this process, or if none comes through a shard;
    and any error of a shard.

    timeout   how long [s] a lost connection, and the first worker, are waited for
    """

    def __init__(self, client: Any, timeout: float = WORKER_TIMEOUT) -> None:
        check_workers(client, timeout=timeout)
        self._client, self._timeout = client, timeout
        self._model: _Model | None = None

    def __call__(
        self, function: Callable[[Block], T], program: Program, *, samples: int, seed: int, start: int = 0,
        block: int | None = None, draws: Sampler | None = None,
    ) -> Iterator[T]:  # fmt: skip
        """Yield what `function` makes of each block of `simulate_blocks` where it is simulated; in order."""
        job = Packed.of((draws or program.draws, function), program.nominal)
        shards = _Shards(self._client, self._sent(program), job, seed, samples, block or block_rows(program), self._timeout)
        try:
            begin = start
            while begin < samples or shards:
                while begin < samples and len(shards) < SHARDS_AHEAD * shards.threads:
                    begin = shards.begin(begin)
                yield from shards.finish()
        finally:
            shards.cancel()

    def get_ready(self, function: Callable[[Block], Any], program: Program) -> None:
        """Make all present workers import and compile what they need; otherwise their first shard takes longer."""
        model, job = self._sent(program).packed, Packed.of(function, program.nominal)
        self._client.run(prepare_worker, model, job.data)

    def _sent(self, program: Program) -> "_Model":
        if self._model is None or self._model.program is not program:
            self._model = _Model(self._client, program)
        return self._model


class _Model:
    """A program that workers compile; what they need for it is a result that they pass on to each other."""

    def __init__(self, client: Any, program: Program) -> None:
        self._client, self.program = client, program
        self.packed = pack_model(program)
        self.send()

    def send(self) -> None:
        """Send the packed model to the workers."""
        self.sent = self._client.submit(bytes, self.packed.data, pure=False)


def check_workers(client: Any, timeout: float = WORKER_TIMEOUT) -> None:
    """Raise ClusterError unless a worker comes within `timeout` [s], and all have the versions of this process."""
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


def shard_result(client: Any, future: Any, timeout: float = WORKER_TIMEOUT) -> Any:
    """Return the result of a shard; wait for it as long as there are workers, and `timeout` [s] without any."""
    last_contact = time.monotonic()
    while True:
        try:
            return future.result(timeout=SCHEDULER_TIMEOUT)
        except TimeoutError:
            if future.status == "error":
                return future.result()  # which raises what the shard raised
            if client.nthreads():
                last_contact = time.monotonic()
            elif time.monotonic() > last_contact + timeout:
                raise ClusterError(
                    f"all workers are gone, and none came within {timeout:.0f} s; resume the run later"
                ) from None


class _Shards:
    """Shards that are under way, in their order."""

    def __init__(self, client: Any, model: _Model, job: Packed, seed: int, samples: int, block: int, timeout: float) -> None:
        self._client, self._model, self._job = client, model, job
        self._seed, self._samples, self._block, self._timeout = seed, samples, block, timeout
        self._blocks = 1  # of the next shard
        self._begun: deque[tuple[int, int, Any]] = deque()
        self._send_job()

    def __len__(self) -> int:
        return len(self._begun)

    @property
    def threads(self) -> int:
        """The number of shards that can be simulated together; 1 if the scheduler is lost, which the next shard tells."""
        try:
            return threads_of(self._client)
        except OSError:
            return 1

    def begin(self, start: int) -> int:
        """Submit the shard from the realization `start` on; return where the next one begins."""
        stop = min(start + self._blocks * self._block, self._samples)
        self._begun.append((start, stop, self._submitted(start, stop)))
        return stop

    def finish(self) -> list[Any]:
        """Wait for the first shard, and return its results."""
        while True:
            start, stop, future = self._begun[0]
            try:
                seconds, results = shard_result(self._client, future, self._timeout)
            except distributed.KilledWorker as error:
                raise ClusterError(
                    f"realizations {start} to {stop - 1} ended the workers that simulated them: {error}"
                ) from error
            except (distributed.client.FutureCancelledError, OSError):  # a lost connection is an OSError for any cause
                if future.status == "error":  # of the shard itself
                    raise
                self._begin_again()
            else:
                self._begun.popleft()
                limit = MAX_SHARD_ROWS // self._block
                self._blocks = max(1, min(int(SHARD_SECONDS * len(results) / max(seconds, 1e-3)), limit, 2 * self._blocks))
                return list(results)

    def cancel(self) -> None:
        """Cancel all shards."""
        if self._begun and self._client.status == "running":
            self._client.cancel([future for _, _, future in self._begun], force=True)
        self._begun.clear()

    def _send_job(self) -> None:
        self._sent = self._client.submit(bytes, self._job.data, pure=False)

    def _submitted(self, start: int, stop: int) -> Any:
        return self._client.submit(
            simulate_shard,
            self._model.sent,
            self._sent,
            (self._model.packed.token, self._job.token),
            self._model.packed.versions,
            self._seed,
            start,
            stop,
            pure=False,
        )

    def _begin_again(self) -> None:
        """Wait for a scheduler that has forgotten the shards under way, and send them again."""
        log.warning("the scheduler was lost; waiting for it")
        until = time.monotonic() + self._timeout
        while not self._has_workers():
            if time.monotonic() > until:
                raise ClusterError(
                    "the scheduler was lost, and did not come back with its workers "
                    f"within {self._timeout:.0f} s; resume the run later"
                )
            time.sleep(0.2)
        self._model.send()
        self._send_job()
        self._begun = deque((start, stop, self._submitted(start, stop)) for start, stop, _ in self._begun)

    def _has_workers(self) -> bool:
        """Whether the scheduler answers, and has workers."""
        with suppress(OSError):  # it may be lost between a look at the client's status and the question
            return self._client.status == "running" and bool(self._client.nthreads())
        return False
