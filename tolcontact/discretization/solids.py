"""Geometry to triangle surfaces, and faces to the triangles that they name. Part's own frame, mm."""

from pathlib import Path

import numpy as np
import trimesh

from tolcontact.assembly import Box, Face, Mesh
from tolcontact.assembly.words import direction

FACE_ANGLE = np.radians(1.0)
FIELD_STATIONS = 12


class GeometryFault(Exception):
    """One sentence on what is wrong with a shape; collected with the other faults of a model."""


def surface(geometry: Box | Mesh) -> trimesh.Trimesh:
    """The closed or open triangle surface of a geometry.

    Raises GeometryFault where a mesh cannot be read, is empty, or is not finite.
    """
    if isinstance(geometry, Box):
        box: trimesh.Trimesh = trimesh.creation.box(bounds=[[0, 0, 0], [geometry.x, geometry.y, geometry.z]])
        return box
    if isinstance(geometry.source, str | Path):
        return _read(Path(geometry.source))
    return _checked(trimesh.Trimesh(geometry.source.vertices, geometry.source.faces, process=False), str(geometry))


def _read(path: Path) -> trimesh.Trimesh:
    try:
        loaded = trimesh.load(path, force="mesh")
    except Exception as error:  # trimesh's readers raise whatever their format's parser raises
        raise GeometryFault(
            f'"{path}" cannot be read as a mesh ({type(error).__name__}: {error}); '
            "expected a triangle mesh in STL, OBJ, PLY or GLB"
        ) from error
    return _checked(loaded, f'"{path}"')


def _checked(mesh: trimesh.Trimesh, who: str) -> trimesh.Trimesh:
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise GeometryFault(f"{who} holds no triangles; expected a triangle mesh")
    if not np.isfinite(mesh.vertices).all():
        raise GeometryFault(f"{who} holds vertices that are not finite numbers")
    if not mesh.area > 0:
        raise GeometryFault(f"{who} has no area: all its triangles are degenerate")
    return mesh


def select(mesh: trimesh.Trimesh, face: Face) -> np.ndarray:
    """Indices of the triangles that `face` names, shape (triangle,).

    Raises GeometryFault where there are none.
    """
    if isinstance(face.selection, str):
        chosen = mesh.face_normals @ np.array(direction(face.selection)) > np.cos(FACE_ANGLE)
    elif isinstance(face.selection, tuple):
        indices = np.asarray(face.selection, dtype=int)
        if indices.size and not (0 <= indices.min() and indices.max() < len(mesh.faces)):
            raise GeometryFault(f"face {face}: triangle indices must lie between 0 and {len(mesh.faces) - 1}")
        chosen = np.isin(np.arange(len(mesh.faces)), indices)
    else:
        try:
            chosen = np.asarray(face.selection(mesh.triangles_center, mesh.face_normals))
        except Exception as error:  # a user's function may raise anything; it becomes a fault of the model
            raise GeometryFault(f"face {face}: its function failed with {type(error).__name__}: {error}") from error
        if chosen.shape != (len(mesh.faces),) or chosen.dtype != bool:
            raise GeometryFault(
                f"face {face}: its function gave an array of shape {chosen.shape} and type {chosen.dtype}; "
                f"expected one True or False per triangle, shape ({len(mesh.faces)},)"
            )
    chosen &= mesh.area_faces > 0
    if not chosen.any():
        raise GeometryFault(f"face {face} has no triangles; choose another direction or selection")
    return np.flatnonzero(chosen)


def patch(mesh: trimesh.Trimesh, triangles: np.ndarray) -> trimesh.Trimesh:
    """The chosen triangles as a surface of their own, with the vertices in the order of the mesh."""
    used, faces = np.unique(mesh.faces[triangles], return_inverse=True)
    return trimesh.Trimesh(mesh.vertices[used], faces.reshape(-1, 3), process=False)


def field_surface(mesh: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (vertex, 3) and faces (face, 3) fine enough to show how displacement varies over a part."""
    step = mesh.scale / FIELD_STATIONS
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, max_edge=step, max_iter=20)
    merged = trimesh.Trimesh(vertices, faces, process=True)
    return np.asarray(merged.vertices), np.asarray(merged.faces)
