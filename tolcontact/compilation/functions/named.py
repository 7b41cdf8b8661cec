"""Functions whose inputs and outputs go by name."""

import math

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Float, Real
from tolcontact.compilation.functions.adaptive import AdaptiveFunction


class NamedFunction:
    """A Function of scalar expressions for many realizations at once: the first dimension of every array."""

    def __init__(self, function: ca.Function) -> None:
        self._names, self._results = function.name_in(), function.name_out()
        self._evaluate = AdaptiveFunction(function)

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


def flat(array: Real[Array, "realization ..."]) -> Float[Array, "realization _"]:
    """Return (realization, entry) of an array that is flat or (column, row), CasADi's order, in each realization."""
    return np.ascontiguousarray(array, dtype=float).reshape(len(array), math.prod(array.shape[1:]))
