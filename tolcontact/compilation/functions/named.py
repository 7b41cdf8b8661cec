"""Functions for many realizations at once: interpreted by CasADi, compiled when that pays, and called by names."""

import contextlib
import functools
import math
import threading
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence

import casadi as ca
import numpy as np

from tolcontact import code_cache
from tolcontact.arrays import Array, Float, Int, Real
from tolcontact.compilation.functions.native import NativeFunction, UnknownInstructionError, key_of
from tolcontact.compilation.functions.places import ArgumentPlaces, Located
from tolcontact.mechanics.quiet import CONSTRUCTION_LOCK, quiet

WIDTHS = (256, 16)  # realizations in a call of CasADi


class InterpretedFunction:
    """A Function that CasADi evaluates; inputs and outputs go by position.

    Threads must not share it, since each evaluation uses its buffers. `fixed_inputs` are inputs, by position, that are the same
    in all realizations.
    """

    def __init__(self, function: ca.Function, fixed_inputs: Mapping[int, np.ndarray] | None = None) -> None:
        # A buffer keeps the memory of the Function that it calls. Inside another Function a solver takes a free one each time.
        inputs = [ca.MX.sym(f"i{k}", function.sparsity_in(k)) for k in range(function.n_in())]
        caller = ca.Function("caller", inputs, function.call(inputs))
        self._calls = [_Buffers(caller, width, fixed_inputs or {}) for width in (*WIDTHS, 1)]
        self._sizes_out = [function.nnz_out(i) for i in range(function.n_out())]
        self._solvers = [function] if function.is_a("Conic") else []
        self._is_new = True

    def __call__(self, inputs: Sequence[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
        """Return the outputs (realization, stored entry), and `failed` (realization,), for the inputs that are not fixed.

        Outputs are NaN if the evaluation failed.
        """
        with quiet():  # plugins may print in every evaluation
            return self._evaluated(inputs)

    def _evaluated(self, inputs: Sequence[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
        count = len(inputs[0])
        results = [np.empty((count, size)) for size in self._sizes_out]
        failed = np.zeros(count, dtype=bool)
        for call, start, stop in self._turns(count):
            if not self._succeeds(call, slice(start, stop), inputs, results):
                # A plugin that gives up on one realization ends the whole call (qpOASES does), so each is evaluated alone.
                for k in range(start, stop):
                    if not self._succeeds(self._calls[-1], slice(k, k + 1), inputs, results):
                        failed[k] = True
                        for result in results:
                            result[k] = np.nan
        return results, failed

    def _turns(self, count: int) -> Iterator[tuple["_Buffers", int, int]]:
        """Yield buffers and the range of realizations they evaluate; the narrower of WIDTHS may have idle places at the end.

        The first realization of all is evaluated alone, since other threads wait for it.
        """
        start = 0
        while start < count:
            remaining = 1 if self._is_new else count - start
            call = (
                self._calls[0] if remaining >= WIDTHS[0] else self._calls[1] if remaining >= WIDTHS[1] // 2 else self._calls[2]
            )
            stop = min(start + call.width, count)
            yield call, start, stop
            start = stop

    def _succeeds(self, call: "_Buffers", rows: slice, inputs: Sequence[np.ndarray], results: Sequence[np.ndarray]) -> bool:
        """Evaluate some rows of the inputs, and return whether it succeeded; if not, the solvers get a new memory.

        qpOASES starts from its last problem, and after one failure it always fails.
        """
        # The first evaluation constructs objects of CasADi: the memory of solvers, which wider calls then take, too.
        with CONSTRUCTION_LOCK if self._is_new else contextlib.nullcontext():
            succeeds = call([array[rows] for array in inputs], [result[rows] for result in results])
        if not succeeds:
            for solver in self._solvers:
                solver.checkout()  # the spoiled memory, never released: the next evaluation gets another
        self._is_new = not succeeds
        return succeeds


class _Buffers:
    """A Function of `width` realizations at once, with arrays at fixed addresses, which the first call allocates."""

    def __init__(self, function: ca.Function, width: int, fixed_inputs: Mapping[int, np.ndarray]) -> None:
        self._function, self.width, self._fixed_inputs = function, width, fixed_inputs
        self._evaluate: Callable[[], None] | None = None

    def _allocate(self) -> Callable[[], None]:
        """Allocate the arrays, and return what evaluates the Function on them."""
        width, fixed_inputs = self.width, self._fixed_inputs
        function = self._function.map(width) if width > 1 else self._function
        self._buffer, evaluate = function.buffer()
        inputs = [np.zeros((width, function.nnz_in(i) // width)) for i in range(function.n_in())]
        self._outputs = [np.zeros((width, function.nnz_out(i) // width)) for i in range(function.n_out())]
        for i, array in enumerate(inputs):
            if i in fixed_inputs:
                array[:] = fixed_inputs[i]
            self._buffer.set_arg(i, memoryview(array.ravel()))  # type: ignore[call-arg, arg-type]
        for i, array in enumerate(self._outputs):
            self._buffer.set_res(i, memoryview(array.ravel()))  # type: ignore[call-arg, arg-type]
        self._all = inputs  # the buffer does not keep them alive
        self._inputs = [array for i, array in enumerate(inputs) if i not in fixed_inputs]
        return evaluate  # type: ignore[no-any-return]

    def __call__(self, inputs: Sequence[np.ndarray], outputs: Sequence[np.ndarray]) -> bool:
        """Evaluate for up to `width` realizations; idle places repeat the last one. Return whether it succeeded."""
        count = len(inputs[0])
        if self._evaluate is None:
            with CONSTRUCTION_LOCK:
                self._evaluate = self._allocate()
        for buffer, array in zip(self._inputs, inputs, strict=True):
            buffer[:count] = array
            buffer[count:] = array[-1:]
        try:
            self._evaluate()
        except RuntimeError:  # CasADi's only exception: bounds that are not numbers
            return False
        for buffer, array in zip(self._outputs, outputs, strict=True):
            array[:] = buffer[:count]
        return bool(self._buffer.ret() == 0)


# Evaluations, in all processes, after which a Function is compiled. Compiling takes as long as interpreting it once or twice as
# often, so that all together takes at most some three times as long as if the number of evaluations had been known.
MIN_COMPILED_CALLS = 10_000
MAX_INSTRUCTIONS = 300_000  # that are compiled; more are interpreted, since compiling them takes more than a gigabyte


class Evaluations:
    """The number of evaluations of a Function by this process and by those that stored theirs before."""

    def __init__(self, key: str) -> None:
        self._key = f"{key}-evaluations"
        stored = code_cache.load(self._key) or b""
        self.number = int(stored) if stored.isdigit() else 0

    def store(self) -> None:
        """Keep the number for later processes."""
        code_cache.store(self._key, str(self.number).encode())


class AdaptiveFunction:
    """A Function of scalar expressions that is interpreted, and compiled once it was evaluated often. Threads may share it.

    Both ways give the same results to the last bit. Evaluations of earlier processes count, too.

    native   the machine code, or None while CasADi interprets
    """

    def __init__(self, function: ca.Function) -> None:
        self._function = function
        self.sizes_out = [function.nnz_out(i) for i in range(function.n_out())]
        self.native: NativeFunction | None = None
        self._may_be_compiled = function.n_instructions() <= MAX_INSTRUCTIONS
        self._evaluations: Evaluations | None = None
        self._lock = threading.Lock()

    def __call__(self, inputs: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return outputs (realization, stored entry) for inputs (realization, stored entry)."""
        if native := self._compiled(len(inputs[0])):
            return native(inputs)
        with self._lock:
            return self._interpreted(inputs)[0]

    @functools.cached_property
    def _interpreted(self) -> InterpretedFunction:
        with CONSTRUCTION_LOCK:
            return InterpretedFunction(self._function)

    def evaluate(self, count: int, arrays: Sequence[Located], places: ArgumentPlaces) -> None:
        """Evaluate the Function for all elements of `count` realizations; see NativeFunction."""
        if native := self._compiled(count * places.elements):
            native.evaluate(count, arrays, places)
            return
        rows, cut = count * places.elements, len(arrays) - len(self.sizes_out)
        inputs = [
            np.broadcast_to(place.array[:, columns], (count, *columns.shape)).reshape(rows, columns.shape[1])
            for place, columns in zip(arrays[:cut], places.columns, strict=False)
        ]
        with self._lock:
            results = self._interpreted(inputs)[0]
        for place, columns, values in zip(arrays[cut:], places.columns[cut:], results, strict=True):
            place.array[:, columns] = values.reshape(count, *columns.shape)

    def _compiled(self, count: int) -> NativeFunction | None:
        """Return the machine code for `count` more evaluations, None while CasADi interprets."""
        # CasADi interprets what LLVM cannot compile on this machine.
        with contextlib.suppress(UnknownInstructionError, RuntimeError):
            if self.native is None and self._is_due(count):
                self.native = NativeFunction(self._function)  # other threads interpret meanwhile
        return self.native

    def _is_due(self, count: int) -> bool:
        """Return whether to compile before `count` evaluations, which is true once. The first call looks for stored code."""
        with self._lock:  # other threads wait for stored code: to interpret takes longer
            if not self._may_be_compiled or self.native is not None:
                return False
            if self._evaluations is None:
                key = key_of(self._function)
                self.native = NativeFunction.from_cache(self._function, key)
                if self.native is not None:
                    return False
                self._evaluations = Evaluations(key)
                weakref.finalize(self, self._evaluations.store)
            self._evaluations.number += count
            self._may_be_compiled = self._evaluations.number <= MIN_COMPILED_CALLS
            return not self._may_be_compiled


class NamedFunction:
    """A Function of scalar expressions for many realizations at once: the first dimension of every array."""

    def __init__(self, function: ca.Function) -> None:
        self._names, self._results = function.name_in(), function.name_out()
        self._evaluate = AdaptiveFunction(function)

    @property
    def names(self) -> list[str]:
        """The names of its inputs."""
        return self._names

    def at(self, places: Mapping[str, Int[Array, "element _"]]) -> "IndexedFunction":
        """Return the function of several elements, whose inputs and results stand in these columns of arrays, by name."""
        names = [*self._names, *self._results]
        return IndexedFunction(self._evaluate, names, ArgumentPlaces([places[name] for name in names]))

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
        outputs = self._evaluate([flat(arrays[name]) for name in self._names])
        return dict(zip(self._results, outputs, strict=True))


class IndexedFunction:
    """A Function that is evaluated for several elements of each realization, on arrays that hold the numbers of all."""

    def __init__(self, function: AdaptiveFunction, names: Sequence[str], places: ArgumentPlaces) -> None:
        self._function, self._names, self._places = function, names, places

    def __call__(self, count: int, arrays: Mapping[str, Located]) -> None:
        """Read inputs of `count` realizations from arrays by name, of one row if all share it; write results into others."""
        if self._places.elements:
            self._function.evaluate(count, [arrays[name] for name in self._names], self._places)


def flat(array: Real[Array, "realization ..."]) -> Float[Array, "realization _"]:
    """Return (realization, entry) of an array that is flat or (column, row), CasADi's order, in each realization."""
    return np.ascontiguousarray(array, dtype=float).reshape(len(array), math.prod(array.shape[1:]))
