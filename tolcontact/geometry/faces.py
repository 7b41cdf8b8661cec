"""Faces: the triangles of a part that meet all of a face's criteria, as a surface of their own. Part's own frame, mm."""

import math
from collections.abc import Mapping

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from tolcontact.declaration import Brep, Cylinder, Face, Facing, Inside, Largest, Near, Part, Picked, Triangles
from tolcontact.declaration.selection import FACE_ANGLE
from tolcontact.declaration.vectors import Vector
from tolcontact.errors import GeometryFault, shown
from tolcontact.geometry.brep_face import FaceInFile, described, numbered
from tolcontact.geometry.files import BREP, FACE_NAMES, SURFACES
from tolcontact.geometry.surface import Surface
from tolcontact.geometry.surface_recognition import analytic_surfaces

NEAR_STATIONS = 100
BREP_REACH = 1e-3  # of the part's size: how far a point may stand off the B-rep face that it names
FLAT = 2e-4  # angle [rad] between neighbouring triangles of one flat face: what single precision leaves of it
SAME_SIZE = 1e-6  # of a radius: those that differ by less are one size
SHOWN = 12  # faces that a message lists
LOOKS_AT = -0.5  # cosine between the outward normals of two surfaces that face each other
CUT_MARGIN = 1e-9  # of the part's size: what lies in a side of a box is inside

Meshes = Mapping[Part, trimesh.Trimesh]


def patch(face: Face, meshes: Meshes) -> Surface:
    """The surface that a face names. `meshes` holds each part's surface in that part's own frame.

    Raises GeometryFault if there is none, or if its outside is undefined.
    """
    mesh = meshes[face.part]
    chosen = triangles(face, meshes)
    used, faces = np.unique(mesh.faces[chosen], return_inverse=True)
    surfaces, surface_numbers = analytic_surfaces(mesh, chosen)
    own = Surface(trimesh.Trimesh(mesh.vertices[used], faces.reshape(-1, 3), process=False), None, surfaces, surface_numbers)
    for selection in face.selections:
        if isinstance(selection, Inside):
            own = _cut(own, selection, CUT_MARGIN * mesh.scale)
            if len(own.mesh.faces) == 0:
                raise GeometryFault(f"face {face}: nothing of it lies in that box; the part spans {_span(mesh)}")
    sheets = _double(own.mesh)
    if sheets:
        raise GeometryFault(
            f"face {face}: {sheets} pairs of coincident triangles point opposite ways, so the outside is undefined; "
            "remove one of the two sheets, or choose a direction"
        )
    return own


def triangles(face: Face, meshes: Meshes) -> np.ndarray:
    """Indices (triangle,) of the triangles that meet all criteria but the boxes, which may cut them.

    Raises GeometryFault if there are none.
    """
    mesh = meshes[face.part]
    chosen = np.asarray(mesh.area_faces) > 0
    for selection in face.selections:
        match selection:
            case Facing():
                chosen = chosen & (mesh.face_normals @ np.array(selection.axis) > np.cos(selection.angle))
            case Triangles():
                chosen = chosen & _by_index(face, mesh, selection)
            case Picked():
                chosen = chosen & _by_function(face, mesh, selection)
            case Brep():
                chosen = chosen & _by_brep(face, mesh, selection)
            case Cylinder() | Largest():
                chosen = chosen & _by_kind(face, mesh, selection)
            case Near():
                chosen = chosen & _by_nearness(face, meshes, selection)
    if not chosen.any():
        raise GeometryFault(f"face {face} has no triangles; choose another direction or selection")
    return np.flatnonzero(chosen)


def _by_index(face: Face, mesh: trimesh.Trimesh, selection: Triangles) -> np.ndarray:
    indices = np.asarray(selection.indices, dtype=int)
    if indices.size and not (0 <= indices.min() and indices.max() < len(mesh.faces)):
        raise GeometryFault(f"face {face}: triangle indices must lie between 0 and {len(mesh.faces) - 1}")
    return np.isin(np.arange(len(mesh.faces)), indices)


