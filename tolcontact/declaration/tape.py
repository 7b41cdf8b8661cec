"""A user's expression as a list of elementary steps, so that an archive can hold it without any code.

A tape is a tuple of rows (operation, operands...): "input" with an index into the pose entries of all parts and the deviations
that follow, "const" with a number, or the name of a CasADi operation with the positions of earlier rows. The last row is the
value.
"""

from typing import Any

from tolcontact.declaration.said import Said

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
LONGEST = 1_000_000  # steps: an expression of more takes minutes to compile


def tape_of(said: Said, inputs: int) -> Tape:
    """The tape that a document holds, of so many inputs at most.

    Raises ArchiveError if it is not a list of known steps, each on earlier ones.
    """
    rows: list[tuple[Any, ...]] = []
    for row in said:
        first, *operands = list(row) or [row]
        name = first.one_of(OPERANDS)
        if len(operands) != OPERANDS[name]:
            raise row.refused(f"{name!r} with {len(operands)} operands")
        if name == "const":
            rows.append((name, operands[0].constant()))
        else:
            count = inputs if name == "input" else len(rows)
            rows.append((name, *(operand.index(count) for operand in operands)))
        if len(rows) > LONGEST:
            raise said.refused(f"more than {LONGEST} steps")
    if not rows:
        raise said.refused("no steps")
    return tuple(rows)
