"""Descriptions of the faces of a body, and faces that belong together: interrupted surfaces, slots and hole patterns.

A cylinder or cone interrupted by keyways, slots or splines is one surface, although its faces do not touch, if they overlap
along the axis and there is no material between them on the surface. So a bore with two keyways is one hole; holes in two lugs
are two holes, and walls of curved slots around one axis remain separate.
A slot has two parallel planes that face each other, and two hollow cylinders of one radius as its ends, tangent to both planes.
The holes of a pattern are cylinders of one radius with parallel axes that span more than half a turn each.
All is in the part's own frame, lengths in mm.
"""

import itertools
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import trimesh

from tolcontact.declaration.selection import FACE_GROUPS
from tolcontact.declaration.values import Vector
from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Cone, Cylinder, axes_across, azimuths
from tolcontact.geometry.body_overlap import SolidBody
from tolcontact.geometry.tolerances import RESIDUALS, ROUNDING, SAME_PLACE, SQUARE
from tolcontact.readable import Readable
from tolcontact.texts import shown_name

GENERAL = "general"  # kind of a face without an analytic surface
MARGIN = 1e-5  # of a part's size: difference of lengths that count as equal
MAX_HOLE_GAP = 3.0  # [rad] around the axis: the end of a slot has a gap of pi
MIN_COMMON_SHARE = 0.5  # of the shorter face of an interrupted surface along the axis
DIRECTIONS = 360  # samples around the axis
CHORD_FACTOR = 2.0  # times the height of the surface over its triangles

FaceOnSurface = tuple[AnalyticSurface | None, np.ndarray]  # a surface, if one is known, and the triangles (face,) on it
Group = tuple[int, ...]


@dataclass(frozen=True, repr=False)
class FaceInFile(Readable):
    """A face of a body, in the body's own frame.

    number      from 1 in the file's order, for `tc.select.Brep`
    kind        plane, cylinder, cone, sphere, torus, or "general"
    point       a point on the face [mm]
    direction   outward normal of a plane; axis of a cylinder, cone or torus; otherwise None
    radius      [mm] of a cylinder or sphere, or of the circle inside a torus; otherwise None
    is_inner    whether a round face is hollow: its outside is towards its axis or centre
    centre      the projection of `point` on its axis, or the centre of a sphere or torus [mm]; otherwise None
    area        [mm2]; of its triangles, if the file contains only triangles
    residual    [mm] largest distance of its vertices from a fitted surface; 0 if the file states the surface
    name        its name in the file, not necessarily unique; empty if it has none
    whole       face numbers of its whole surface, including its own; empty if it is the only face
    slot        face numbers of its slot; empty if there is none
    pattern     face numbers of its pattern of equal holes; empty if there is none
    copies      number of other faces in the same position, which have no numbers of their own
    """

    number: int
    kind: str
    point: Vector
    direction: Vector | None
    radius: float | None
    is_inner: bool
    area: float
    centre: Vector | None = None
    residual: float = 0.0
    name: str = ""
    whole: tuple[int, ...] = ()
    slot: tuple[int, ...] = ()
    pattern: tuple[int, ...] = ()
    copies: int = 0

    def __str__(self) -> str:
        name = f'"{shown_name(self.name)}", ' if self.name else ""
        entries = [f"{self.number}. {name}{'inner ' if self.is_inner else ''}{self.kind}"]
        if self.radius is not None:
            entries.append(f"radius {self.radius:.6g} mm")
        if self.centre is not None:
            entries.append(f"{'centre' if self.kind == 'sphere' else 'axis through'} {_numbers(self.centre)}")
        if self.direction is not None:
            entries.append(f"along {_numbers(self.direction)}")
        if self.residual:
            entries.append(f"fitted within {self.residual:.1g} mm")
        if self.whole:
            neighbours = ", ".join(str(number) for number in self.whole if number != self.number)
            entries.append(f"one surface with {neighbours}")
        if self.copies:
            entries.append(f"occurs {self.copies + 1} times in the file")
        return ", ".join([*entries, f"{self.area:.4g} mm2", "at ({:.4g}, {:.4g}, {:.4g})".format(*self.point)])


def _numbers(vector: Vector) -> str:
    return "({:.7g}, {:.7g}, {:.7g})".format(*(round(c, 6) + 0.0 for c in vector))


def group_lines(faces: Sequence[FaceInFile]) -> Iterator[str]:
    """Yield a line for each slot and each hole pattern among the faces of a part, with the code that selects it."""
    for word in FACE_GROUPS:
        for group in dict.fromkeys(getattr(face, word) for face in faces):
            if group:
                yield f'{_title(word, group, faces)}: tc.select.Brep({group[0]}, whole="{word}")'


def _title(word: str, group: tuple[int, ...], faces: Sequence[FaceInFile]) -> str:
    members = [faces[number - 1] for number in group]
    radius = next(face.radius for face in members if face.radius is not None)
    if word == "slot":
        return f"slot, radius {radius:.6g} mm, faces {', '.join(map(str, group))}"
    holes = list(dict.fromkeys(map(_whole, members)))
    listed = "; ".join(" and ".join(map(str, hole)) for hole in holes)
    return f"pattern of {len(holes)} holes, radius {radius:.6g} mm, faces {listed}"


