"""Faces that a drawing treats as one feature: slots, and patterns of equal holes. Part's own frame, lengths in mm.

A slot has two parallel planes that face each other, and two hollow cylinders of one radius as its ends, tangent to both planes.
The holes of a pattern are cylinders of one radius with parallel axes that span more than half a turn each.
"""

import itertools
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh

from tolcontact.declaration.selection import FACE_GROUPS
from tolcontact.geometry.analytic_surfaces import Cylinder
from tolcontact.geometry.face_in_file import FaceInFile
from tolcontact.geometry.interrupted_surfaces import FaceOnSurface

MAX_TILT = 1e-4  # [rad] between directions that count as parallel
MARGIN = 1e-5  # of a part's size: difference of lengths that count as equal
RESIDUAL_FACTOR = 10  # times the residual of a fitted cylinder: the same
MAX_HOLE_GAP = 3.0  # [rad] around the axis: the end of a slot has a gap of pi

Group = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class HollowCylinder:
    """A hollow cylinder of a part: its face numbers from 1, its surface, and the positions (point, 3) of its vertices."""

    numbers: Group
    surface: Cylinder
    vertices: np.ndarray

    @cached_property
    def is_hole(self) -> bool:
        """Whether it spans more than half a turn around its axis."""
        x, y = np.linalg.svd(self.surface.axis[None])[2][1:]
        offsets = self.vertices - self.surface.origin
        azimuths = np.sort(np.arctan2(offsets @ y, offsets @ x))
        return bool(np.diff(azimuths, append=azimuths[0] + 2 * np.pi).max() < MAX_HOLE_GAP)

    def equals(self, neighbour: "HollowCylinder", margin: float) -> bool:
        """Return whether another one has the same radius, and an axis parallel to this one."""
        difference = abs(self.surface.radius - neighbour.surface.radius)
        tilt = float(np.linalg.norm(np.cross(self.surface.axis, neighbour.surface.axis)))
        return difference < margin + RESIDUAL_FACTOR * (self.surface.residual + neighbour.surface.residual) and tilt < MAX_TILT

    def is_tangent(self, plane: FaceInFile, margin: float) -> bool:
        """Return whether a plane that faces the axis is tangent to the cylinder."""
        height = float((self.surface.origin - np.array(plane.point)) @ np.array(plane.direction))
        slack = margin + RESIDUAL_FACTOR * self.surface.residual
        is_parallel = abs(float(self.surface.axis @ np.array(plane.direction))) < MAX_TILT
        return is_parallel and abs(height - self.surface.radius) < slack


class FaceGroups:
    """The slots and the patterns of holes of a part.

    faces      descriptions, including their whole surfaces
    surfaces   the surface and the triangles of each face
    touching   (pair, 2) indices of faces that share an edge
    """

    def __init__(
        self, mesh: trimesh.Trimesh, faces: Sequence[FaceInFile], surfaces: Sequence[FaceOnSurface], touching: np.ndarray
    ) -> None:
        self._margin = MARGIN * float(mesh.scale)
        self._wholes = [face.whole or (face.number,) for face in faces]
        self._faces, self._touching = faces, touching
        self._cylinders = {
            whole: HollowCylinder(whole, surface, _vertices(mesh, surfaces, whole))
            for whole, face, (surface, triangles) in zip(self._wholes, faces, surfaces, strict=True)
            if isinstance(surface, Cylinder) and face.is_inner and len(triangles)
        }

    def slots(self) -> list[Group]:
        """Return the face numbers, from 1, of each slot."""
        walls: dict[tuple[Group, Group], list[Group]] = defaultdict(list)  # of the two ends of a slot
        for plane, ends in self._tangent_ends().items():
            for pair in itertools.combinations(sorted(ends), 2):
                left, right = (self._cylinders[end] for end in pair)
                if left.equals(right, self._margin) and not self._is_coaxial(left, right):
                    walls[pair].append(plane)
        return [
            tuple(sorted(itertools.chain(*pair, *planes)))
            for pair, planes in walls.items()
            if any(self._are_opposed(left, right) for left, right in itertools.combinations(planes, 2))
        ]

    def patterns(self) -> list[Group]:
        """Return the face numbers, from 1, of each pattern of at least two holes."""
        patterns: list[list[HollowCylinder]] = []
        for hole in self._cylinders.values():
            if hole.is_hole:
                pattern = next((members for members in patterns if members[0].equals(hole, self._margin)), None)
                patterns.append([hole]) if pattern is None else pattern.append(hole)
        return [tuple(sorted(itertools.chain(*(hole.numbers for hole in members)))) for members in patterns if len(members) > 1]

    def _tangent_ends(self) -> dict[Group, set[Group]]:
        """Return the hollow cylinders that touch each plane and are tangent to it."""
        ends: dict[Group, set[Group]] = defaultdict(set)
        for number, neighbour in (*self._touching, *self._touching[:, ::-1]):
            plane, end = self._faces[number], self._cylinders.get(self._wholes[neighbour])
            if plane.kind == "plane" and end is not None and end.is_tangent(plane, self._margin):
                ends[self._wholes[number]].add(end.numbers)
        return ends

    def _is_coaxial(self, left: HollowCylinder, right: HollowCylinder) -> bool:
        offset = right.surface.origin - left.surface.origin
        return bool(np.linalg.norm(np.cross(offset, left.surface.axis)) < self._margin)

    def _are_opposed(self, left: Group, right: Group) -> bool:
        normals = [np.array(self._faces[plane[0] - 1].direction) for plane in (left, right)]
        return bool(np.linalg.norm(normals[0] + normals[1]) < MAX_TILT)


def _vertices(mesh: trimesh.Trimesh, surfaces: Sequence[FaceOnSurface], numbers: Group) -> np.ndarray:
    """Return the positions (point, 3) of the vertices of faces."""
    triangles = np.concatenate([surfaces[number - 1][1] for number in numbers])
    return np.asarray(mesh.vertices)[np.unique(np.asarray(mesh.faces)[triangles])]


def group_lines(faces: Sequence[FaceInFile]) -> Iterator[str]:
    """Yield a line for each slot and each hole pattern among the faces of a part, with the code that selects it."""
    for word in FACE_GROUPS:
        for group in dict.fromkeys(getattr(face, word) for face in faces):
            if group:
                yield f'{_title(word, group, faces)}: tc.Brep({group[0]}, whole="{word}")'


def _title(word: str, group: Group, faces: Sequence[FaceInFile]) -> str:
    members = [faces[number - 1] for number in group]
    radius = next(face.radius for face in members if face.radius is not None)
    if word == "slot":
        return f"slot, radius {radius:.6g} mm, faces {', '.join(map(str, group))}"
    holes = list(dict.fromkeys(face.whole or (face.number,) for face in members))
    listed = "; ".join(" and ".join(map(str, hole)) for hole in holes)
    return f"pattern of {len(holes)} holes, radius {radius:.6g} mm, faces {listed}"