def _by_function(face: Face, mesh: trimesh.Trimesh, selection: Picked) -> np.ndarray:
    try:
        chosen = np.asarray(selection.function(mesh.triangles_center, mesh.face_normals))
    except Exception as error:  # a user's function may raise anything; it becomes a fault of the model
        raise GeometryFault(f"face {face}: its function failed with {type(error).__name__}: {error}") from error
    if chosen.shape != (len(mesh.faces),) or chosen.dtype != bool:
        raise GeometryFault(
            f"face {face}: its function returned an array of shape {chosen.shape} and type {chosen.dtype}; "
            f"expected one True or False per triangle, shape ({len(mesh.faces)},)"
        )
    return np.asarray(chosen)


def _breps(face: Face, mesh: trimesh.Trimesh) -> np.ndarray:
    """The B-rep face of each triangle, from 0."""
    brep = mesh.face_attributes.get(BREP)
    if brep is None:
        raise GeometryFault(f"face {face}: its part is not a STEP file, so it has no B-rep faces; use another criterion")
    return np.asarray(brep).ravel()


def _by_kind(face: Face, mesh: trimesh.Trimesh, selection: Cylinder | Largest) -> np.ndarray:
    number_of, _ = numbered(mesh)
    known = described(mesh)
    if isinstance(selection, Cylinder):
        radius, inner = selection.radius, selection.inner
        found = [
            each
            for each in known
            if each.kind == "cylinder" and each.radius is not None and inner in (None, each.is_inner)
            and (radius is None or abs(each.radius - radius) <= SAME_SIZE * radius + each.residual)
        ]  # fmt: skip
    else:
        found = [each for each in known if each.kind == selection.kind and _is_along(each, selection.axis)]
        found = sorted(found, key=lambda each: each.area)[-1:]
    if not found:
        kinds = "; ".join(f"{each}" for each in known[:SHOWN]) + ("; ..." if len(known) > SHOWN else "")
        raise GeometryFault(f"face {face}: the part has no such face; its {len(known)} faces are: {kinds}")
    return np.isin(number_of, [each.number - 1 for each in found])


def _is_along(face: FaceInFile, direction: Vector | None) -> bool:
    """Whether a face looks in a direction, or has its axis along it, whichever way; any does, if there is none."""
    if direction is None or face.direction is None:
        return direction is None
    cosine = float(np.dot(face.direction, direction))
    return (cosine if face.kind == "plane" else abs(cosine)) > math.cos(FACE_ANGLE)


def _by_brep(face: Face, mesh: trimesh.Trimesh, selection: Brep) -> np.ndarray:
    brep = _breps(face, mesh)
    if selection.name is not None:
        names = mesh.metadata[FACE_NAMES]
        if selection.name not in names:
            known = ", ".join(f'"{shown(name)}"' for name in [name for name in dict.fromkeys(names) if name][:SHOWN])
            has = f"its faces are called {known}" if known else "its file gives no face of it a name"
            more = ", ...; tolcontact faces lists them" if len(set(names) - {""}) > SHOWN else ""
            raise GeometryFault(f"face {face}: the part has no such face; {has}{more}")
        return np.isin(brep, np.flatnonzero(np.array(names) == selection.name))
    if selection.at is None:
        count = len(mesh.metadata[SURFACES])
        if selection.number is None or not 1 <= selection.number <= count:
            raise GeometryFault(f"face {face}: the part has faces 1 to {count}; tolcontact faces lists them")
        return np.asarray(brep == selection.number - 1)
    point = np.tile(selection.at, (len(brep), 1))
    distance = np.linalg.norm(trimesh.triangles.closest_point(mesh.triangles, point) - point, axis=1)
    if distance.min() > BREP_REACH * mesh.scale:
        raise GeometryFault(
            f"face {face}: the point is {distance.min():.4g} mm away from the part, which spans {_span(mesh)}; "
            "give a point on the face"
        )
    chosen = np.unique(brep[distance < distance.min() + CUT_MARGIN * mesh.scale])
    if len(chosen) > 1:
        raise GeometryFault(f"face {face}: the point lies where {len(chosen)} faces meet; give a point inside one of them")
    return np.asarray(brep == chosen[0])


