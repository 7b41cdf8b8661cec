"""Measures as expressions of the poses."""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from tolcontact.declaration import Measure, Part, Point
from tolcontact.discretization import Nominal
from tolcontact.errors import ModelError
from tolcontact.mechanics.pose import Pose
from tolcontact.mechanics.tape import replay


class SymbolicPoses:
    """What a user's own measure gets: the symbolic poses of the parts, by their declarations."""

    def __init__(self, nominal: Nominal, poses: Sequence[Pose]) -> None:
        self._nominal = nominal
        self._poses = poses

    def _pose(self, part: Part) -> Pose:
        if part not in self._nominal.assembly.parts:
            known = ", ".join(own.name for own in self._nominal.assembly.parts)
            raise LookupError(f'unknown part "{getattr(part, "name", part)}"; the parts are: {known}')
        return self._poses[self._nominal.part_index(part)]

    def position(self, point: Point) -> ca.SX:
        """Where a declared point is, (3, 1) [mm], in the assembly frame."""
        return self._pose(point.part).apply(ca.DM(self._nominal.position(point)))

    def rotation(self, part: Part) -> ca.SX:
        """R (3, 3) of a part: its rotation from its nominal place."""
        return self._pose(part).R

    def translation(self, part: Part) -> ca.SX:
        """t (3, 1) [mm] of a part: x = R x0 + t, x0 in the nominal assembly frame."""
        return self._pose(part).t


def measured(nominal: Nominal, poses: Sequence[Pose]) -> list[ca.SX]:
    """One scalar expression per declared measure.

    Raises ModelError if a user's function fails or does not return a scalar.
    """
    faults: list[str] = []
    expressions = []
    for measure in nominal.measures:
        try:
            expressions.append(_expression(measure, nominal, poses))
        except Exception as error:  # a user's function may raise anything; it becomes a fault of the model
            faults.append(
                f'measure "{measure.name}" ({measure.declared_at}): its function failed with '
                f"{type(error).__name__}: {str(error).splitlines()[0] if str(error) else ''}"
            )
    if faults:
        raise ModelError(nominal.assembly.name, faults)
    return expressions


def _expression(measure: Measure, nominal: Nominal, poses: Sequence[Pose]) -> ca.SX:
    if isinstance(measure.of, Point):
        now = SymbolicPoses(nominal, poses)
        start = ca.DM(nominal.position(measure.of)) if measure.to is None else now.position(measure.of)
        end = now.position(measure.to or measure.of)
        return ca.dot(ca.DM(np.array(measure.along)), end - start)
    value: Any = replay(measure.of, poses) if isinstance(measure.of, tuple) else measure.of(SymbolicPoses(nominal, poses))
    expression = ca.SX(value)
    if expression.shape != (1, 1):
        raise ValueError(f"it returned an expression of shape {expression.shape}; expected one number")
    return expression
