"""Poses of deviating faces, and the symbols that the equations of a contact group share.

A small rigid deviation enters as the pose of the face. It adds no rows: contact points, their hull and the QP are unchanged.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from tolcontact.discretization import ContactPoints, Nominal
from tolcontact.features import FaceDeviation
from tolcontact.mechanics.correction import Motion, increments
from tolcontact.mechanics.groups import Group
from tolcontact.mechanics.pose import Pose, constant, pose_of, relative, rotation
from tolcontact.method import Method


def face_pose(face: FaceDeviation | None, deviations: ca.SX) -> Pose | None:
    """Return the pose that moves points of the nominal face to the actual face, in the nominal assembly frame."""
    if face is None or not face.twist.any():
        return None
    q = ca.DM(face.twist) @ deviations[face.columns.tolist()]
    R, c = rotation(q[3:]), ca.DM(face.centre)
    return Pose(R, q[:3] + c - R @ c)


def face_height(face: FaceDeviation | None, deviations: ca.SX, point: np.ndarray | None = None) -> ca.SX:
    """Return the growth of a face out of the material [mm], with its form deviation at a `point` (3,) [mm] if given."""
    height = ca.SX(0)
    if face is not None and face.grows:
        height = ca.dot(ca.DM(face.height), deviations[face.columns.tolist()])
    if face is not None and face.form is not None and point is not None:
        height += ca.dot(ca.DM(face.form.heights(point)), deviations[face.form_columns.tolist()])
    return height


def face_poses(pair: ContactPoints, deviations: ca.SX) -> tuple[Pose | None, Pose | None]:
    """Return the poses of the moving and the reference face of a pair in their parts."""
    moving, reference = pair.deviating
    return face_pose(moving, deviations), face_pose(reference, deviations)


def face_heights(pair: ContactPoints, deviations: ca.SX) -> ca.SX:
    """Return the growth (2, 1) [mm] of the moving and the reference face of a pair; the latter less the coordinate error."""
    moving, reference = (face_height(face, deviations) for face in pair.deviating)
    return ca.vertcat(moving, reference - pair.coordinate_error)


def facing_pose(pair: ContactPoints, faces: tuple[Pose | None, Pose | None], pose_of_part: Callable[[int], Pose]) -> Pose:
    """Return X_RM of a pair: the pose of its moving face in the frame of its reference face, which may be the ground.

    `faces` are the poses of the moving and the reference face in their parts.
    """
    moving, reference = faces
    X_WM = pose_of_part(pair.moving)
    X_WF = X_WM if moving is None else X_WM @ moving
    if pair.reference is None:
        return X_WF
    X_WR = pose_of_part(pair.reference)
    return relative(X_WF, X_WR if reference is None else X_WR @ reference)


@dataclass(frozen=True, eq=False)
class GroupEquations:
    """A group of coupled parts, and the symbols that its equations share. Lists of poses have one for each part of the group.

    raw          raw poses, which displacements are measured from
    moments      moments (10, side) of the weighted points of each side in the objective
    deviations   (contributor, 1) of the model
    regularization_factor   factor of the regularization: 1 in the last step
    z            (6 * mover, 1) [mm]: the increments; everything is linearized at z = 0
    faces        poses of the moving and the reference face of each pair of the group in their parts
    heights      growth (2, 1) [mm] of the moving and the reference face of each pair of the group
    steps        steps (locator, 1) [mm] of the bilateral locators of each mover, see bilateral_steps
    scale        scale of the whole group's objective, if this is an element of that group; see tolcontact.mechanics.objective
    """

    nominal: Nominal
    group: Group
    method: Method
    raw: Sequence[Pose]
    moments: ca.SX
    deviations: ca.SX
    regularization_factor: ca.SX
    z: ca.SX
    faces: Sequence[tuple[Pose | None, Pose | None]]
    heights: Sequence[ca.SX]
    steps: Sequence[ca.SX]
    scale: ca.SX | None = None

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

    def motion(self, poses: Sequence[Pose]) -> Motion:
        """Return the motion of the group about poses of its parts, by the increments z."""
        mobilities = self.group.mobilities
        centres = [poses[k].apply(constant(mobilities[k].centre)) for k in map(self.group.position, self.group.free)]
        return Motion(mobilities, poses, increments(self.z, self.group.length, centres))

    def pair(self, k: int) -> ContactPoints:
        """Return a pair, given by its position in the group."""
        return self.nominal.pairs[self.group.pairs[k]]

    def relative(self, poses: Sequence[Pose]) -> list[Pose]:
        """Return X_RM of the faces of each pair of the group."""
        in_group = dict(zip(self.group.parts, poses, strict=True))
        return [facing_pose(self.pair(k), faces, in_group.__getitem__) for k, faces in enumerate(self.faces)]
