"""The operations of symbolic Functions in LLVM's intermediate code, for several realizations at once."""

from collections.abc import Callable

import casadi as ca
from llvmlite import ir

LANES = 4  # realizations
DOUBLE = ir.DoubleType()
VECTOR = ir.VectorType(DOUBLE, LANES)


def constant(value: float) -> ir.Constant:
    """Return a number for all realizations."""
    return VECTOR([DOUBLE(value)] * LANES)


ZERO, ONE = constant(0.0), constant(1.0)


def _truth(builder: ir.IRBuilder, value: ir.Value) -> ir.Value:
    """Return 1.0 or 0.0 for a truth value."""
    return builder.select(value, ONE, ZERO)


def _holds(builder: ir.IRBuilder, x: ir.Value) -> ir.Value:
    return builder.fcmp_unordered("!=", x, ZERO)


def _extreme(builder: ir.IRBuilder, sign: str, x: ir.Value, y: ir.Value) -> ir.Value:
    """Return C's fmin ("<=") or fmax (">="): the other operand if one is NaN, and the first of two equal operands."""
    return builder.select(builder.or_(builder.fcmp_ordered(sign, x, y), builder.fcmp_unordered("uno", y, y)), x, y)


def _call(name: str) -> Callable[[ir.IRBuilder, ir.Value], ir.Value]:
    def call(builder: ir.IRBuilder, x: ir.Value) -> ir.Value:
        full = f"llvm.{name}.v{LANES}f64"
        declared = builder.module.globals.get(full) or ir.Function(builder.module, ir.FunctionType(VECTOR, [VECTOR]), full)
        return builder.call(declared, [x])

    return call


OPERATIONS: dict[int, Callable[..., ir.Value]] = {
    ca.OP_ASSIGN: lambda b, x: x,
    ca.OP_ADD: ir.IRBuilder.fadd,
    ca.OP_SUB: ir.IRBuilder.fsub,
    ca.OP_MUL: ir.IRBuilder.fmul,
    ca.OP_DIV: ir.IRBuilder.fdiv,
    ca.OP_NEG: ir.IRBuilder.fneg,
    ca.OP_SQ: lambda b, x: b.fmul(x, x),
    ca.OP_TWICE: lambda b, x: b.fadd(x, x),
    ca.OP_INV: lambda b, x: b.fdiv(ONE, x),
    ca.OP_FMIN: lambda b, x, y: _extreme(b, "<=", x, y),
    ca.OP_FMAX: lambda b, x, y: _extreme(b, ">=", x, y),
    ca.OP_LT: lambda b, x, y: _truth(b, b.fcmp_ordered("<", x, y)),
    ca.OP_LE: lambda b, x, y: _truth(b, b.fcmp_ordered("<=", x, y)),
    ca.OP_EQ: lambda b, x, y: _truth(b, b.fcmp_ordered("==", x, y)),
    ca.OP_NE: lambda b, x, y: _truth(b, b.fcmp_unordered("!=", x, y)),
    ca.OP_NOT: lambda b, x: _truth(b, b.not_(_holds(b, x))),
    ca.OP_AND: lambda b, x, y: _truth(b, b.and_(_holds(b, x), _holds(b, y))),
    ca.OP_OR: lambda b, x, y: _truth(b, b.or_(_holds(b, x), _holds(b, y))),
    ca.OP_IF_ELSE_ZERO: lambda b, x, y: b.select(_holds(b, x), y, ZERO),
    **{getattr(ca, f"OP_{name.upper()}"): _call(name) for name in ("sqrt", "fabs", "sin", "cos", "exp", "log")},
}
