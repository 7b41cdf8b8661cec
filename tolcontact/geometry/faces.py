"""Faces: the triangles of a part that meet all criteria of a face, as a surface, in the part's own frame. Lengths in mm."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import trimesh

from tolcontact.declaration import Brep, Cylinder, Face, Facing, Inside, Largest, Near, Part, Picked, Triangles
from tolcontact.declaration.selection import FACE_ANGLE
from tolcontact.declaration.values import Vector
from tolcontact.errors import GeometryFault
from tolcontact.geometry.brep_face import analytic_surfaces, describe_faces, faces_at, number_faces
from tolcontact.geometry.face_groups import FaceInFile, group_lines
from tolcontact.geometry.files import BREP, STATED_FACES
from tolcontact.geometry.shapes import placement_of
from tolcontact.geometry.surface import Surface
from tolcontact.geometry.tolerances import OPPOSING_COSINE, ROUNDING, SAME_SIZE
from tolcontact.geometry.triangle_mesh import have_area, overlaps, placed_mesh, subdivided
from tolcontact.texts import shown_name
from tolcontact.user_functions import FunctionError, called

NEAR_DIVISIONS = 100
CUT = 4  # refinement factor of the pieces of triangles in one step
BREP_REACH = 1e-3  # of the part's size: largest distance of a point from the B-rep face that it selects
FLAT_ANGLE = 2e-4  # rad: between neighbouring triangles of one flat face, after single precision
MAX_LISTED = 12  # faces in a message
MAX_COMPARISONS = 4_000_000  # of pieces with triangles: above this, a search for the nearest ones takes less time

Meshes = Mapping[Part, trimesh.Trimesh]
# By the meshes of a part and of its neighbour: which triangles of the part are near, for each pair of poses and distance.
_NEARNESS: WeakKeyDictionary[trimesh.Trimesh, WeakKeyDictionary[trimesh.Trimesh, dict[Any, np.ndarray]]] = WeakKeyDictionary()


class FaceArea(NamedTuple):
    """The area [mm^2] of a face: the area of its triangles (triangle,) in its part's mesh that lies inside all boxes."""

    triangles: np.ndarray
    boxes: tuple[Inside, ...]
    area: float

    def share(self, other: "FaceArea", mesh: trimesh.Trimesh) -> float:
        """Return the share of this area that another face of the same part also covers; `mesh` is the mesh of the part."""
        common = np.intersect1d(self.triangles, other.triangles)
        if not common.size:
            return 0.0
        if len(common) == len(self.triangles) and not other.boxes:
            return 1.0
        return _area(mesh, common, (*self.boxes, *other.boxes)) / self.area


def face_area(face: Face, meshes: Meshes) -> FaceArea:
    """Return the area of a face. Raises GeometryFault if it has no triangles."""
    boxes = tuple(selection for selection in face.selections if isinstance(selection, Inside))
    indices = triangles(face, meshes)
    return FaceArea(indices, boxes, _area(meshes[face.part], indices, boxes))


def _area(mesh: trimesh.Trimesh, indices: np.ndarray, boxes: Sequence[Inside]) -> float:
    if not boxes:
        return float(np.asarray(mesh.area_faces)[indices].sum())
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)[indices]
    for box in boxes:
        if len(faces):
            vertices, faces = _sliced(vertices, faces, box, ROUNDING * mesh.scale)
    return float(trimesh.triangles.area(vertices[faces]).sum()) if len(faces) else 0.0


def patch(face: Face, meshes: Meshes) -> Surface:
    """Return the surface of a face. `meshes` contains the mesh of each part in that part's own frame.

    Raises GeometryFault if the face is empty, or if its outside is undefined.
    """
    mesh = meshes[face.part]
    indices = triangles(face, meshes)
    used, faces = np.unique(mesh.faces[indices], return_inverse=True)
    surfaces, surface_numbers = analytic_surfaces(mesh, indices)
    face_mesh = trimesh.Trimesh(mesh.vertices[used], faces.reshape(-1, 3), process=False)
    surface = Surface(face_mesh, None, surfaces, surface_numbers)
    for selection in face.selections:
        if isinstance(selection, Inside):
            surface = _cut(surface, selection, ROUNDING * mesh.scale)
            if len(surface.mesh.faces) == 0:
                raise GeometryFault(f"face {face}: nothing of it lies in that box; the part spans {_span(mesh)}")
    if sheets := _opposite_pairs(surface.mesh):
        raise GeometryFault(
            f"face {face}: {sheets} pairs of coincident triangles point opposite ways, so the outside is undefined; "
            "remove one of the two sheets, or choose a direction"
        )
    return surface


