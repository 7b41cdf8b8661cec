"""The setting of an objective and of the rows of a QP: a group of a model, and the symbols of its inputs."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from tolcontact.discretization import Nominal
from tolcontact.mechanics.face_pose import face_poses, facing_pose
from tolcontact.mechanics.groups import Group
from tolcontact.mechanics.pose import Pose, pose_of
from tolcontact.method import Method


@dataclass(frozen=True, eq=False)
class Setting:
    """A group of coupled parts, and the symbols that its equations share. Poses are one for each part of the group.

    raw          poses from which displacements count
    moments      (10, side) of the points of each side that count in the objective
    deviations   (contributor, 1) of the model
    firmness     factor of the regularization: 1 in the last step
    z            (6 * mover, 1) [mm]: the increments, about which everything is linearized
    """

    nominal: Nominal
    group: Group
    method: Method
    raw: Sequence[Pose]
    moments: ca.SX
    deviations: ca.SX
    firmness: ca.SX
    z: ca.SX

    def at_rest(self, expression: ca.SX) -> ca.SX:
        """Return the expression at z = 0."""
        return ca.substitute(expression, self.z, ca.SX.zeros(self.z.shape))

    def slope(self, expression: ca.SX) -> ca.SX:
        """Return the expression's Jacobian by z, at z = 0."""
        return self.at_rest(ca.jacobian(expression, self.z))

    def curvature(self, expression: ca.SX) -> ca.SX:
        """Return the expression's Hessian by z, at z = 0."""
        return self.at_rest(ca.hessian(expression, self.z)[0])

    def linear(self, X: Pose) -> Pose:
        """Return the pose to first order in z."""
        entries = X.vector()
        return pose_of(self.at_rest(entries) + self.slope(entries) @ self.z)

    def relative(self, poses: Sequence[Pose]) -> list[Pose]:
        """Return X_RM of the faces of each pair of the group."""
        relative_poses = []
        for index, faces in zip(self.group.pairs, self._faces, strict=True):
            pair = self.nominal.pairs[index]
            reference = None if pair.reference is None else poses[self.group.position(pair.reference)]
            relative_poses.append(facing_pose(faces, poses[self.group.position(pair.moving)], reference))
        return relative_poses

    @cached_property
    def _faces(self) -> list[tuple[Pose | None, Pose | None]]:
        """Poses of the faces of the group's pairs in their parts, as shared expressions."""
        return [face_poses(self.nominal.pairs[index], self.deviations) for index in self.group.pairs]
