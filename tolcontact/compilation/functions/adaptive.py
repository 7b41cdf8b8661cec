"""Functions that CasADi interprets until compiling pays, or until earlier processes' machine code is at hand."""

import contextlib
import math
import threading
from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from tolcontact.compilation.functions.interpreted import InterpretedFunction
from tolcontact.compilation.functions.native import NativeFunction, UnknownInstructionError

MIN_COMPILED_CALLS = 10_000  # evaluations after which compiling a Function pays: it takes as long as interpreting it that often
MAX_INSTRUCTIONS = (
    300_000  # instructions that are compiled; more are interpreted, since compiling them would take half a minute
)


class AdaptiveFunction:
    """A Function of scalar expressions that is interpreted, and compiled once it was evaluated often. Threads may share it.

    Both ways give the same results to the last bit.

    native   the machine code, or None while CasADi interprets
    """

    def __init__(self, function: ca.Function) -> None:
        self._function = function
        self.sizes_out = [function.nnz_out(i) for i in range(function.n_out())]
        self._interpreted = InterpretedFunction(function)
        self.native: NativeFunction | None = None
        self._remaining = MIN_COMPILED_CALLS if function.n_instructions() <= MAX_INSTRUCTIONS else math.inf
        self._is_new = True
        self._lock = threading.Lock()

    def __call__(self, inputs: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return outputs (realization, stored entry) for inputs (realization, stored entry)."""
        if self.native is None and (compiler := self._due_compiler(len(inputs[0]))):
            # CasADi interprets what LLVM cannot compile on this machine.
            with contextlib.suppress(UnknownInstructionError, RuntimeError):
                self.native = compiler(self._function)  # other threads interpret meanwhile
        if self.native is not None:
            return self.native(inputs)
        with self._lock:
            return self._interpreted(inputs)[0]

    def _due_compiler(self, count: int) -> Callable[[ca.Function], NativeFunction | None] | None:
        """Return the way to get machine code before `count` evaluations, or None; each way is returned to one caller only."""
        with self._lock:
            self._remaining -= count
            if self._is_new and self._remaining < math.inf:
                self._is_new = False
                return NativeFunction.from_cache
            if self._remaining >= 0:
                return None
            self._remaining = math.inf
            return NativeFunction