def triangles(face: Face, meshes: Meshes) -> np.ndarray:
    """Return the indices (triangle,) of the triangles that meet all criteria except boxes, which may cut triangles.

    Raises GeometryFault if there are none.
    """
    mesh = meshes[face.part]
    mask = have_area(mesh)
    for selection in face.selections:
        match selection:
            case Facing():
                mask = mask & (mesh.face_normals @ np.array(selection.axis) > np.cos(selection.angle))
            case Triangles():
                mask = mask & _by_index(face, mesh, selection)
            case Picked():
                mask = mask & _by_function(face, mesh, selection)
            case Brep():
                mask = mask & _by_brep(face, mesh, selection)
            case Cylinder() | Largest():
                mask = mask & _by_kind(face, mesh, selection)
            case Near():
                mask = mask & _by_nearness(face, meshes, selection)
    if not mask.any():
        raise GeometryFault(f"face {face} has no triangles; choose another direction or selection")
    return np.flatnonzero(mask)


def _by_index(face: Face, mesh: trimesh.Trimesh, selection: Triangles) -> np.ndarray:
    indices = np.asarray(selection.indices, dtype=int)
    if indices.size and not (0 <= indices.min() and indices.max() < len(mesh.faces)):
        raise GeometryFault(f"face {face}: triangle indices must lie between 0 and {len(mesh.faces) - 1}")
    return np.isin(np.arange(len(mesh.faces)), indices)


def _by_function(face: Face, mesh: trimesh.Trimesh, selection: Picked) -> np.ndarray:
    try:
        mask = called(lambda: np.asarray(selection.function(mesh.triangles_center, mesh.face_normals)))
    except FunctionError as error:
        raise GeometryFault(f"face {face}: its function {error}") from error
    if mask.shape != (len(mesh.faces),) or mask.dtype != bool:
        raise GeometryFault(
            f"face {face}: its function returned an array of shape {mask.shape} and type {mask.dtype}; "
            f"expected one True or False per triangle, shape ({len(mesh.faces)},)"
        )
    return mask


def _by_kind(face: Face, mesh: trimesh.Trimesh, selection: Cylinder | Largest) -> np.ndarray:
    face_of, _ = number_faces(mesh)
    faces = describe_faces(mesh)
    if isinstance(selection, Cylinder):
        hits = [candidate for candidate in faces if _is_cylinder(candidate, selection)]
    else:
        hits = [candidate for candidate in faces if candidate.kind == selection.kind and _is_along(candidate, selection.axis)]
        hits = sorted(hits, key=lambda hit: hit.area)[-1:]
    if not hits:
        listed = "; ".join(f"{candidate}" for candidate in faces[:MAX_LISTED]) + ("; ..." if len(faces) > MAX_LISTED else "")
        raise GeometryFault(f"face {face}: the part has no such face; its {len(faces)} faces are: {listed}")
    return np.isin(face_of, [hit.number - 1 for hit in hits])


def _is_cylinder(face: FaceInFile, selection: Cylinder) -> bool:
    """Return whether a face is a cylinder with the required radius and side."""
    if face.kind != "cylinder" or face.radius is None or selection.inner not in (None, face.is_inner):
        return False
    radius = selection.radius
    return radius is None or abs(face.radius - radius) <= SAME_SIZE * radius + face.residual


def _is_along(face: FaceInFile, direction: Vector | None) -> bool:
    """Return whether a plane faces a direction, or an axis is parallel to it; True if no direction is required."""
    if direction is None or face.direction is None:
        return direction is None
    cosine = float(np.dot(face.direction, direction))
    return (cosine if face.kind == "plane" else abs(cosine)) > math.cos(FACE_ANGLE)


def _by_brep(face: Face, mesh: trimesh.Trimesh, selection: Brep) -> np.ndarray:
    if BREP not in mesh.face_attributes:
        raise GeometryFault(f"face {face}: its part is not a STEP file, so it has no B-rep faces; use another criterion")
    brep = np.asarray(mesh.face_attributes[BREP]).ravel()
    numbers = [number for which in selection.which for number in _brep_numbers(face, mesh, which)]
    if selection.whole:
        faces = describe_faces(mesh)
        numbers = [member - 1 for number in numbers for member in _group(face, faces, faces[number], selection.whole)]
    return np.isin(brep, numbers)


