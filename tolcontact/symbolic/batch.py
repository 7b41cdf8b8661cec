"""Calls of a Function for many realizations at once, through preallocated buffers."""

import contextlib
import io
from collections.abc import Iterator

import casadi as ca
import numpy as np

WIDTH = 64


@contextlib.contextmanager
def quiet() -> Iterator[None]:
    """Swallow what plugins print to Python's streams: banners that no option turns off."""
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        yield


class Batch:
    """A Function mapped over realizations; every array has the realization as its first dimension.

    Not to be shared between threads: one evaluation at a time uses its buffers.
    """

    def __init__(self, function: ca.Function) -> None:
        function = _dense(function)
        self._names = function.name_in()
        self._results = function.name_out()
        self._many = _Buffered(function.map(WIDTH), WIDTH)
        self._one = _Buffered(function, 1)
        self._solvers = [inner for inner in function.find_functions() if inner.is_a("Conic")]

    def __call__(self, **arrays: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Evaluate for all realizations: `name=(realization, ...)` for each input of the Function.

        Inside a realization arrays are flat or (column, row), CasADi's order. Returns the outputs by name, each
        (realization, entry), and `failed` (realization,): those whose evaluation gave up; their outputs are NaN.
        """
        count = len(next(iter(arrays.values())))
        flat = [
            np.ascontiguousarray(arrays[name], dtype=float).reshape(count, size)
            for name, size in zip(self._names, self._one.sizes_in, strict=True)
        ]
        results = [np.empty((count, size)) for size in self._one.sizes_out]
        failed = np.zeros(count, dtype=bool)
        start = 0
        while start < count:
            width = WIDTH if count - start >= WIDTH else 1
            call = self._many if width == WIDTH else self._one
            rows = slice(start, start + width)
            if not call([array[rows] for array in flat], [result[rows] for result in results]):
                # A plugin that gives up on one realization ends the whole call (qpOASES does), so find out which.
                self._forget()
                for k in range(start, start + width):
                    one = slice(k, k + 1)
                    if not self._one([array[one] for array in flat], [result[one] for result in results]):
                        failed[k] = True
                        self._forget()
                        for result in results:
                            result[k] = np.nan
            start += width
        return dict(zip(self._results, results, strict=True)), failed

    def _forget(self) -> None:
        """Give the solvers a new memory. qpOASES starts from its last problem, and once it has failed it fails for ever."""
        for solver in self._solvers:
            solver.checkout()  # the spoiled memory, never released: the next evaluation gets another
        self._many.is_new = self._one.is_new = True


def _dense(function: ca.Function) -> ca.Function:
    """The same Function with dense outputs: buffers hold stored entries only, and a structural zero is not one."""
    inputs = [ca.MX.sym(name, *function.size_in(name)) for name in function.name_in()]
    outputs = [ca.densify(output) for output in function.call(inputs)]
    return ca.Function(function.name(), inputs, outputs, function.name_in(), function.name_out())


class _Buffered:
    """One Function with arrays that stay where they are."""

    def __init__(self, function: ca.Function, width: int) -> None:
        self._buffer, self._evaluate = function.buffer()
        self._inputs = [np.zeros(function.numel_in(i)) for i in range(function.n_in())]
        self._outputs = [np.zeros(function.numel_out(i)) for i in range(function.n_out())]
        self.sizes_in = [array.size // width for array in self._inputs]
        self.sizes_out = [output.size // width for output in self._outputs]
        for i, array in enumerate(self._inputs):
            self._buffer.set_arg(i, memoryview(array))  # type: ignore[call-arg, arg-type]
        for i, array in enumerate(self._outputs):
            self._buffer.set_res(i, memoryview(array))  # type: ignore[call-arg, arg-type]
        self.is_new = True

    def __call__(self, inputs: list[np.ndarray], outputs: list[np.ndarray]) -> bool:
        """Evaluate; False where the Function gave up."""
        for buffer, array in zip(self._inputs, inputs, strict=True):
            buffer[:] = array.ravel()
        with quiet() if self.is_new else contextlib.nullcontext():
            self._evaluate()
        self.is_new = False
        for buffer, array in zip(self._outputs, outputs, strict=True):
            array[:] = buffer.reshape(array.shape)
        return bool(self._buffer.ret() == 0)
