"""A part as it is seen before anything is computed: its shape in its place, and its faces with the words that choose them."""

from typing import NamedTuple

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from tolcontact.declaration import Part
from tolcontact.declaration.selection import FACE_ANGLE
from tolcontact.errors import GeometryFault
from tolcontact.geometry.brep_face import FaceInFile, described, numbered
from tolcontact.geometry.files import BREP
from tolcontact.geometry.shapes import shape

SLIGHT = 1e-6  # of a direction, and of a part's size


class SeenPart(NamedTuple):
    """Triangles in the nominal assembly: vertices (vertex, 3) [mm], faces (triangle, 3); and what they belong to.

    rotation   (3, 3) of the part
    face_of    (triangle,) numbers of faces from 0: of a STEP file's, or smooth pieces
    described  the faces, and
    words      how a script chooses each
    """

    rotation: np.ndarray
    vertices: np.ndarray
    faces: np.ndarray
    face_of: np.ndarray
    described: tuple[FaceInFile, ...]
    words: tuple[str, ...]


def seen(part: Part) -> SeenPart | None:
    """A part; None if its shape or its place is wrong."""
    if any(part.faults()):
        return None
    try:
        mesh = shape(part.geometry).mesh
    except GeometryFault:
        return None
    R = Rotation.from_rotvec(part.rotation).as_matrix()
    vertices = np.asarray(mesh.vertices) @ R.T + np.array(part.at)
    face_of, _ = numbered(mesh)
    faces = described(mesh)
    return SeenPart(R, vertices, np.asarray(mesh.faces), face_of, faces, tuple(_words(mesh, face_of, face) for face in faces))


def _words(mesh: trimesh.Trimesh, face_of: np.ndarray, face: FaceInFile) -> str:
    if BREP in mesh.face_attributes:
        return f"face(tc.Brep({_vector(np.array(face.point))}))"
    if face.kind == "cylinder" and face.radius is not None:
        return f"face(tc.Cylinder(radius={face.radius:.6g}, inner={face.is_inner}))"
    own = face_of == face.number - 1
    if face.kind == "plane" and face.direction is not None:
        along = np.array(face.direction)
        axis = int(np.argmax(np.abs(along)))
        is_named = abs(along[axis]) > 1 - SLIGHT
        way = f'"{"+-"[int(along[axis] < 0)]}{"xyz"[axis]}"' if is_named else f"tc.Facing({_vector(along)})"
        alike = np.asarray(mesh.face_normals) @ along >= np.cos(FACE_ANGLE)
        return f"face({way})" if (alike == own).all() else f"face({way}, {_inside(mesh, own)})"
    return f"face({_inside(mesh, own)})"


def _inside(mesh: trimesh.Trimesh, own: np.ndarray) -> str:
    """The box around some triangles (triangle,) of bool, with a little room."""
    corners, room = np.asarray(mesh.vertices)[mesh.faces[own]].reshape(-1, 3), SLIGHT * mesh.scale
    return f"tc.Inside({_vector(corners.min(axis=0) - room)}, {_vector(corners.max(axis=0) + room)})"


def _vector(x: np.ndarray) -> str:
    return "({:.7g}, {:.7g}, {:.7g})".format(*(np.round(x, 6) + 0.0))
