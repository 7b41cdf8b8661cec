"""Poses of deviating faces: of a face in its part, and of the two faces of a pair relative to each other.

A small rigid deviation enters as the pose of the face. It adds no rows: contact points, their hull and the QP stay the same.
"""

import casadi as ca

from tolcontact.discretization import ContactPoints
from tolcontact.features import FaceDeviation
from tolcontact.mechanics.pose import Pose, relative, rotation


def face_pose(face: FaceDeviation | None, deviations: ca.SX) -> Pose | None:
    """Return the pose that moves points of the nominal face to the actual face, in the nominal assembly frame."""
    if face is None or not face.twist.any():
        return None
    q = ca.DM(face.twist) @ deviations[face.columns.tolist()]
    R, c = rotation(q[3:]), ca.DM(face.centre)
    return Pose(R, q[:3] + c - R @ c)


def face_height(face: FaceDeviation | None, deviations: ca.SX) -> ca.SX:
    """Return the growth of a face out of the material [mm]."""
    if face is None or not face.grows:
        return ca.SX(0)
    return ca.dot(ca.DM(face.height), deviations[face.columns.tolist()])


def face_poses(pair: ContactPoints, deviations: ca.SX) -> tuple[Pose | None, Pose | None]:
    """Return the poses of the moving and the reference face of a pair in their parts."""
    moving, reference = pair.deviating
    return face_pose(moving, deviations), face_pose(reference, deviations)


def facing_pose(faces: tuple[Pose | None, Pose | None], X_WM: Pose, X_WR: Pose | None) -> Pose:
    """Return X_RM of a pair: the pose of its moving face in the frame of its reference face.

    `faces` are the poses of the moving and the reference face in their parts. X_WR is None for the ground.
    """
    moving, reference = faces
    X_WF = X_WM if moving is None else X_WM @ moving
    if X_WR is None:
        return X_WF
    return relative(X_WF, X_WR if reference is None else X_WR @ reference)