def grouped(
    mesh: trimesh.Trimesh, face_of: np.ndarray, faces: Sequence[FaceInFile], surfaces: Sequence[FaceOnSurface]
) -> list[FaceInFile]:
    """Return the descriptions of B-rep faces with their whole surfaces, slots and patterns.

    `face_of` (triangle,) is the index of each triangle's face.
    """
    neighbours = face_of[np.asarray(mesh.face_adjacency).reshape(-1, 2)]
    touching = np.unique(np.sort(neighbours[neighbours[:, 0] != neighbours[:, 1]], axis=1), axis=0)
    wholes = _wholes(mesh, touching, surfaces)
    faces = [replace(face, whole=whole) for face, whole in zip(faces, wholes, strict=True)]
    cylinders = {
        _whole(face): surface
        for face, (surface, triangles) in zip(faces, surfaces, strict=True)
        if isinstance(surface, Cylinder) and face.is_inner and len(triangles)
    }
    margin = MARGIN * float(mesh.scale)
    slot_of = {number: slot for slot in _slots(faces, cylinders, touching, margin) for number in slot}
    pattern_of = {number: pattern for pattern in _patterns(mesh, cylinders, surfaces, margin) for number in pattern}
    return [replace(face, slot=slot_of.get(face.number, ()), pattern=pattern_of.get(face.number, ())) for face in faces]


def _wholes(mesh: trimesh.Trimesh, touching: np.ndarray, faces: Sequence[FaceOnSurface]) -> Iterator[tuple[int, ...]]:
    """Yield for each B-rep face the face numbers of its whole surface; none if it is the only face of its surface.

    Such faces touch, as listed in `touching` (pair, 2), or belong to an interrupted cylinder or cone.
    """
    links = [pair for pair in touching if are_one_surface(mesh, *(faces[number] for number in pair))]
    label = _components(links, len(faces))
    links += _interruptions(mesh, faces, label)
    label = _components(links, len(faces))
    for number in label:
        members = tuple(int(member) + 1 for member in np.flatnonzero(label == number))
        yield members if len(members) > 1 else ()


def _components(links: Sequence[Sequence[int]], count: int) -> np.ndarray:
    """Return the connected component (node,) of each of `count` nodes that pairs in `links` join."""
    return np.asarray(
        trimesh.graph.connected_component_labels(np.array(links, dtype=np.int64).reshape(-1, 2), node_count=count)
    )


def are_one_surface(mesh: trimesh.Trimesh, face: FaceOnSurface, neighbour: FaceOnSurface) -> bool:
    """Return whether two faces are parts of one surface, with their outside on the same side of it."""
    (surface, triangles), (next_surface, next_triangles) = face, neighbour
    if surface is None or next_surface is None or surface.kind != next_surface.kind:
        return False
    if surface.is_fitted != next_surface.is_fitted:
        return False
    if _is_outside(mesh, surface, triangles) != _is_outside(mesh, surface, next_triangles):
        return False
    vertices = np.asarray(mesh.vertices)[np.unique(np.asarray(mesh.faces)[next_triangles])]
    distance = float(np.abs(surface.distance(vertices)[0]).max())
    return distance <= RESIDUALS * (surface.residual + next_surface.residual) + ROUNDING * float(mesh.scale)


def _is_outside(mesh: trimesh.Trimesh, surface: AnalyticSurface, triangles: np.ndarray) -> bool:
    """Return whether triangles (face,) have their outside on the outside of the surface."""
    _, slope = surface.distance(np.asarray(mesh.triangles_center)[triangles])
    return bool((slope * np.asarray(mesh.face_normals)[triangles]).sum() > 0)


def _interruptions(mesh: trimesh.Trimesh, faces: Sequence[FaceOnSurface], label: np.ndarray) -> Iterator[tuple[int, int]]:
    """Yield pairs of indices of faces that form one interrupted cylinder or cone.

    `label` (face,) is equal for faces that touch and already form one surface.
    """
    firsts = [int(number) for number in np.unique(label, return_index=True)[1]]
    candidates = [(number, faces[number][0]) for number in firsts if len(faces[number][1])]
    round_faces = [(number, surface) for number, surface in candidates if isinstance(surface, Cylinder | Cone)]
    body = SolidBody(mesh)
    margin = SAME_PLACE * float(mesh.scale)
    for (first, surface), (second, neighbour) in itertools.combinations(round_faces, 2):
        if _may_be_one(surface, neighbour, margin) and are_one_surface(mesh, faces[first], faces[second]) and body.is_closed:
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


def _slots(
    faces: Sequence[FaceInFile], cylinders: Mapping[Group, Cylinder], touching: np.ndarray, margin: float
) -> list[Group]:
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


def _patterns(
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
