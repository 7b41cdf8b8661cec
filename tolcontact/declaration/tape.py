"""A user's expression as a list of elementary steps, which an archive can hold without code.

A tape is a tuple of rows (operation, operands...): "input" with an index into the pose entries of all parts and the deviations
that follow, "const" with a number, or the name of a CasADi operation with the positions of earlier rows. The last row is the
value.
"""

from typing import Any

from tolcontact.declaration.place import MAX_NUMBER, Place

Tape = tuple[tuple[Any, ...], ...]

UNARY = (
    "neg", "exp", "log", "sqrt", "sq", "twice", "sin", "cos", "tan", "asin", "acos", "atan", "floor", "ceil", "fabs", "sign",
    "erf", "inv", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh", "not", "log1p", "expm1", "assign",
)  # fmt: skip
BINARY = (
    "add", "sub", "mul", "div", "pow", "constpow", "lt", "le", "eq", "ne", "and", "or", "fmod", "remainder", "copysign",
    "atan2", "fmin", "fmax", "hypot", "if_else_zero",
)  # fmt: skip
OPERANDS = {"input": 1, "const": 1, **dict.fromkeys(UNARY, 1), **dict.fromkeys(BINARY, 2)}
MAX_STEPS = 1_000_000  # a longer expression takes minutes to compile


def tape_of(rows: list[list[Any]], place: Place, max_steps: int = MAX_STEPS) -> Tape:
    """Return the tape that a document has at `place`.

    Raises EntryError for an unknown step, or an operand that is neither an input nor an earlier step.
    """
    if not 0 < len(rows) <= max_steps:
        raise place.error("it has no steps" if not rows else f"it has more than {max_steps} steps")
    for k, (operation, *operands) in enumerate(row or [None] for row in rows):
        if operation not in OPERANDS:
            raise place[k].mismatch("the name of an operation", operation)
        if len(operands) != OPERANDS[operation]:
            raise place[k].error(f"{operation!r} with {len(operands)} operands")
        count = place.sources.inputs if operation == "input" else k
        for operand in operands:
            if operation == "const":  # an expression may compare with infinity
                if not isinstance(operand, float) and not (isinstance(operand, int) and abs(operand) <= MAX_NUMBER):
                    raise place[k].mismatch("a number", operand)
            elif not (isinstance(operand, int) and 0 <= operand < count):
                raise place[k].mismatch(f"a whole number from 0 to {count - 1}", operand)
    return tuple(map(tuple, rows))