def _group(face: Face, faces: Sequence[FaceInFile], description: FaceInFile, whole: bool | str) -> tuple[int, ...]:
    """Return the face numbers of the surface, slot or hole pattern of a B-rep face. Raises GeometryFault if there is none."""
    if whole is True:
        return description.whole or (description.number,)
    if group := getattr(description, str(whole)):
        return group  # type: ignore[no-any-return]
    listed = "; ".join(line for line in group_lines(faces) if line.startswith(str(whole))) or "the part has none"
    raise GeometryFault(f"face {face}: B-rep face {description.number} belongs to no {whole}; {listed}")


def _brep_numbers(face: Face, mesh: trimesh.Trimesh, which: int | str | Vector) -> np.ndarray:
    """Return the indices of the B-rep faces that a number from 1, a name or a point selects."""
    if isinstance(which, str):
        return _by_name(face, [stated.name for stated in mesh.metadata[STATED_FACES]], which)
    if isinstance(which, tuple):
        return _by_point(face, mesh, which)
    count = len(mesh.metadata[STATED_FACES])
    if not 1 <= which <= count:
        raise GeometryFault(f"face {face}: the part has faces 1 to {count}; tolcontact faces lists them")
    return np.array([which - 1])


def _by_name(face: Face, names: Sequence[str], name: str) -> np.ndarray:
    if name not in names:
        distinct = [entry for entry in dict.fromkeys(names) if entry]
        listed = ", ".join(f'"{shown_name(entry)}"' for entry in distinct[:MAX_LISTED])
        content = f"its faces are called {listed}" if listed else "its file gives no face of it a name"
        more = ", ...; tolcontact faces lists them" if len(distinct) > MAX_LISTED else ""
        raise GeometryFault(f"face {face}: the part has no such face; {content}{more}")
    return np.flatnonzero(np.array(names) == name)


def _by_point(face: Face, mesh: trimesh.Trimesh, point: Vector) -> np.ndarray:
    numbers, distance = faces_at(mesh, point)
    if distance > BREP_REACH * mesh.scale:
        raise GeometryFault(
            f"face {face}: the point is {distance:.4g} mm away from the part, which spans {_span(mesh)}; "
            "give a point on the face"
        )
    if len(numbers) > 1:
        raise GeometryFault(f"face {face}: the point lies where {len(numbers)} faces meet; give a point inside one of them")
    return np.array(numbers) - 1


def _by_nearness(face: Face, meshes: Meshes, selection: Near) -> np.ndarray:
    """Return the mask of a selection. A model needs it several times, so it is cached for the lifetime of both meshes."""
    parts = face.part, selection.part
    masks = _NEARNESS.setdefault(meshes[face.part], WeakKeyDictionary()).setdefault(meshes[selection.part], {})
    key = (*((part.at, part.rotation, part.mirror) for part in parts), selection.within)
    if key not in masks:
        mesh, neighbour = (placed_mesh(meshes[part].vertices, meshes[part].faces, *placement_of(part)) for part in parts)
        masks[key] = _near_mask(mesh, neighbour, selection.within)
    return masks[key]


def _near_mask(mesh: trimesh.Trimesh, neighbour: trimesh.Trimesh, within: float) -> np.ndarray:
    mask = np.zeros(len(mesh.faces), dtype=bool)
    # A flat face is selected as a whole, however it is triangulated.
    flat = np.asarray(mesh.face_adjacency)[np.asarray(mesh.face_adjacency_angles) < FLAT_ANGLE]
    face_of = trimesh.graph.connected_component_labels(flat, node_count=len(mesh.faces))
    # Both are sampled, since either part may be small compared with the other.
    for sampled, target in ((mesh, neighbour), (neighbour, mesh)):
        origin, hit = _near_pieces(sampled, target, within, ~mask if target is mesh else np.ones(len(target.faces), dtype=bool))
        cosines = (np.asarray(sampled.face_normals)[origin] * np.asarray(target.face_normals)[hit]).sum(axis=1)
        mask[(origin if sampled is mesh else hit)[cosines < OPPOSING_COSINE]] = True
        mask = np.isin(face_of, face_of[mask])
    return mask


