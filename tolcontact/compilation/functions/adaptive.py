"""Functions that CasADi interprets at first, and that are compiled once it pays; or at once, by code of earlier processes."""

import contextlib
import math
import threading
from collections.abc import Callable, Sequence

import casadi as ca
import numpy as np

from tolcontact.compilation.functions.interpreted import InterpretedFunction
from tolcontact.compilation.functions.native import NativeFunction, UnknownInstructionError

ENOUGH = 10_000  # evaluations after which compiling a Function pays: it takes as long as interpreting it that often
LARGEST = 300_000  # instructions that are compiled; more are interpreted, since compiling them would take half a minute


class AdaptiveFunction:
    """A Function of scalar expressions: interpreted by CasADi, compiled once it was evaluated often. Threads may share it.

    Both ways give the same to the last bit, so that it does not matter which one it was.
    """

    def __init__(self, function: ca.Function) -> None:
        self._function = function
        self.sizes_out = [function.nnz_out(i) for i in range(function.n_out())]
        self._interpreted = InterpretedFunction(function)
        self._native: NativeFunction | None = None
        self._left = ENOUGH if function.n_instructions() <= LARGEST else math.inf
        self._is_new = True
        self._lock = threading.Lock()

    def __call__(self, inputs: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Outputs (realization, stored entry) for inputs (realization, stored entry)."""
        if self._native is None and (make := self._due(len(inputs[0]))):
            # Whatever LLVM cannot do on this machine CasADi can.
            with contextlib.suppress(UnknownInstructionError, RuntimeError):
                self._native = make(self._function)  # other threads go on interpreting meanwhile
        if self._native is not None:
            return self._native(inputs)
        with self._lock:
            return self._interpreted(inputs)[0]

    def _due(self, count: int) -> Callable[[ca.Function], NativeFunction | None] | None:
        """How the caller, who is about to evaluate the Function `count` times, should try to get machine code: one of all."""
        with self._lock:
            self._left -= count
            if self._is_new and self._left < math.inf:
                self._is_new = False
                return NativeFunction.kept
            if self._left >= 0:
                return None
            self._left = math.inf
            return NativeFunction
