"""Functions evaluated for many realizations at once."""

import contextlib
import io
import math
from collections.abc import Iterator, Sequence
from typing import Protocol

import casadi as ca
import numpy as np

from tolcontact.symbolic.native import Native, UnknownInstructionError

WIDTH = 64
LARGEST = 300_000  # instructions that are compiled; more are interpreted, since compiling them would take half a minute


class Evaluator(Protocol):
    """Evaluates a Function on arrays (realization, stored entry).

    Returns its outputs, likewise, and `failed` (realization,): those whose evaluation gave up; their outputs are NaN.
    """

    def __call__(self, inputs: Sequence[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]: ...


def evaluator(function: ca.Function) -> Evaluator:
    """The fastest way to evaluate a Function of scalar expressions."""
    if function.n_instructions() <= LARGEST:
        with contextlib.suppress(UnknownInstructionError):
            return Native(function)
    return Mapped(function)


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Swallow what plugins print to Python's streams: banners that no option turns off."""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        yield


class Batch:
    """A Function of scalar expressions, called by name; every array has the realization as its first dimension."""

    def __init__(self, function: ca.Function) -> None:
        inputs = [ca.SX.sym(name, *function.size_in(name)) for name in function.name_in()]
        outputs = [ca.densify(output) for output in function.call(inputs)]
        self._names, self._results = function.name_in(), function.name_out()
        self._evaluate = evaluator(ca.Function(function.name(), inputs, outputs))

    def __call__(self, **arrays: np.ndarray) -> dict[str, np.ndarray]:
        """Evaluate for all realizations: `name=(realization, ...)` for each input; outputs by name, (realization, entry)."""
        outputs, _ = self._evaluate([flat(arrays[name]) for name in self._names])
        return dict(zip(self._results, outputs, strict=True))


def flat(array: np.ndarray) -> np.ndarray:
    """(realization, entry) of an array that is flat or (column, row), CasADi's order, inside a realization."""
    return np.ascontiguousarray(array, dtype=float).reshape(len(array), math.prod(array.shape[1:]))


class Mapped:
    """A Function that CasADi evaluates itself, WIDTH realizations in a call; QP solvers above all.

    Not to be shared between threads: one evaluation at a time uses its buffers.
    """

    def __init__(self, function: ca.Function) -> None:
        # A buffer keeps the memory of the Function that it calls. Inside another Function a solver takes a free one each time.
        inputs = [ca.MX.sym(f"i{k}", function.sparsity_in(k)) for k in range(function.n_in())]
        caller = ca.Function("caller", inputs, function.call(inputs))
        self._many = _Buffered(caller.map(WIDTH), WIDTH)
        self._one = _Buffered(caller, 1)
        self._solvers = [function] if function.is_a("Conic") else []

    def __call__(self, inputs: Sequence[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
        count = len(inputs[0])
        results = [np.empty((count, size)) for size in self._one.sizes_out]
        failed = np.zeros(count, dtype=bool)
        start = 0
        while start < count:
            width = WIDTH if count - start >= WIDTH else 1
            call = self._many if width == WIDTH else self._one
            rows = slice(start, start + width)
            if not call([array[rows] for array in inputs], [result[rows] for result in results]):
                # A plugin that gives up on one realization ends the whole call (qpOASES does), so find out which.
                self._forget()
                for k in range(start, start + width):
                    one = slice(k, k + 1)
                    if not self._one([array[one] for array in inputs], [result[one] for result in results]):
                        failed[k] = True
                        self._forget()
                        for result in results:
                            result[k] = np.nan
            start += width
        return results, failed

    def _forget(self) -> None:
        """Give the solvers a new memory. qpOASES starts from its last problem, and once it has failed it fails for ever."""
        for solver in self._solvers:
            solver.checkout()  # the spoiled memory, never released: the next evaluation gets another
        self._many.is_new = self._one.is_new = True


class _Buffered:
    """One Function with arrays that stay where they are."""

    def __init__(self, function: ca.Function, width: int) -> None:
        self._buffer, self._evaluate = function.buffer()
        self._inputs = [np.zeros(function.nnz_in(i)) for i in range(function.n_in())]
        self._outputs = [np.zeros(function.nnz_out(i)) for i in range(function.n_out())]
        self.sizes_out = [output.size // width for output in self._outputs]
        for i, array in enumerate(self._inputs):
            self._buffer.set_arg(i, memoryview(array))  # type: ignore[call-arg, arg-type]
        for i, array in enumerate(self._outputs):
            self._buffer.set_res(i, memoryview(array))  # type: ignore[call-arg, arg-type]
        self.is_new = True

    def __call__(self, inputs: Sequence[np.ndarray], outputs: Sequence[np.ndarray]) -> bool:
        """Evaluate; False where the Function gave up."""
        for buffer, array in zip(self._inputs, inputs, strict=True):
            buffer[:] = array.ravel()
        with quiet() if self.is_new else contextlib.nullcontext():
            self._evaluate()
        self.is_new = False
        for buffer, array in zip(self._outputs, outputs, strict=True):
            array[:] = buffer.reshape(array.shape)
        return bool(self._buffer.ret() == 0)
