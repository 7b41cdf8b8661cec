"""Realizations as lazy dask arrays: a chunk is drawn and simulated when it is computed, on any worker."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

import lazy_loader
import numpy as np

from tolcontact.compilation import Program
from tolcontact.simulation.cluster import needs_dask
from tolcontact.simulation.packing import Packed, pack_model, packed_program
from tolcontact.simulation.threads import block_rows, map_blocks
from tolcontact.variation import GivenDraws

dask = lazy_loader.load("dask", error_on_import=False)

CHUNK_BLOCKS = 8


def dask_arrays() -> Any:
    """Return the module dask.array. Raises OptionError if it is not installed."""
    with needs_dask():
        return import_module("dask.array")


def chunk_rows(program: Program) -> int:
    """Return the number of realizations of a chunk: whole blocks, so that results equal the results of a run."""
    return CHUNK_BLOCKS * block_rows(program)


def lazy_draws(program: Program, samples: int, seed: int) -> Any:
    """Return the deviations (realization, contributor) of a run as a lazy array."""
    array = dask_arrays()
    contributors = len(program.nominal.contributors)
    chunks = array.core.normalize_chunks((chunk_rows(program), contributors), (samples, contributors))
    return array.map_blocks(_drawn, dtype=float, chunks=chunks, model=_sent(program), seed=seed)


def lazy_realizations(program: Program, deviations: Any, function: Callable[..., np.ndarray], kind: np.dtype) -> Any:
    """Return a lazy array of records of dtype `kind`: the results of `function` for blocks.

    deviations   (realization, contributor)
    """
    return dask_arrays().map_blocks(
        _simulated, deviations, dtype=kind, drop_axis=1, meta=np.empty(0, kind), model=_sent(program), function=function
    )


def _sent(program: Program) -> Any:
    """Return the packed model, which workers compile; this process reuses the compiled program."""
    packed = pack_model(program)
    packed_program(packed, lambda: program)
    return dask.delayed(packed, name=f"model-{packed.token}", pure=True)


def _drawn(*, model: Packed, seed: int, block_info: dict) -> np.ndarray:
    (start, stop), _ = block_info[None]["array-location"]
    return packed_program(model).draws(seed=seed, start=start, stop=stop)


def _simulated(deviations: np.ndarray, *, model: Packed, function: Callable[..., np.ndarray]) -> np.ndarray:
    draws, program = GivenDraws(deviations), packed_program(model)
    return np.concatenate(list(map_blocks(function, program, samples=len(deviations), seed=0, threads=1, draws=draws)))