def _by_nearness(face: Face, meshes: Meshes, selection: Near) -> np.ndarray:
    own, other = (_in_place(part, meshes[part]) for part in (face.part, selection.part))
    chosen = np.zeros(len(own.faces), dtype=bool)
    # Seen from both sides, since either part may be small beside the other.
    for seen, by in ((own, other), (other, own)):
        step = max(selection.within, seen.scale / NEAR_STATIONS)
        vertices, faces, origin = trimesh.remesh.subdivide_to_size(
            seen.vertices, seen.faces, max_edge=step, max_iter=30, return_index=True
        )
        fine = trimesh.Trimesh(vertices, faces, process=False)
        hit, nearest = Surface(by).nearest(fine.triangles_center)
        looks_at = (fine.face_normals * np.asarray(by.face_normals)[hit]).sum(axis=1) < LOOKS_AT
        near = looks_at & (np.linalg.norm(fine.triangles_center - nearest, axis=1) <= selection.within)
        chosen[(origin if seen is own else hit)[near]] = True
    # A flat face is one thing, however it is cut into triangles.
    flat = np.asarray(own.face_adjacency)[np.asarray(own.face_adjacency_angles) < FLAT]
    face_of = trimesh.graph.connected_component_labels(flat, node_count=len(own.faces))
    return np.asarray(np.isin(face_of, face_of[chosen]))


def _in_place(part: Part, mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    R = Rotation.from_rotvec(part.rotation).as_matrix()
    return trimesh.Trimesh(np.asarray(mesh.vertices) @ R.T + np.array(part.at), mesh.faces, process=False)


def _cut(own: Surface, box: Inside, margin: float) -> Surface:
    vertices, faces = sliced(np.asarray(own.mesh.vertices), np.asarray(own.mesh.faces), box, margin)
    cut = trimesh.Trimesh(vertices, faces, process=False)
    cut.merge_vertices()
    cut.update_faces(cut.area_faces > 0)
    cut.remove_unreferenced_vertices()
    if len(cut.faces) == 0:
        return Surface(cut, np.zeros((0, 3, 3)))
    # A cut does not change the face: the normals are still those of the whole, also where its triangles end now.
    origin, _ = own.nearest(cut.triangles_center)
    normals = np.stack([own.normals(origin, cut.triangles[:, k]) for k in range(3)], axis=1)
    return Surface(cut, normals, own.surfaces, own.surface_numbers[origin])


def sliced(vertices: np.ndarray, faces: np.ndarray, box: Inside, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """What of triangles, vertices (vertex, 3) [mm] and faces (face, 3), lies in a box that is larger by `margin` [mm]."""
    for corner, inward in ((box.lower, 1.0), (box.upper, -1.0)):
        for axis in np.eye(3):
            origin = np.array(corner) - inward * margin * axis
            vertices, faces, _ = trimesh.intersections.slice_faces_plane(vertices, faces, inward * axis, origin)
    return vertices, faces


def _double(own: trimesh.Trimesh) -> int:
    """How many pairs of triangles have the same corners and opposite normals."""
    _, alike = trimesh.grouping.unique_rows(np.sort(own.faces, axis=1))
    times = np.bincount(alike)
    total = np.stack([np.bincount(alike, component) for component in np.asarray(own.face_normals).T], axis=1)
    return int(((times > 1) & (np.linalg.norm(total, axis=1) < times - 0.5)).sum())


def _span(mesh: trimesh.Trimesh) -> str:
    lower, upper = ("({})".format(", ".join(f"{c:g}" for c in corner)) for corner in mesh.bounds)
    return f"{lower} to {upper}"
