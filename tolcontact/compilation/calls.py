"""Calls of expressions that recur in a QP. With many bodies, each becomes a Function that is compiled once."""

from collections.abc import Callable, Hashable, Sequence

import casadi as ca

Expression = Callable[..., Sequence[ca.SX]]
# How expressions are evaluated: `call(name, expression, *arguments, kind=...)` returns the results. Expressions of the same
# name and kind, for arguments of the same sparsity, differ only in their arguments.
Call = Callable[..., Sequence[ca.SX]]


def inline(name: str, expression: Expression, *arguments: ca.SX, kind: Hashable = ()) -> Sequence[ca.SX]:
    """Return the results of an expression as a part of the expressions of its arguments."""
    del name, kind
    return expression(*arguments)


class FunctionCalls:
    """Calls of Functions, one for all expressions that are the same: results do not contain their instructions."""

    def __init__(self) -> None:
        self._functions: dict[Hashable, ca.Function] = {}

    def __call__(self, name: str, expression: Expression, *arguments: ca.SX, kind: Hashable = ()) -> Sequence[ca.SX]:
        """Return the results."""
        key = name, kind, *(tuple(argument.sparsity().compress()) for argument in arguments)
        if key not in self._functions:
            symbols = [ca.SX.sym(f"i{k}", argument.sparsity()) for k, argument in enumerate(arguments)]
            self._functions[key] = ca.Function(name, symbols, expression(*symbols))
        never_inline = True
        return self._functions[key].call([*arguments], False, never_inline)  # type: ignore[no-any-return]
