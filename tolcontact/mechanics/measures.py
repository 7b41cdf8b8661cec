"""Measures as expressions of the poses."""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from tolcontact.declaration import Measure, Part, Point
from tolcontact.discretization import Nominal
from tolcontact.errors import ModelError
from tolcontact.mechanics.face_pose import face_height, face_pose
from tolcontact.mechanics.pose import Pose
from tolcontact.mechanics.tape import replay


class SymbolicPoses:
    """The symbolic poses of the parts, by their declarations: the argument of a user's own measure."""

    def __init__(self, nominal: Nominal, poses: Sequence[Pose], deviations: ca.SX) -> None:
        self._nominal = nominal
        self._poses = poses
        self._deviations = deviations

    def _pose(self, part: Part) -> Pose:
        if part not in self._nominal.assembly.parts:
            names = ", ".join(declared.name for declared in self._nominal.assembly.parts)
            raise LookupError(f'unknown part "{getattr(part, "name", part)}"; the parts are: {names}')
        return self._poses[self._nominal.part_index(part)]

    def position(self, point: Point) -> ca.SX:
        """Return the position (3, 1) [mm] of a declared point in the assembly frame."""
        X, p, face = self._pose(point.part), ca.SX(ca.DM(self._nominal.position(point))), self._nominal.face_at(point)
        if face is None:
            return X.apply(p)
        X_face, height = face_pose(face, self._deviations), face_height(face, self._deviations)
        if face.grows:
            p = p + height * ca.DM(self._nominal.outward(point))
        return X.apply(p if X_face is None else X_face.apply(p))

    def rotation(self, part: Part) -> ca.SX:
        """Return the rotation R (3, 3) of a part from its nominal place."""
        return self._pose(part).R

    def translation(self, part: Part) -> ca.SX:
        """Return t (3, 1) [mm] of a part: x = R x0 + t, with x0 in the nominal assembly frame."""
        return self._pose(part).t


def measured(nominal: Nominal, poses: Sequence[Pose], deviations: ca.SX) -> list[ca.SX]:
    """Return one scalar expression per declared measure, of poses and deviations (contributor, 1).

    Raises ModelError if a user's function fails or does not return a scalar.
    """
    faults: list[str] = []
    expressions = []
    for measure in nominal.measures:
        try:
            expressions.append(_expression(measure, nominal, poses, deviations))
        except Exception as error:  # a user's function may raise anything; it becomes a fault of the model
            faults.append(
                f'measure "{measure.name}" ({measure.declared_at}): its function failed with '
                f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}"
            )
    if faults:
        raise ModelError(nominal.assembly.name, faults)
    return expressions


def _expression(measure: Measure, nominal: Nominal, poses: Sequence[Pose], deviations: ca.SX) -> ca.SX:
    part_poses = SymbolicPoses(nominal, poses, deviations)
    if isinstance(measure.of, Point):
        of, to = measure.of, measure.to
        if to is not None:
            origin = nominal.position(to) - nominal.position(of) if measure.quantity == "deviation of distance" else np.zeros(3)
            moved = part_poses.position(to) - part_poses.position(of) - ca.DM(origin)
        else:
            origin = nominal.position(of) if measure.quantity == "displacement" else np.zeros(3)
            moved = part_poses.position(of) - ca.DM(origin)
        return ca.dot(ca.DM(np.array(measure.along)), moved)
    value: Any = replay(measure.of, poses, deviations) if isinstance(measure.of, tuple) else measure.of(part_poses)
    expression = ca.SX(value)
    if expression.shape != (1, 1):
        raise ValueError(f"it returned an expression of shape {expression.shape}; expected one number")
    return expression
