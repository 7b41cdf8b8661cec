"""Users' expressions as tapes: see tolcontact.declaration.tape."""

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca

from tolcontact.declaration.tape import BINARY, MAX_STEPS, UNARY, Tape
from tolcontact.mechanics.pose import ENTRIES, Pose

UNARY_FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    "neg": lambda a: -a, "exp": ca.exp, "log": ca.log, "sqrt": ca.sqrt, "sq": lambda a: a * a, "twice": lambda a: 2 * a,
    "sin": ca.sin, "cos": ca.cos, "tan": ca.tan, "asin": ca.asin, "acos": ca.acos, "atan": ca.atan, "floor": ca.floor,
    "ceil": ca.ceil, "fabs": ca.fabs, "sign": ca.sign, "erf": ca.erf, "inv": lambda a: 1 / a, "sinh": ca.sinh,
    "cosh": ca.cosh, "tanh": ca.tanh, "asinh": ca.asinh, "acosh": ca.acosh, "atanh": ca.atanh, "not": ca.logic_not,
    "log1p": ca.log1p, "expm1": ca.expm1, "assign": lambda a: a,
}  # fmt: skip
BINARY_FUNCTIONS: dict[str, Callable[[Any, Any], Any]] = {
    "add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b, "div": lambda a, b: a / b,
    "pow": ca.power, "constpow": ca.power, "lt": ca.lt, "le": ca.le, "eq": ca.eq, "ne": ca.ne, "and": ca.logic_and,
    "or": ca.logic_or, "fmod": ca.fmod, "remainder": ca.remainder, "copysign": ca.copysign, "atan2": ca.atan2,
    "fmin": ca.fmin, "fmax": ca.fmax, "hypot": ca.hypot, "if_else_zero": lambda a, b: ca.if_else(a, b, 0),
}  # fmt: skip
_NAMES = {getattr(ca, f"OP_{name.upper()}"): name for name in (*UNARY, *BINARY)}


def record(expression: ca.SX, entries: ca.SX, max_steps: int = MAX_STEPS) -> Tape:
    """Return the steps of a scalar expression of `entries`.

    entries   (12 * part + contributor, 1): the entries of all poses, then deviations

    Raises ValueError for an operation that tapes do not support, or for too many operations.
    """
    function = ca.Function("expression", [entries], [expression])
    if function.n_instructions() > max_steps:
        raise ValueError(f"an expression of {function.n_instructions()} steps cannot be archived; {max_steps} can")
    rows: list[tuple[Any, ...]] = []
    at: dict[int, int] = {}  # work register -> row
    for k in range(function.n_instructions()):
        operation = function.instruction_id(k)
        inputs, outputs = function.instruction_input(k), function.instruction_output(k)
        if operation == ca.OP_OUTPUT:
            rows.append(("assign", at[inputs[0]]))
            continue
        if operation == ca.OP_INPUT:
            rows.append(("input", inputs[1]))
        elif operation == ca.OP_CONST:
            rows.append(("const", function.instruction_constant(k)))
        elif operation in _NAMES:
            rows.append((_NAMES[operation], *(at[register] for register in inputs)))
        else:
            raise ValueError(f"CasADi operation {operation} of an expression cannot be archived")
        at[outputs[0]] = len(rows) - 1
    return tuple(rows)


def replay(tape: Tape, poses: Sequence[Pose], deviations: ca.SX) -> ca.SX:
    """Return the expression that a tape holds, on the given poses and deviations."""
    entries = ca.vertcat(*(pose.vector() for pose in poses), deviations)
    if entries.numel() != ENTRIES * len(poses) + deviations.numel():
        raise ValueError("a tape needs 12 entries for each pose")
    values: list[ca.SX] = []
    for operation, *operands in tape:
        if operation == "input":
            values.append(entries[operands[0]])
        elif operation == "const":
            values.append(ca.SX(operands[0]))
        elif operation in UNARY_FUNCTIONS:
            values.append(UNARY_FUNCTIONS[operation](values[operands[0]]))
        else:
            values.append(BINARY_FUNCTIONS[operation](values[operands[0]], values[operands[1]]))
    return values[-1]
