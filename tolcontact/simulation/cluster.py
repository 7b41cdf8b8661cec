"""Blocks of realizations on the workers of a dask cluster, in order: the same to the last bit as those of this process.

A worker gets a model as discretized numbers, once, and compiles it itself. It simulates shards: some blocks, that take it about
a second. A bounded number of shards is under way, so memory does not grow with the number of realizations. Shards of workers
that are lost are simulated again by others, as dask has it; what a scheduler forgot that was started anew is sent again.
"""

import functools
import hashlib
import logging
import os
import pickle
import platform
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from types import FunctionType
from typing import Any, TypeVar

import lazy_loader

from tolcontact.compilation import Program, compile_program
from tolcontact.discretization import Nominal
from tolcontact.errors import ClusterError, OptionError
from tolcontact.simulation.block import Block
from tolcontact.simulation.threads import Sampler, block_rows, map_blocks, processors

dask = lazy_loader.load("dask", error_on_import=False)
cloudpickle = lazy_loader.load("cloudpickle", error_on_import=False)
distributed = lazy_loader.load("distributed", error_on_import=False)
log = logging.getLogger(__name__)

LIBRARIES = ("tolcontact", "casadi", "numba", "numpy", "scipy")
AHEAD = 4  # shards under way for each thread of a worker
SECONDS, MOST_ROWS = 1.0, 1 << 15  # of a shard
PATIENCE, ANSWER = 60.0, 5.0  # s: how long a lost connection, or the first worker, is waited for; and a scheduler
NOWHERE = "not installed"
KEPT = 8  # models and jobs that a worker keeps

T = TypeVar("T")
MapBlocks = Callable[..., Iterator[Any]]  # `map_blocks`, or what does the same elsewhere


@dataclass(frozen=True, eq=False)
class Packed:
    """Something as bytes, which workers can read that do not have the script of the model; and what they keep it by."""

    data: bytes
    token: str
    versions: dict[str, str]

    @classmethod
    def of(cls, thing: Any, nominal: Nominal) -> "Packed":
        try:
            with _scripts_by_value(nominal):
                data = bytes(cloudpickle.dumps(thing))
        except (pickle.PicklingError, TypeError, AttributeError) as error:
            raise ClusterError(
                f'model "{nominal.assembly.name}" cannot be sent to workers: {error}; '
                "let its measures use nothing but numbers and functions"
            ) from error
        return cls(data, hashlib.blake2b(data).hexdigest(), versions())


@contextmanager
def _scripts_by_value(nominal: Nominal) -> Iterator[None]:
    """Users' functions are sent whole: a worker cannot import the script that declares them."""
    names = {measure.of.__module__ for measure in nominal.measures if isinstance(measure.of, FunctionType)}
    modules = [sys.modules[name] for name in names if name in sys.modules and not name.startswith("tolcontact")]
    for module in modules:
        cloudpickle.register_pickle_by_value(module)
    try:
        yield
    finally:
        for module in modules:
            cloudpickle.unregister_pickle_by_value(module)


