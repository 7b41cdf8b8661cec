"""Measures as expressions of the poses."""

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from tolcontact.declaration import Measure, Part, Point
from tolcontact.declaration.measure import BINARY, MAX_STEPS, UNARY, Tape
from tolcontact.discretization import Nominal
from tolcontact.errors import Faults, designation
from tolcontact.mechanics.flexibility import Bending
from tolcontact.mechanics.group_equations import face_height, face_pose
from tolcontact.mechanics.measurements import Observed, value_of
from tolcontact.mechanics.pose import ENTRIES, Pose
from tolcontact.user_functions import FunctionError, called

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
    """Return the operations of a scalar expression of `entries`.

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
    """Return the expression of a tape, at the given poses and deviations."""
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


class SymbolicPoses:
    """The symbolic poses of the parts, by their declarations: the argument of a user-defined measure."""

    def __init__(self, nominal: Nominal, poses: Sequence[Pose], deviations: ca.SX, bending: Bending | None = None) -> None:
        self._nominal = nominal
        self.poses = poses
        self.deviations = deviations
        self._bending = bending

    def _pose(self, part: Part) -> Pose:
        if part not in self._nominal.assembly.parts:
            names = ", ".join(declared.name for declared in self._nominal.assembly.parts)
            raise LookupError(f'unknown part "{getattr(part, "name", part)}"; the parts are: {names}')
        return self.poses[self._nominal.part_index(part)]

    def position(self, point: Point) -> ca.SX:
        """Return the position (3, 1) [mm] of a declared point in the assembly frame."""
        X, p, face = self._pose(point.part), ca.SX(ca.DM(self._nominal.position(point))), self._nominal.face_at(point)
        if self._bending is not None:
            p += self._bending.displacement(self._nominal.part_index(point.part), self._nominal.position(point))
        if face is None:
            return X.apply(p)
        X_face = face_pose(face, self.deviations)
        if face.grows or face.form is not None:
            height = face_height(face, self.deviations, self._nominal.position(point))
            p = p + height * ca.DM(self._nominal.outward(point))
        return X.apply(p if X_face is None else X_face.apply(p))

    def rotation(self, part: Part) -> ca.SX:
        """Return the rotation R (3, 3) of a part from its nominal orientation."""
        return self._pose(part).R

    def translation(self, part: Part) -> ca.SX:
        """Return t (3, 1) [mm] of a part: x = R x0 + t, with x0 in the nominal assembly frame."""
        return self._pose(part).t


def measured(nominal: Nominal, poses: Sequence[Pose], deviations: ca.SX, bending: Bending | None = None) -> list[ca.SX]:
    """Return one scalar expression per declared measure, of poses and deviations (contributor, 1), of parts with a `bending`.

    Raises ModelError if a user's function fails or does not return a scalar.
    """
    if nominal.scenes:
        return [expression for scene in nominal.scenes for expression in measured(scene, poses, deviations, bending)]
    faults = Faults()
    expressions: list[ca.SX] = []
    for measure, measurement in zip(nominal.measures, nominal.measurements, strict=True):
        if measurement is not None:
            value = value_of(measurement, Observed(poses, deviations, expressions))
            expressions.append(value if measure.unit == 1 else value / measure.unit)
            continue
        try:
            expressions.append(_expression(measure, nominal, SymbolicPoses(nominal, poses, deviations, bending)))
        except FunctionError as error:
            faults.append(f"{designation(measure.noun, measure)}: its function {error}")
            expressions.append(ca.SX.nan(1))
    faults.refuse(nominal.assembly.name)
    return expressions


def _expression(measure: Measure, nominal: Nominal, part_poses: SymbolicPoses) -> ca.SX:
    if isinstance(measure.of, Point):
        point, to = measure.of, measure.to
        if to is not None:
            is_deviation = measure.quantity == "deviation of distance"
            origin = nominal.position(to) - nominal.position(point) if is_deviation else np.zeros(3)
            moved = part_poses.position(to) - part_poses.position(point) - ca.DM(origin)
        else:
            origin = nominal.position(point) if measure.quantity == "displacement" else np.zeros(3)
            moved = part_poses.position(point) - ca.DM(origin)
        return ca.dot(ca.DM(np.array(measure.along) / measure.unit), moved)
    function: Any = measure.of
    recorded = isinstance(function, tuple)
    poses, deviations = part_poses.poses, part_poses.deviations
    expression = called(lambda: ca.SX(replay(function, poses, deviations) if recorded else function(part_poses)))
    if expression.shape != (1, 1):
        raise FunctionError(f"returned an expression of shape {expression.shape}; expected one number")
    known = {symbol.element_hash() for symbol in ca.symvar(ca.vertcat(*(pose.vector() for pose in poses), deviations))}
    if unknown := [symbol.name() for symbol in ca.symvar(expression) if symbol.element_hash() not in known]:
        raise FunctionError(f"returned an expression of symbols of its own ({', '.join(unknown)}); expected poses alone")
    return expression
