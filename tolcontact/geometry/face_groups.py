"""Faces that belong together: interrupted surfaces, slots, and patterns of equal holes. Part's own frame, lengths in mm.

A cylinder or cone interrupted by keyways, slots or splines is one surface, although its faces do not touch, if they overlap
along the axis and there is no material between them on the surface. So a bore with two keyways is one hole; holes in two lugs
are two holes, and walls of curved slots around one axis remain separate.
A slot has two parallel planes that face each other, and two hollow cylinders of one radius as its ends, tangent to both planes.
The holes of a pattern are cylinders of one radius with parallel axes that span more than half a turn each.
"""

import itertools
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import trimesh

from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Cone, Cylinder, axes_across, azimuths
from tolcontact.geometry.body_overlap import SolidBody
from tolcontact.geometry.face_in_file import FaceInFile
from tolcontact.geometry.tolerances import RESIDUALS, SAME_PLACE, SQUARE

MARGIN = 1e-5  # of a part's size: difference of lengths that count as equal
MAX_HOLE_GAP = 3.0  # [rad] around the axis: the end of a slot has a gap of pi
MIN_COMMON_SHARE = 0.5  # of the shorter face of an interrupted surface along the axis
DIRECTIONS = 360  # samples around the axis
CHORD_FACTOR = 2.0  # times the height of the surface over its triangles

FaceOnSurface = tuple[AnalyticSurface | None, np.ndarray]  # a surface, if one is known, and the triangles (face,) on it
SameSurface = Callable[[FaceOnSurface, FaceOnSurface], bool]
Group = tuple[int, ...]


def interruptions(
    mesh: trimesh.Trimesh, faces: Sequence[FaceOnSurface], label: np.ndarray, is_same: SameSurface
) -> Iterator[tuple[int, int]]:
    """Yield pairs of indices of faces that form one interrupted cylinder or cone.

    label     (face,) equal for faces that touch and already form one surface
    is_same   whether two faces are parts of one surface
    """
    firsts = [int(number) for number in np.unique(label, return_index=True)[1]]
    candidates = [(number, faces[number][0]) for number in firsts if len(faces[number][1])]
    round_faces = [(number, surface) for number, surface in candidates if isinstance(surface, Cylinder | Cone)]
    body = SolidBody(mesh)
    margin = SAME_PLACE * float(mesh.scale)
    for (first, surface), (second, neighbour) in itertools.combinations(round_faces, 2):
        if _may_be_one(surface, neighbour, margin) and is_same(faces[first], faces[second]) and body.is_closed:
            parts = [
                np.concatenate([faces[int(member)][1] for member in np.flatnonzero(label == label[number])])
                for number in (first, second)
            ]
            if _is_interrupted(body, surface, parts, margin):
                yield first, second


def _may_be_one(surface: AnalyticSurface, neighbour: AnalyticSurface, margin: float) -> bool:
    """Return whether two surfaces may be one: same kind, same size, same axis; a quick check."""
    if surface.kind != neighbour.kind or abs(surface.radius - neighbour.radius) > 1e3 * margin:
        return False
    return bool(np.linalg.norm(np.cross(neighbour.origin - surface.origin, surface.axis)) < 1e3 * margin)


def _is_interrupted(body: SolidBody, surface: Cylinder | Cone, parts: Sequence[np.ndarray], margin: float) -> bool:
    """Return whether two parts of a surface, the triangles (face,) of each, overlap along its axis without material between."""
    corners = [np.asarray(body.mesh.triangles)[triangles].reshape(-1, 3) for triangles in parts]
    (start, end), (next_start, next_end) = map(surface.extent, corners)
    lower, upper = max(start, next_start), min(end, next_end)
    if upper - lower < MIN_COMMON_SHARE * min(end - start, next_end - next_start):
        return False
    middle = (lower + upper) / 2
    radius = surface.radius if isinstance(surface, Cylinder) else abs(middle) * np.tan(surface.angle)
    across = axes_across(surface.axis)
    angles = np.linspace(0, 2 * np.pi, DIRECTIONS, endpoint=False)
    circle = surface.origin + middle * surface.axis + radius * np.column_stack([np.cos(angles), np.sin(angles)]) @ across
    middles = np.concatenate(
        [(points.reshape(-1, 3, 3) + np.roll(points.reshape(-1, 3, 3), 1, axis=1)) / 2 for points in corners]
    )
    chord = float(np.abs(surface.distance(middles.reshape(-1, 3))[0]).max())
    return bool((body.depth(circle) < CHORD_FACTOR * chord + margin).all())