@contextmanager
def client_of(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """The client of new processes on this machine, or of a running scheduler; None if neither is asked for."""
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
    """The client of so many new processes on this machine, with one thread each; they end with it, however it ends."""
    if isinstance(workers, bool) or not isinstance(workers, int) or workers < 1:
        raise OptionError(f"workers is {workers!r}; expected a whole number, at least 1")
    with needs_dask():
        started = distributed.LocalCluster
        usual = dask.config.get("distributed.nanny.pre-spawn-environ")
    settings = {
        # Dask makes workers give back every freed array to the system at once, which takes them half as long again.
        "distributed.nanny.pre-spawn-environ": {name: of for name, of in usual.items() if name != "MALLOC_TRIM_THRESHOLD_"},
        # It gives up a worker for good that is lost and 15 s later is lost again; here all are begun again, however often.
        "distributed.deploy.lost-worker-timeout": "1000 days",
        "distributed.worker.profile.enabled": False,  # which takes a twentieth of their time
    }
    with dask.config.set(settings):
        cluster = started(
            n_workers=workers, threads_per_worker=1, processes=True, memory_limit=0, dashboard_address=":0",
            silence_logs=logging.CRITICAL,
        )  # fmt: skip
        with cluster, distributed.Client(cluster) as client:
            _say_where(client)
            yield client


def _say_where(client: Any) -> None:
    if find_spec("bokeh"):
        log.warning("the workers at work: %s", client.dashboard_link)


@contextmanager
def running_cluster(address: str) -> Iterator[Any]:
    """The client of the scheduler at an address, such as tcp://10.0.0.1:8786."""
    with needs_dask():
        try:
            client = distributed.Client(address, timeout=ANSWER, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ClusterError(f'no dask scheduler answers at "{address}": {error}; start one with: dask scheduler') from error
    with client:
        _say_where(client)
        yield client


@contextmanager
def needs_dask() -> Iterator[None]:
    """Raise OptionError where it turns out not to be installed."""
    try:
        yield
    except ImportError as error:
        raise OptionError("workers and lazy datasets need dask; install it with: pip install 'tolcontact[dask]'") from error


def mapping(client: Any) -> MapBlocks:
    """`map_blocks`, or the same on the workers of a client. Raises ClusterError if they cannot be used."""
    return map_blocks if client is None else Workers(client)


def threads_of(client: Any) -> int:
    """How many blocks are simulated at once: by this process, or by the workers of a client."""
    return processors() if client is None else max(1, sum(map(int, client.nthreads().values())))


class Workers:
    """`map_blocks` on the workers of a client. They get a program once, however often it is simulated.

    Raises ClusterError if there are no workers, if one has other versions than this process, or if none comes through a shard;
    and whatever a shard raises.
    """

    def __init__(self, client: Any) -> None:
        check_workers(client)
        self._client = client
        self._model: _Model | None = None

    def __call__(
        self,
        function: Callable[[Block], T],
        program: Program,
        *,
        samples: int,
        seed: int,
        start: int = 0,
        draws: Sampler | None = None,
    ) -> Iterator[T]:
        """What `function` makes of each block of `simulate_blocks` where it was simulated; in order."""
        job = Packed.of((draws or program.draws, function), program.nominal)
        shards = _Shards(self._client, self._sent(program), job, seed, samples, block_rows(program))
        try:
            first = start
            while first < samples or shards:
                while first < samples and len(shards) < AHEAD * shards.threads:
                    first = shards.begin(first)
                yield from shards.finish()
        finally:
            shards.cancel()

    def get_ready(self, function: Callable[[Block], Any], program: Program) -> None:
        """Have all workers that are there import and compile what they need, which else takes their first shard longer."""
        model, job = self._sent(program).packed, Packed.of(function, program.nominal)
        self._client.run(_get_ready, model, job.data)

    def _sent(self, program: Program) -> "_Model":
        if self._model is None or self._model.program is not program:
            self._model = _Model(self._client, program)
        return self._model


class _Model:
    """A program that workers compile: what they need for it is a result that they pass on to each other."""

    def __init__(self, client: Any, program: Program) -> None:
        self._client, self.program = client, program
        self.packed = pack_model(program)
        self.send()

    def send(self) -> None:
        self.sent = self._client.submit(bytes, self.packed.data, pure=False)


@functools.lru_cache(maxsize=KEPT)
def pack_model(program: Program) -> Packed:
    """What a program can be compiled from; of the last ones, once."""
    return Packed.of((program.nominal, program.plugin.name, program.method), program.nominal)


def check_workers(client: Any) -> None:
    """Raise ClusterError unless there are workers, all of them with the versions of this process."""
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError as error:
        raise ClusterError(
            f"no worker came within {PATIENCE:.0f} s; start some with: dask worker {client.scheduler.address} --nthreads 1"
        ) from error
    for library, expected in versions().items():
        for worker, found in client.run(version, library, on_error="return").items():
            _refuse(worker, library, found if isinstance(found, str) else NOWHERE, expected)


def versions() -> dict[str, str]:
    """Of what decides about the last bit, here."""
    return {library: version(library) for library in LIBRARIES}


def _refuse(worker: str, library: str, found: str, expected: str) -> None:
    if found != expected:
        raise ClusterError(
            f"worker {worker} has {library} {found}, and this process {expected}; results would differ: "
            "give all of them the same versions"
        )


class _Shards:
    """Shards that are under way, the first one first."""

    def __init__(self, client: Any, model: _Model, job: Packed, seed: int, samples: int, block: int) -> None:
        self._client, self._model, self._job = client, model, job
        self._seed, self._samples, self._block = seed, samples, block
        self._blocks = 1  # of the next shard
        self._begun: deque[tuple[int, int, Any]] = deque()
        self._send_job()

    def __len__(self) -> int:
        return len(self._begun)

    @property
    def threads(self) -> int:
        """How many shards can be simulated at once."""
        return threads_of(self._client)

    def begin(self, first: int) -> int:
        """Begin the shard from a realization on; where the next one begins."""
        stop = min(first + self._blocks * self._block, self._samples)
        self._begun.append((first, stop, self._submitted(first, stop)))
        return stop

    def finish(self) -> list[Any]:
        """What the first shard gave, when it is finished."""
        while True:
            first, stop, future = self._begun[0]
            try:
                seconds, found = self._result(future)
            except distributed.KilledWorker as error:
                raise ClusterError(
                    f"realizations {first} to {stop - 1} ended the workers that simulated them: {error}"
                ) from error
            except (distributed.client.FutureCancelledError, distributed.comm.CommClosedError):
                self._begin_again()
            else:
                self._begun.popleft()
                most = MOST_ROWS // self._block
                self._blocks = max(1, min(int(SECONDS * len(found) / max(seconds, 1e-3)), most, 2 * self._blocks))
                return list(found)

    def _result(self, future: Any) -> Any:
        """Of a shard, as long as there are workers."""
        seen = time.monotonic()
        while True:
            try:
                return future.result(timeout=ANSWER)
            except TimeoutError:
                if future.status == "error":
                    return future.result()  # which raises what the shard raised
                if self._client.nthreads():
                    seen = time.monotonic()
                elif time.monotonic() > seen + PATIENCE:
                    raise ClusterError(
                        f"all workers are gone, and none came within {PATIENCE:.0f} s; resume the run later"
                    ) from None

    def cancel(self) -> None:
        """Let go of all shards."""
        if self._begun and self._client.status == "running":
            self._client.cancel([future for _, _, future in self._begun], force=True)
        self._begun.clear()

    def _send_job(self) -> None:
        self._sent = self._client.submit(bytes, self._job.data, pure=False)

    def _submitted(self, first: int, stop: int) -> Any:
        return self._client.submit(
            simulate_shard,
            self._model.sent,
            self._sent,
            (self._model.packed.token, self._job.token),
            self._model.packed.versions,
            self._seed,
            first,
            stop,
            pure=False,
        )

    def _begin_again(self) -> None:
        """The scheduler has forgotten what was under way: wait for it, and send that again."""
        log.warning("the scheduler was lost; waiting for it")
        until = time.monotonic() + PATIENCE
        while self._client.status != "running" or not self._client.nthreads():
            if time.monotonic() > until:
                raise ClusterError(
                    f"the scheduler was lost, and did not come back within {PATIENCE:.0f} s; resume the run later"
                )
            time.sleep(0.2)
        self._model.send()
        self._send_job()
        self._begun = deque((first, stop, self._submitted(first, stop)) for first, stop, _ in self._begun)


_ready: dict[str, Any] = {}
_making = threading.Lock()


def _made(token: str, make: Callable[[], Any]) -> Any:
    """What a worker keeps of the last models and jobs."""
    with _making:
        if token not in _ready:
            _ready[token] = make()
            while len(_ready) > KEPT:
                del _ready[next(iter(_ready))]
        return _ready[token]


def packed_program(model: Packed, make: Callable[[], Program] | None = None) -> Program:
    """Compiled, or made otherwise, once in each process. Raises ClusterError if that has other versions than who packed it."""
    for library, expected in model.versions.items():
        try:
            here = version(library)
        except PackageNotFoundError:
            here = NOWHERE
        _refuse(f"on {platform.node()}, process {os.getpid()},", library, here, expected)
    return _made(model.token, make or (lambda: compile_program(*pickle.loads(model.data))))  # type: ignore[no-any-return]


def _get_ready(model: Packed, job: bytes) -> None:
    packed_program(model)
    pickle.loads(job)


def simulate_shard(
    model: bytes, job: bytes, tokens: tuple[str, str], versions: dict[str, str], seed: int, start: int, stop: int
) -> tuple[float, list[Any]]:
    """On a worker: how long a shard took [s], and what became of its blocks."""
    program = packed_program(Packed(model, tokens[0], versions))
    draws, function = _made(tokens[1], lambda: pickle.loads(job))
    began = time.perf_counter()
    found = list(map_blocks(function, program, samples=stop, seed=seed, start=start, threads=1, draws=draws))
    return time.perf_counter() - began, found
