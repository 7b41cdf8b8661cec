"""Symbolic Functions as machine code: the instructions that CasADi would interpret, compiled by LLVM.

A Function of scalar expressions is straight-line code of several thousand additions and multiplications. CasADi interprets it
at 5 ns per instruction. Compiled code takes a tenth of that, and compiling takes 30 us per instruction. The operations and
their order are the same, so that the results are the same to the last bit.
"""

import ctypes
import functools
import hashlib
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

import casadi as ca
import numpy as np
from llvmlite import binding, ir

from tolcontact import code_cache
from tolcontact.compilation.functions import translation
from tolcontact.compilation.functions.operations import LANES
from tolcontact.compilation.functions.translation import memory_of, module_of, sizes_of
from tolcontact.system.machine import free_address_space

MIN_MEMORY, MEMORY_FACTOR = 1 << 26, 16  # bytes, and bytes per character of a module: LLVM takes 9 for 88 000 instructions


class NativeFunction:
    """A compiled Function, called for many realizations at once."""

    def __init__(self, function: ca.Function, code: bytes | None = None) -> None:
        """Load the given machine code of the Function, or compile the Function and store its code in the cache.

        Raises NotImplementedError for a Function that cannot be compiled.
        """
        self.sizes_in, self.sizes_out = sizes_of(function)
        self._engine = _loaded(code) if code else _compiled(module_of(function), key_of(function))
        address = self._engine.get_function_address("evaluate")
        self._evaluate = ctypes.CFUNCTYPE(None, ctypes.c_int64, *[ctypes.c_void_p] * 2)(address)
        self._memory = sum(self.sizes_in) + sum(self.sizes_out) + memory_of(function)

    @classmethod
    def from_cache(cls, function: ca.Function, key: str | None = None) -> "NativeFunction | None":
        """Return the compiled Function from the code of an earlier process, stored under its key; None if there is none."""
        code = code_cache.load(key or key_of(function))
        return None if code is None else cls(function, code)

    def __call__(self, inputs: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return results (realization, stored entry) for inputs (realization, stored entry).

        Raises ValueError for inputs of another shape.
        """
        count = len(inputs[0])
        inputs = [np.ascontiguousarray(array, dtype=float) for array in inputs]
        for array, size in zip(inputs, self.sizes_in, strict=True):
            if array.shape != (count, size):
                raise ValueError(f"an input {array.shape}; expected {(count, size)}")
        results = [np.empty((count, size)) for size in self.sizes_out]
        arrays = [*inputs, *results, np.empty((self._memory, LANES))]
        *addresses, memory = (array.__array_interface__["data"][0] for array in arrays)
        self._evaluate(count, (ctypes.c_void_p * len(addresses))(*addresses), memory)
        return results


def key_of(function: ca.Function, host: bytes | None = None) -> str:
    """Return the key of a Function's machine code for a host, by default the host of this process."""
    return hashlib.blake2b(function.serialize().encode() + (host or host_description()), digest_size=20).hexdigest()


@functools.cache
def host_description() -> bytes:
    """Return a description of the processor, the libraries and this translation, which also determine the machine code."""
    code = b"".join(Path(file).read_bytes() for file in (__file__, translation.__file__))
    features = binding.get_host_cpu_features().flatten()
    parts = [binding.get_default_triple(), binding.get_host_cpu_name(), features, version("llvmlite"), version("casadi")]
    return "\n".join(parts).encode() + code


def _compiled(module: ir.Module, key: str) -> binding.ExecutionEngine:
    engine = _engine(str(module))
    engine.set_object_cache(notify_func=lambda _, code: code_cache.store(key, code))
    engine.finalize_object()
    return engine


def _loaded(code: bytes) -> binding.ExecutionEngine:
    engine = _engine("")
    engine.add_object_file(binding.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return engine


def _engine(module: str) -> binding.ExecutionEngine:
    """Return the engine for a module. Raises MemoryError where LLVM, which would end the process, might lack memory."""
    if free_address_space() < MIN_MEMORY + MEMORY_FACTOR * len(module):
        raise MemoryError("address space is limited, and code of the model has to be compiled")
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    # More optimization would double the compile time, for code that is no faster.
    target = binding.Target.from_default_triple().create_target_machine(
        cpu=binding.get_host_cpu_name(), features=binding.get_host_cpu_features().flatten(), opt=1
    )
    return binding.create_mcjit_compiler(binding.parse_assembly(module), target)
