"""Previews of parts before a run: shapes in their poses, and code that selects each face."""

from typing import NamedTuple

import numpy as np
import trimesh

from tolcontact.declaration import Part
from tolcontact.declaration.selection import FACE_ANGLE, FACE_GROUPS
from tolcontact.errors import GeometryFault
from tolcontact.geometry.brep_face import describe_faces, number_faces
from tolcontact.geometry.face_in_file import FaceInFile
from tolcontact.geometry.files import BREP
from tolcontact.geometry.shapes import placement_of, shape
from tolcontact.geometry.tolerances import SAME_DIRECTION, SAME_PLACE
from tolcontact.geometry.triangle_mesh import placed_mesh


class PartPreview(NamedTuple):
    """The triangles of a part in the nominal assembly: vertices (vertex, 3) [mm] and faces (triangle, 3).

    mesh          the same triangles in the part's own frame
    rotation      (3, 3) of the part, with the determinant -1 for a mirror image
    face_of       (triangle,) face indices: of the B-rep faces of a STEP file, or of smooth pieces
    descriptions  of the faces
    snippets      Python code that selects each face
    groups        Python code that selects the slot and the hole pattern of each face
    """

    mesh: trimesh.Trimesh
    rotation: np.ndarray
    vertices: np.ndarray
    faces: np.ndarray
    face_of: np.ndarray
    descriptions: tuple[FaceInFile, ...]
    snippets: tuple[str, ...]
    groups: tuple[tuple[str, ...], ...]


def preview(part: Part) -> PartPreview | None:
    """Return the preview of a part, None if its shape or its pose is invalid."""
    if any(part.faults()):
        return None
    try:
        mesh = shape(part.geometry)
    except GeometryFault:
        return None
    R, t = placement_of(part)
    placed = placed_mesh(mesh.vertices, mesh.faces, R, t)
    face_of, _ = number_faces(mesh)
    faces = describe_faces(mesh)
    snippets = tuple(_snippet(mesh, face_of, face) for face in faces)
    groups = tuple(
        tuple(_brep_snippet(face, f'whole="{word}"') for word in FACE_GROUPS if getattr(face, word)) for face in faces
    )
    return PartPreview(mesh, R, np.asarray(placed.vertices), np.asarray(placed.faces), face_of, faces, snippets, groups)


def _snippet(mesh: trimesh.Trimesh, face_of: np.ndarray, face: FaceInFile) -> str:
    if BREP in mesh.face_attributes:
        return _brep_snippet(face, "whole=True" if face.whole else "")
    if face.kind == "cylinder" and face.radius is not None:
        return f"face(tc.select.Cylinder(radius={face.radius:.6g}, inner={face.is_inner}))"
    mask = face_of == face.number - 1
    if face.kind == "plane" and face.direction is not None:
        normal = np.array(face.direction)
        axis = int(np.argmax(np.abs(normal)))
        is_axis = abs(normal[axis]) > 1 - SAME_DIRECTION
        direction = f'"{"+-"[int(normal[axis] < 0)]}{"xyz"[axis]}"' if is_axis else f"tc.select.Facing({_vector(normal)})"
        is_facing = np.asarray(mesh.face_normals) @ normal >= np.cos(FACE_ANGLE)
        return f"face({direction})" if (is_facing == mask).all() else f"face({direction}, {_box(mesh, mask)})"
    return f"face({_box(mesh, mask)})"


def _brep_snippet(face: FaceInFile, option: str) -> str:
    return f"face(tc.select.Brep({', '.join(filter(None, [_vector(np.array(face.point)), option]))}))"


def _box(mesh: trimesh.Trimesh, mask: np.ndarray) -> str:
    """Return code for the box, with a small margin, around the triangles of a mask (triangle,)."""
    corners, margin = np.asarray(mesh.vertices)[mesh.faces[mask]].reshape(-1, 3), SAME_PLACE * mesh.scale
    return f"tc.select.Inside({_vector(corners.min(axis=0) - margin)}, {_vector(corners.max(axis=0) + margin)})"


def _vector(x: np.ndarray) -> str:
    return "({:.7g}, {:.7g}, {:.7g})".format(*(np.round(x, 6) + 0.0))
