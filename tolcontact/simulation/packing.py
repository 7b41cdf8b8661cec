"""Serialization of models and jobs for workers, and the simulation of shards on workers.

A worker receives the discretized model, compiles it once, and keeps it for all its shards.
"""

import functools
import hashlib
import os
import pickle
import platform
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from types import FunctionType
from typing import Any

import lazy_loader

from tolcontact.compilation import Program, compile_program
from tolcontact.discretization import Nominal
from tolcontact.errors import ClusterError
from tolcontact.simulation.threads import map_blocks

cloudpickle = lazy_loader.load("cloudpickle", error_on_import=False)

LIBRARIES = ("tolcontact", "casadi", "numba", "numpy", "scipy")
MISSING_VERSION = "not installed"
MAX_CACHED = 8  # models and jobs that a worker keeps


@dataclass(frozen=True, eq=False)
class Packed:
    """A serialized object, which workers can load without the model script; the token is its key in their cache."""

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
    """Serialize user-defined functions by value: a worker cannot import the script that declares them."""
    names = {measure.of.__module__ for measure in nominal.measures if isinstance(measure.of, FunctionType)}
    modules = [sys.modules[name] for name in names if name in sys.modules and not name.startswith("tolcontact")]
    for module in modules:
        cloudpickle.register_pickle_by_value(module)
    try:
        yield
    finally:
        for module in modules:
            cloudpickle.unregister_pickle_by_value(module)


@functools.lru_cache(maxsize=MAX_CACHED)
def pack_model(program: Program) -> Packed:
    """Return the packed model, solver name and method of a program; recent results are cached."""
    return Packed.of((program.nominal, program.solver.name, program.method), program.nominal)


def versions() -> dict[str, str]:
    """Return the versions of all packages that affect the last bit of a result."""
    return {library: version(library) for library in LIBRARIES}


def check_version(worker: str, library: str, actual: str, expected: str) -> None:
    """Raise ClusterError if the version of a library on a worker differs from this process."""
    if actual != expected:
        raise ClusterError(
            f"worker {worker} has {library} {actual}, and this process {expected}; results would differ: "
            "give all of them the same versions"
        )


_cache: dict[str, Any] = {}
_cache_lock = threading.Lock()


def _cached(token: str, make: Callable[[], Any]) -> Any:
    """Return a model or a job from the cache of this process, or make it."""
    with _cache_lock:
        if token not in _cache:
            _cache[token] = make()
            while len(_cache) > MAX_CACHED:
                del _cache[next(iter(_cache))]
        return _cache[token]


def packed_program(model: Packed, make: Callable[[], Program] | None = None) -> Program:
    """Return the compiled model, compiled (or made by `make`) once in each process.

    Raises ClusterError if this process has other versions than the one that packed the model.
    """
    for library, expected in model.versions.items():
        try:
            actual = version(library)
        except PackageNotFoundError:
            actual = MISSING_VERSION
        check_version(f"on {platform.node()}, process {os.getpid()},", library, actual, expected)
    return _cached(model.token, make or (lambda: compile_program(*pickle.loads(model.data))))  # type: ignore[no-any-return]


def prepare_worker(model: Packed, job: bytes) -> None:
    """Import and compile everything that a job needs, on a worker."""
    packed_program(model)
    pickle.loads(job)


def simulate_shard(
    model: bytes, job: bytes, tokens: tuple[str, str], versions: dict[str, str], seed: int, start: int, stop: int
) -> tuple[float, list[Any]]:
    """Simulate a shard on a worker; return the time [s], and the results of the function for its blocks."""
    program = packed_program(Packed(model, tokens[0], versions))
    draws, function = _cached(tokens[1], lambda: pickle.loads(job))
    start_time = time.perf_counter()
    results = list(map_blocks(function, program, samples=stop, seed=seed, start=start, threads=1, draws=draws))
    return time.perf_counter() - start_time, results
