"""Measures as expressions of poses and deviations: user-defined ones, heights over walls, distances, angles, combinations."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from tolcontact.declaration import Measure, Part, Point
from tolcontact.declaration.measure import BINARY, MAX_STEPS, UNARY, Tape
from tolcontact.discretization import Nominal
from tolcontact.discretization.measured_geometry import (
    AxisPair,
    Combined,
    Crossing,
    DirectionPair,
    FaceGap,
    Heights,
    LinearForm,
    MeasuredFace,
    MeasuredPoint,
    MeshClearance,
    NominalMeasurement,
    PlaneClearance,
    RoundClearance,
    Wall,
)
from tolcontact.errors import Faults, designation
from tolcontact.features import FaceDeviation
from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Plane, Sphere, Torus
from tolcontact.mechanics.clearance import mesh_clearance, minimum, plane_clearance, segment_distance
from tolcontact.mechanics.flexibility import Bending
from tolcontact.mechanics.group_equations import face_height, face_pose
from tolcontact.mechanics.pose import ENTRIES, Pose, relative
from tolcontact.mechanics.round_gap import round_gaps
from tolcontact.user_functions import FunctionError, called

OPERATIONS: dict[str, int] = {name: getattr(ca, f"OP_{name.upper()}") for name in (*UNARY, *BINARY)}  # of tapes, in CasADi
_NAMES = {operation: name for name, operation in OPERATIONS.items()}


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
        else:
            apply = ca.SX.unary if operation in UNARY else ca.SX.binary
            values.append(apply(OPERATIONS[operation], *(values[operand] for operand in operands)))
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


@dataclass(frozen=True, eq=False)
class Observed:
    """The arguments of measurements: poses of the parts, deviations (contributor, 1), and the preceding measures."""

    poses: Sequence[Pose]
    deviations: ca.SX
    measures: Sequence[ca.SX]

    def pose(self, part: int, face: FaceDeviation | None) -> Pose:
        """Return the pose that moves points of a nominal face to the actual face in the assembly."""
        X_face = face_pose(face, self.deviations)
        return self.poses[part] if X_face is None else self.poses[part] @ X_face

    def position(self, point: MeasuredPoint) -> ca.SX:
        """Return the position (3, 1) [mm] of a point, which moves with its face."""
        height = face_height(point.deviation, self.deviations, point.position)
        return self.pose(point.part, point.deviation).apply(ca.DM(point.position) + height * ca.DM(point.outward))


def value_of(measurement: NominalMeasurement, observed: Observed) -> ca.SX:
    """Return the value of a measurement in its units."""
    return EXPRESSIONS[type(measurement)](measurement, observed)


def _least_height(heights: Heights, observed: Observed) -> ca.SX:
    over_walls = [_height(point, wall, observed) for point, wall in heights.points]
    return minimum([*over_walls, *(_edge_height(crossing, observed) for crossing in heights.crossings)])


def _face_gap(gap: FaceGap, observed: Observed) -> ca.SX:
    """Return the largest gap of all points, or their area-weighted mean [mm]."""
    heights = ca.vertcat(*(_height(point, wall, observed) for point, wall in gap.points))
    return ca.mmax(heights) if gap.is_largest else ca.dot(ca.DM(gap.weights), heights)


def _plane_clearance(clearance: PlaneClearance, observed: Observed) -> ca.SX:
    X_21 = _relative(clearance.moving, clearance.reference, observed)
    return plane_clearance(clearance, X_21, _least_height(clearance.heights, observed))


def _relative(moving: MeasuredFace, reference: MeasuredFace, observed: Observed) -> Pose:
    """Return the pose of a moving face in the frame of a reference one."""
    return relative(observed.pose(moving.part, moving.deviation), observed.pose(reference.part, reference.deviation))


def _edge_height(crossing: Crossing, observed: Observed) -> ca.SX:
    """Return the height of an edge over one that it crosses: the distance of their lines along their common normal [mm]."""
    moving, reference = (
        [observed.pose(face.part, face.deviation).apply(ca.DM(end)) for end in edge]
        for face, edge in zip((crossing.moving, crossing.reference), crossing.edges, strict=True)
    )
    n = crossing.sense * ca.cross(moving[1] - moving[0], reference[1] - reference[0])
    return ca.dot(n, moving[0] - reference[0]) / ca.norm_2(n)


def _height(point: MeasuredPoint, wall: Wall, observed: Observed) -> ca.SX:
    """Return the height of a point over a wall, less the growth of the wall [mm]."""
    X = observed.pose(wall.part, wall.deviation)
    p = X.R.T @ (observed.position(point) - X.t)
    height = face_height(wall.deviation, observed.deviations, wall.foot(point.position))
    return wall.side * distance(wall.surface, p) - height


def distance(surface: AnalyticSurface, p: ca.SX) -> ca.SX:
    """Return the signed distance [mm] of a point p (3, 1) from a surface: AnalyticSurface.distance as an expression."""
    offset, axis = p - ca.DM(surface.origin), ca.DM(surface.axis)
    along = ca.dot(axis, offset)
    across = offset - along * axis
    if isinstance(surface, Plane):
        return surface.height(0.0, along)  # type: ignore[no-any-return]
    if isinstance(surface, Sphere):
        return surface.height(ca.norm_2(offset), 0.0)  # type: ignore[no-any-return]
    if isinstance(surface, Torus):
        tube = ca.norm_2(ca.vertcat(ca.norm_2(across) - surface.radius, along))
        return surface.height(tube, along)  # type: ignore[no-any-return]
    return surface.height(ca.norm_2(across), along)  # type: ignore[no-any-return]


def _round_clearance(clearance: RoundClearance, observed: Observed) -> ca.SX:
    moving, reference = clearance.moving, clearance.reference
    X_RM = _relative(moving, reference, observed)
    growths = ca.vertcat(*(face_height(face.deviation, observed.deviations) for face in (moving, reference)))
    points = clearance.points
    gaps = round_gaps(points, X_RM.vector(), growths, ca.SX(len(points), 1), ca.SX(ENTRIES, 0)).gaps
    return minimum(ca.vertsplit(gaps))


def _mesh_clearance(clearance: MeshClearance, observed: Observed) -> ca.SX:
    faces = (clearance.moving, clearance.reference)
    growth = sum(face_height(face.deviation, observed.deviations) for face in faces)
    return mesh_clearance(clearance, _relative(*faces, observed)) - growth


def _axis_distance(pair: AxisPair, observed: Observed) -> ca.SX:
    moving, reference = (
        [observed.pose(axis.part, axis.deviation).apply(ca.DM(end)) for end in axis.ends]
        for axis in (pair.moving, pair.reference)
    )
    a, b = (moving[0] + moving[1]) / 2, (reference[0] + reference[1]) / 2
    v = observed.pose(pair.reference.part, pair.reference.deviation).R @ ca.DM(pair.reference.direction)
    if pair.along is not None:
        return ca.dot(ca.DM(pair.along), b - a + ca.dot(a - b, v) * v)
    if pair.across is not None:
        n = ca.SX(ca.DM(pair.across))
        v = v if pair.reference.direction.any() else n
        return ca.norm_2(b - a + ca.dot(a - b, n) / ca.dot(v, n) * v)
    shortest = segment_distance(moving, reference)
    if not pair.is_between_surfaces:
        return shortest
    radii = sum(axis.radius + face_height(axis.deviation, observed.deviations) for axis in (pair.moving, pair.reference))
    return shortest - radii


def _angle(pair: DirectionPair, observed: Observed) -> ca.SX:
    """Return the angle [rad] by atan2 of sine and cosine, which remains accurate where the cosine is 1."""
    faces = (pair.moving, pair.reference)
    u, v = (
        observed.pose(face.part, face.deviation).R @ ca.DM(direction)
        for face, direction in zip(faces, pair.directions, strict=True)
    )
    if pair.about is None:
        return ca.atan2(ca.norm_2(ca.cross(u, v)), ca.dot(u, v))
    n = ca.DM(pair.about)
    return ca.atan2(ca.dot(n, ca.cross(u, v)), ca.dot(u, v) - ca.dot(u, n) * ca.dot(v, n))


def _linear_form(form: LinearForm, observed: Observed) -> ca.SX:
    return form.constant + ca.dot(ca.DM(form.factors), observed.deviations[form.columns.tolist()])


def _combined(combined: Combined, observed: Observed) -> ca.SX:
    values = [
        value_of(operand, observed) if isinstance(operand, NominalMeasurement) else observed.measures[operand]
        for operand in combined.operands
    ]
    return COMBINATIONS[combined.kind](ca.vertcat(*values))


def _least(values: ca.SX) -> ca.SX:
    return _if_all_finite(values, ca.mmin(values))


def _largest(values: ca.SX) -> ca.SX:
    return _if_all_finite(values, ca.mmax(values))


def _if_all_finite(values: ca.SX, result: ca.SX) -> ca.SX:
    """Return a result; NaN if any of the values is undefined, which casadi's minimum and maximum leave out."""
    return ca.if_else(ca.fabs(ca.sum1(values)) < np.inf, result, np.nan)


EXPRESSIONS: Mapping[type[NominalMeasurement], Callable[[Any, Observed], ca.SX]] = {
    Heights: _least_height, FaceGap: _face_gap, PlaneClearance: _plane_clearance, RoundClearance: _round_clearance,
    MeshClearance: _mesh_clearance, AxisPair: _axis_distance, DirectionPair: _angle, Combined: _combined,
    LinearForm: _linear_form,
}  # fmt: skip
COMBINATIONS: Mapping[str, Callable[[ca.SX], ca.SX]] = {
    "minimum": _least, "maximum": _largest, "mean": lambda values: ca.sum1(values) / values.numel(), "sum": ca.sum1,
    "difference": lambda values: values[0] - values[1],
}  # fmt: skip
