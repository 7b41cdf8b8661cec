"""The operators by which a STEP file places copies of shapes: moved, mirrored or scaled (ISO 10303-42).

The CAD kernel reads a mirror as a rotation, and an operator that lacks parameters as no motion at all. Here its model of the
file is corrected before it makes shapes: a mirror is stated as a scale of -1, which is a point reflection, after a rotation.
"""

from typing import Any

import numpy as np
from OCP.GeomToStep import GeomToStep_MakeCartesianPoint, GeomToStep_MakeDirection
from OCP.gp import gp_Dir, gp_Pnt, gp_Trsf
from OCP.StepGeom import StepGeom_CartesianTransformationOperator3d
from OCP.StepToGeom import StepToGeom

from tolcontact.child import Refusal

CLOSE = 1e-9  # between numbers of a motion that is read as it is stated
SCALE_TOLERANCE = 1e-6


def correct_operators(model: Any, count: int) -> None:
    """Let the kernel read each of `count` operators in its model of a file as it is stated. Raises Refusal if it cannot."""
    entities = (model.Value(number) for number in range(1, model.NbEntities() + 1))
    operators = [entity for entity in entities if isinstance(entity, StepGeom_CartesianTransformationOperator3d)]
    if len(operators) < count or any(operator.LocalOrigin() is None for operator in operators):
        raise Refusal("is damaged: a CARTESIAN_TRANSFORMATION_OPERATOR_3D has other parameters than ISO 10303; export it again")
    for operator in operators:
        _correct(operator)


def _correct(operator: Any) -> None:
    scale = operator.Scale() if operator.HasScale() else 1.0
    if abs(scale + 1) <= SCALE_TOLERANCE and np.linalg.det(_motion(operator)[:, :3]) < 0:
        return  # a mirror as the kernel itself writes and reads it, against the norm, which permits no scale below 0
    if abs(scale - 1) > SCALE_TOLERANCE:
        raise Refusal("places a body scaled, which bodies of a rigid assembly are not; export it as it is")
    axes, origin = _axes(operator), np.array([operator.LocalOrigin().CoordinatesValue(k) for k in (1, 2, 3)])
    sense = np.sign(np.linalg.det(axes))
    if sense < 0:
        operator.SetScale(-1.0)
    operator.SetAxis1(_direction(sense * axes[:, 0]))
    operator.SetAxis3(_direction(sense * axes[:, 2]))
    for local_origin in (origin, sense * origin):  # some releases of the kernel scale it, too
        operator.SetLocalOrigin(GeomToStep_MakeCartesianPoint(gp_Pnt(*local_origin), 1.0).Value())
        if np.abs(_motion(operator) - np.column_stack([axes, origin])).max() <= CLOSE * max(1.0, np.abs(origin).max()):
            return
    raise Refusal("places a body mirrored, which this release of the CAD kernel cannot read; export the body itself")


def _motion(operator: Any) -> np.ndarray:
    """Return the motion (3, 4) of an operator as the kernel reads it."""
    motion = gp_Trsf()
    StepToGeom.MakeTransformation3d_s(operator, motion)
    return np.array([[motion.Value(row, column) for column in range(1, 5)] for row in range(1, 4)])


def _axes(operator: Any) -> np.ndarray:
    """Return the directions of the three axes of an operator as columns (3, 3)."""
    z = _stated(operator.Axis3(), np.array([0.0, 0.0, 1.0]))
    x = _stated(operator.Axis1(), np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 1 - CLOSE else np.array([0.0, 1.0, 0.0]))
    x = _unit(x - (x @ z) * z)
    y = _stated(operator.Axis2(), np.array([0.0, 1.0, 0.0]))
    y = y - (y @ z) * z - (y @ x) * x
    is_left_out = operator.Axis2() is None and np.linalg.norm(y) < CLOSE  # for the norm it would then have no direction
    return np.column_stack([x, np.cross(z, x) if is_left_out else _unit(y), z])


def _stated(direction: Any, default: np.ndarray) -> np.ndarray:
    return default if direction is None else _unit(np.array([direction.DirectionRatiosValue(k) for k in (1, 2, 3)]))


def _unit(vector: np.ndarray) -> np.ndarray:
    length = np.linalg.norm(vector)
    if length < CLOSE:
        raise Refusal(
            "is damaged: a CARTESIAN_TRANSFORMATION_OPERATOR_3D has parallel axes, or one of length 0; export it again"
        )
    return np.asarray(vector / length)


def _direction(axis: np.ndarray) -> Any:
    return GeomToStep_MakeDirection(gp_Dir(*axis)).Value()
