"""Functions for many realizations at once: interpreted by CasADi, compiled if that saves time, and called by name."""

import contextlib
import functools
import math
import threading
import weakref
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from tolcontact import code_cache
from tolcontact.arrays import Array, Float, Real
from tolcontact.compilation.functions.native import NativeFunction, key_of
from tolcontact.compilation.functions.translation import called
from tolcontact.mechanics.quiet import CONSTRUCTION_LOCK, quiet

WIDTHS = (256, 16)  # realizations in a call of CasADi


class InterpretedFunction:
    """A Function that CasADi evaluates; inputs and outputs are given by position.

    Threads must not share it, since each evaluation uses its buffers. `fixed_inputs` are inputs, by position, that are the same
    in all realizations.
    """

    def __init__(self, function: ca.Function, fixed_inputs: Mapping[int, np.ndarray] | None = None) -> None:
        # A buffer keeps the memory of the Function that it calls. In another Function, a solver takes a free memory each time.
        inputs = [ca.MX.sym(f"i{k}", function.sparsity_in(k)) for k in range(function.n_in())]
        self._caller, self._fixed_inputs = ca.Function("caller", inputs, function.call(inputs)), fixed_inputs or {}
        self._sizes_out = [function.nnz_out(i) for i in range(function.n_out())]
        self._solvers = [function] if function.is_a("Conic") else []
        self._buffers: dict[int, _Buffers] = {}  # by width
        self._is_new = True

    def __call__(self, inputs: Sequence[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
        """Return the outputs (realization, stored entry), and `failed` (realization,), for the inputs that are not fixed.

        Outputs are NaN if the evaluation failed.
        """
        count, start = len(inputs[0]), 0
        results, failed = [np.empty((count, size)) for size in self._sizes_out], np.zeros(count, dtype=bool)
        with quiet():  # plugins may print in every evaluation
            while start < count:
                # The very first realization is evaluated alone, since other threads wait for it.
                remaining = 1 if self._is_new else count - start
                width = WIDTHS[0] if remaining >= WIDTHS[0] else WIDTHS[1] if remaining >= WIDTHS[1] // 2 else 1
                stop = min(start + width, count)
                if not self._succeeds(width, slice(start, stop), inputs, results):
                    # A plugin that fails on one realization may end the whole call (qpOASES does): each is evaluated alone.
                    for k in range(start, stop):
                        if not self._succeeds(1, slice(k, k + 1), inputs, results):
                            failed[k] = True
                            for result in results:
                                result[k] = np.nan
                start = stop
        return results, failed

    def _succeeds(self, width: int, rows: slice, inputs: Sequence[np.ndarray], results: Sequence[np.ndarray]) -> bool:
        """Evaluate up to `width` rows of the inputs, and return whether it succeeded; if not, the solvers get a new memory.

        qpOASES starts from its last problem, and after one failure it always fails.
        """
        # The first evaluation constructs CasADi objects: the memory of solvers, which wider calls use later.
        with CONSTRUCTION_LOCK if self._is_new else contextlib.nullcontext():
            if width not in self._buffers:
                with CONSTRUCTION_LOCK:
                    self._buffers[width] = self._allocate(width)
            buffers = self._buffers[width]
            count = rows.stop - rows.start
            free = (array for i, array in enumerate(buffers.arguments) if i not in self._fixed_inputs)
            for array, values in zip(free, inputs, strict=True):
                array[:count] = values[rows]
                array[count:] = values[rows.stop - 1]  # unused rows repeat the last one
            try:
                buffers.evaluate()
            except RuntimeError:  # CasADi's only exception: bounds that are NaN
                succeeds = False
            else:
                for array, result in zip(buffers.outputs, results, strict=True):
                    result[rows] = array[:count]
                succeeds = bool(buffers.memory.ret() == 0)
        if not succeeds:
            for solver in self._solvers:
                solver.checkout()  # takes the corrupted memory and never releases it: the next evaluation gets another
        self._is_new = not succeeds
        return succeeds

    def _allocate(self, width: int) -> "_Buffers":
        """Return the arrays of `width` realizations, with the values of fixed inputs."""
        function = self._caller.map(width) if width > 1 else self._caller
        memory, evaluate = function.buffer()
        arguments = [np.zeros((width, function.nnz_in(i) // width)) for i in range(function.n_in())]
        outputs = [np.zeros((width, function.nnz_out(i) // width)) for i in range(function.n_out())]
        for i, array in enumerate(arguments):
            if i in self._fixed_inputs:
                array[:] = self._fixed_inputs[i]
            memory.set_arg(i, memoryview(array.ravel()))  # type: ignore[call-arg, arg-type]
        for i, array in enumerate(outputs):
            memory.set_res(i, memoryview(array.ravel()))  # type: ignore[call-arg, arg-type]
        return _Buffers(evaluate, memory, arguments, outputs)


class _Buffers(NamedTuple):
    """A Function of many realizations at once, with arrays at fixed addresses.

    evaluate    evaluates the Function on the arrays
    memory      CasADi's buffer, which knows the addresses but does not keep the arrays alive
    arguments   an array (realization, stored entry) for each input
    outputs     an array (realization, stored entry) for each output
    """

    evaluate: Callable[[], None]
    memory: Any
    arguments: list[np.ndarray]
    outputs: list[np.ndarray]


# Evaluations, in all processes, after which a Function without calls is compiled. Compiling takes as long as interpreting this
# number of evaluations once or twice. So the total time is at most about three times the time of the best choice in hindsight.
MIN_COMPILED_CALLS = 10_000
MAX_INSTRUCTIONS = 300_000  # that are compiled; more are interpreted, since compiling them takes more than a gigabyte


class _Evaluations:
    """The number of evaluations of a Function by this process and by earlier processes that stored it."""

    def __init__(self, key: str) -> None:
        self._key = f"{key}-evaluations"
        stored = code_cache.load(self._key) or b""
        self.number = int(stored) if stored.isdigit() else 0

    def store(self) -> None:
        """Store the number for later processes."""
        code_cache.write(self._key, str(self.number).encode())


def _instructions(function: ca.Function) -> tuple[int, int]:
    """Return the number of instructions that have to be compiled, and that an evaluation executes."""
    calls = [(f.__hash__(), *_instructions(f)) for f in called(function)]
    compiled = sum({key: instructions for key, instructions, _ in calls}.values())
    return function.n_instructions() + compiled, function.n_instructions() + sum(executed for *_, executed in calls)


class NamedFunction:
    """A Function of scalar expressions for many realizations at once: the first dimension of every array.

    It is interpreted first, and compiled after many evaluations; both give the same results to the last bit. Evaluations of
    earlier processes count, too. Threads may share it.

    function   the Function that is evaluated
    names      the names of its inputs
    native     its machine code, or None while CasADi interprets it
    """

    def __init__(self, function: ca.Function) -> None:
        self.function, self.names, self._results = function, function.name_in(), function.name_out()
        self.native: NativeFunction | None = None
        compiled, executed = _instructions(function)
        self._may_be_compiled = compiled <= MAX_INSTRUCTIONS
        self._min_calls = MIN_COMPILED_CALLS * compiled // max(executed, 1)
        self._evaluations: _Evaluations | None = None  # the first call loads it
        self._lock = threading.Lock()

    @classmethod
    def dense(cls, function: ca.Function) -> "NamedFunction":
        """Return a function with all entries of inputs and outputs, including those that are always zero."""
        inputs = [ca.SX.sym(name, *function.size_in(name)) for name in function.name_in()]
        outputs = [ca.densify(output) for output in function.call(inputs)]
        return cls(ca.Function(function.name(), inputs, outputs, function.name_in(), function.name_out()))

    def __call__(self, **arrays: Real[Array, "realization ..."]) -> dict[str, Float[Array, "realization _"]]:
        """Return outputs by name, (realization, stored entry), for inputs `name=(realization, ...)`.

        Arrays with other names are ignored.
        """
        inputs = [flat(arrays[name]) for name in self.names]
        if native := self._compiled(len(inputs[0])):
            outputs = native(inputs)
        else:
            with self._lock:
                outputs, _ = self._interpreted(inputs)
        return dict(zip(self._results, outputs, strict=True))

    @functools.cached_property
    def _interpreted(self) -> InterpretedFunction:
        with CONSTRUCTION_LOCK:
            return InterpretedFunction(self.function)

    def _compiled(self, count: int) -> NativeFunction | None:
        """Return the machine code for `count` more evaluations, or None while CasADi interprets the Function."""
        # CasADi interprets a Function that LLVM cannot compile on this machine.
        with contextlib.suppress(RuntimeError):
            if self.native is None and self._is_due(count):
                self.native = NativeFunction(self.function)  # other threads interpret meanwhile
        return self.native

    def _is_due(self, count: int) -> bool:
        """Return whether to compile before `count` evaluations, which only one call does. The first call loads stored code."""
        with self._lock:  # other threads wait for stored code: interpreting takes longer
            if not self._may_be_compiled or self.native is not None:
                return False
            if self._evaluations is None:
                key = key_of(self.function)
                self.native = NativeFunction.from_cache(self.function, key)
                if self.native is not None:
                    return False
                self._evaluations = _Evaluations(key)
                weakref.finalize(self, self._evaluations.store)
            self._evaluations.number += count
            self._may_be_compiled = self._evaluations.number <= self._min_calls
            return not self._may_be_compiled


def flat(array: Real[Array, "realization ..."]) -> Float[Array, "realization _"]:
    """Return (realization, entry) of an array that is flat or (column, row), CasADi's order, in each realization."""
    return np.ascontiguousarray(array, dtype=float).reshape(len(array), math.prod(array.shape[1:]))