def _near_pieces(
    sampled: trimesh.Trimesh, target: trimesh.Trimesh, within: float, is_open: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return where the pieces of a mesh come close to a target: their triangle, and the nearest triangle of the target.

    Pieces are parts of triangles whose centres lie `within` [mm] of the target. Triangles are cut step by step. Each step first
    drops the pieces that are too far away, and the pieces that face no near triangle of the target marked in `is_open`
    (triangle,).
    """
    finest, surface = max(within, sampled.scale / NEAR_DIVISIONS), Surface(target)
    # Triangles outside this box are too far away.
    low, high = np.asarray(target.bounds) + within * np.array([[-1.0], [1.0]])
    corners = np.asarray(sampled.triangles)
    origin = np.flatnonzero(((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1))
    step, pieces = finest * CUT ** max(math.ceil(math.log(sampled.scale / finest, CUT)), 0), corners[origin]
    facing, reach = np.flatnonzero(is_open), within + ROUNDING * sampled.scale
    while True:
        promising = _facing_pieces(
            pieces, sampled.face_normals[origin], target.triangles[facing], target.face_normals[facing], reach
        )
        pieces, origin = pieces[promising], origin[promising]
        vertices, faces, piece_of = subdivided(pieces.reshape(-1, 3), np.arange(3 * len(pieces)).reshape(-1, 3), step)
        pieces, origin = vertices[faces], origin[piece_of]
        centres = pieces.mean(axis=1)
        hit, nearest = surface.nearest(centres)
        distance = np.linalg.norm(centres - nearest, axis=1)
        if step <= finest:
            is_near = distance <= within
            return origin[is_near], hit[is_near]
        radius = np.linalg.norm(pieces - centres[:, None], axis=2).max(axis=1)
        is_near = distance <= within + radius * (1 + ROUNDING)
        pieces, origin, step = pieces[is_near], origin[is_near], step / CUT


def _facing_pieces(
    pieces: np.ndarray, normals: np.ndarray, targets: np.ndarray, target_normals: np.ndarray, reach: float
) -> np.ndarray:
    """Return the indices of pieces (piece, 3, 3) with opposite triangles (triangle, 3, 3) whose boxes are within `reach` [mm].

    All pieces are returned if there are too many to compare.
    """
    lower, upper = pieces.min(axis=1), pieces.max(axis=1)
    low, high = targets.min(axis=1) - reach, targets.max(axis=1) + reach
    nearby = np.flatnonzero(
        ((low <= upper.max(axis=0, initial=-np.inf)) & (high >= lower.min(axis=0, initial=np.inf))).all(axis=1)
    )
    if len(pieces) * len(nearby) > MAX_COMPARISONS:
        return np.arange(len(pieces))
    are_opposing = normals @ target_normals[nearby].T < OPPOSING_COSINE + ROUNDING
    return np.flatnonzero((are_opposing & overlaps(lower, upper, low[nearby], high[nearby])).any(axis=1))


def _cut(surface: Surface, box: Inside, margin: float) -> Surface:
    vertices, faces = _sliced(surface.vertices, surface.faces, box, margin)
    cut = trimesh.Trimesh(vertices, faces, process=False)
    cut.merge_vertices()
    cut.update_faces(cut.area_faces > 0)
    cut.remove_unreferenced_vertices()
    if len(cut.faces) == 0:
        return Surface(cut, np.zeros((0, 3, 3)))
    # A cut does not change the face: it keeps the normals of the whole, even at its new boundary.
    origin, _ = surface.nearest(cut.triangles_center)
    normals = np.stack([surface.normals(origin, cut.triangles[:, k]) for k in range(3)], axis=1)
    return Surface(cut, normals, surface.surfaces, surface.surface_numbers[origin])


def _sliced(vertices: np.ndarray, faces: np.ndarray, box: Inside, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles, vertices (vertex, 3) [mm] and faces (face, 3), clipped by a box enlarged by `margin` [mm]."""
    for corner, inward in ((box.lower, 1.0), (box.upper, -1.0)):
        for axis in np.eye(3):
            origin = np.array(corner) - inward * margin * axis
            vertices, faces, _ = trimesh.intersections.slice_faces_plane(vertices, faces, inward * axis, origin)
    return vertices, faces


def _opposite_pairs(mesh: trimesh.Trimesh) -> int:
    """Return the number of pairs of triangles with the same corners and opposite normals."""
    _, label = trimesh.grouping.unique_rows(np.sort(mesh.faces, axis=1))
    times = np.bincount(label)
    total = np.stack([np.bincount(label, component) for component in np.asarray(mesh.face_normals).T], axis=1)
    return int(((times > 1) & (np.linalg.norm(total, axis=1) < times - 0.5)).sum())


def _span(mesh: trimesh.Trimesh) -> str:
    lower, upper = ("({})".format(", ".join(f"{c:g}" for c in corner)) for corner in mesh.bounds)
    return f"{lower} to {upper}"