def hollow_cylinders(faces: Sequence[FaceInFile], surfaces: Sequence[FaceOnSurface]) -> dict[Group, Cylinder]:
    """Return the hollow cylinders of a part by their face numbers, from descriptions that include whole surfaces."""
    return {
        _whole(face): surface
        for face, (surface, triangles) in zip(faces, surfaces, strict=True)
        if isinstance(surface, Cylinder) and face.is_inner and len(triangles)
    }


def slots(faces: Sequence[FaceInFile], cylinders: Mapping[Group, Cylinder], touching: np.ndarray, margin: float) -> list[Group]:
    """Return the face numbers, from 1, of each slot; `touching` (pair, 2) are the indices of faces that share an edge.

    Lengths that differ by less than a `margin` [mm] are equal.
    """
    ends_of: dict[Group, set[Group]] = defaultdict(set)  # the cylinders that touch a plane and are tangent to it
    for number, neighbour in (*touching, *touching[:, ::-1]):
        plane, end = faces[number], _whole(faces[neighbour])
        if plane.kind == "plane" and end in cylinders and _is_tangent(cylinders[end], plane, margin):
            ends_of[_whole(plane)].add(end)
    walls: dict[tuple[Group, Group], list[Group]] = defaultdict(list)  # of the two ends of a slot
    for plane_numbers, ends in ends_of.items():
        for pair in itertools.combinations(sorted(ends), 2):
            left, right = (cylinders[end] for end in pair)
            is_coaxial = np.linalg.norm(np.cross(right.origin - left.origin, left.axis)) < margin
            if _are_equal(left, right, margin) and not is_coaxial:
                walls[pair].append(plane_numbers)
    normals = {_whole(face): np.array(face.direction) for face in reversed(faces) if face.kind == "plane"}
    return [
        tuple(sorted(itertools.chain(*pair, *planes)))
        for pair, planes in walls.items()
        if any(np.linalg.norm(normals[left] + normals[right]) < SQUARE for left, right in itertools.combinations(planes, 2))
    ]


def patterns(
    mesh: trimesh.Trimesh, cylinders: Mapping[Group, Cylinder], surfaces: Sequence[FaceOnSurface], margin: float
) -> list[Group]:
    """Return the face numbers, from 1, of each pattern of at least two holes, whose radii differ by less than a margin [mm]."""
    holes: list[list[Group]] = []
    for numbers, hole in cylinders.items():
        members = np.concatenate([surfaces[number - 1][1] for number in numbers])
        vertices = np.asarray(mesh.vertices)[np.unique(np.asarray(mesh.faces)[members])]
        _, gaps = azimuths(vertices - hole.origin, *axes_across(hole.axis))
        if gaps.max() < MAX_HOLE_GAP:
            pattern = next((others for others in holes if _are_equal(cylinders[others[0]], hole, margin)), None)
            holes.append([numbers]) if pattern is None else pattern.append(numbers)
    return [tuple(sorted(itertools.chain(*pattern))) for pattern in holes if len(pattern) > 1]


def _whole(face: FaceInFile) -> Group:
    """Return the face numbers of the whole surface of a face."""
    return face.whole or (face.number,)


def _are_equal(left: Cylinder, right: Cylinder, margin: float) -> bool:
    """Return whether two cylinders have the same radius, and parallel axes."""
    difference, tilt = abs(left.radius - right.radius), float(np.linalg.norm(np.cross(left.axis, right.axis)))
    return difference < margin + RESIDUALS * (left.residual + right.residual) and tilt < SQUARE


def _is_tangent(cylinder: Cylinder, plane: FaceInFile, margin: float) -> bool:
    """Return whether a plane that faces the axis is tangent to a cylinder."""
    normal = np.array(plane.direction)
    height = float((cylinder.origin - np.array(plane.point)) @ normal)
    is_parallel = abs(float(cylinder.axis @ normal)) < SQUARE
    return is_parallel and abs(height - cylinder.radius) < margin + RESIDUALS * cylinder.residual
