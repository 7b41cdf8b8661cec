"""The surfaces of a part that PMI records refer to: B-rep faces of one surface together. Part's own frame, mm."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from tolcontact.declaration.values import Vector
from tolcontact.geometry.brep_face import (
    are_one_surface,
    describe_faces,
    faces_at,
    faces_on_surfaces,
)
from tolcontact.geometry.face_groups import FaceOnSurface
from tolcontact.geometry.face_in_file import FaceInFile
from tolcontact.geometry.files import STATED_FACES, Shape

MAX_OPPOSED_ERROR = 1e-3  # [rad] between two planes that count as parallel
MAX_ANGLE = 0.01  # [rad] between directions of faces that may be parts of one surface: fitted ones differ by much less
MAX_DISTANCE = 1e-3  # of a part's size: from a point to its face
_ROUND = ("cylinder", "cone", "sphere", "torus")


class TolerancedSurfaces:
    """The surfaces of a part, by the record numbers of their faces.

    faces   the faces of the part, by their numbers less 1
    """

    def __init__(self, mesh: Shape) -> None:
        self._mesh = mesh
        self._numbers = {
            record: number for number, face in enumerate(mesh.metadata[STATED_FACES], start=1) for record in face.records
        }
        self._surfaces: Sequence[FaceOnSurface] = faces_on_surfaces(mesh)
        self.faces: Sequence[FaceInFile] = describe_faces(mesh)

    def numbers(self, records: Iterable[int]) -> list[int]:
        """Return the face indices of some records on this part."""
        return [self._numbers[record] for record in records if record in self._numbers]

    def number_at(self, point: Vector) -> int | None:
        """Return the index of the face of a point; None if it lies on none, or where faces meet."""
        numbers, distance = faces_at(self._mesh, point)
        return numbers[0] if len(numbers) == 1 and distance < MAX_DISTANCE * self._mesh.scale else None

    def surfaces(self, numbers: Iterable[int]) -> list[frozenset[int]]:
        """Return the surfaces that some faces make up, each with all of its faces.

        Planes are one surface if they lie in one plane. A round face represents the whole surface around its axis.
        """
        remaining = list(dict.fromkeys(number for stated in numbers for number in self._whole(stated)))
        surfaces = []
        while remaining:
            first = remaining[0]
            members = [number for number in remaining if number == first or self._are_one(first, number)]
            remaining = [number for number in remaining if number not in members]
            surfaces.append(frozenset(members))
        return surfaces

    def kind(self, surface: frozenset[int]) -> str:
        """Return the kind of a surface: plane, cylinder, cone, sphere, torus, or "general"."""
        return self.faces[min(surface) - 1].kind

    def normal(self, plane: frozenset[int]) -> np.ndarray:
        """Return the outward normal (3,) of a plane."""
        return np.array(self.faces[min(plane) - 1].direction)

    def are_opposed(self, surfaces: Sequence[frozenset[int]]) -> bool:
        """Return whether these are two planes with opposite normals."""
        if len(surfaces) != 2 or any(self.kind(surface) != "plane" for surface in surfaces):
            return False
        return bool(np.linalg.norm(self.normal(surfaces[0]) + self.normal(surfaces[1])) < MAX_OPPOSED_ERROR)

    def _are_one(self, number: int, other: int) -> bool:
        """Return whether two faces are parts of one surface. Most differ in their kind or direction."""
        face, next_face = self.faces[number - 1], self.faces[other - 1]
        if face.kind != next_face.kind or face.is_inner != next_face.is_inner:
            return False
        if face.direction and next_face.direction and np.linalg.norm(np.cross(face.direction, next_face.direction)) > MAX_ANGLE:
            return False
        return are_one_surface(self._mesh, self._surfaces[number - 1], self._surfaces[other - 1])

    def _whole(self, number: int) -> Iterator[int]:
        face = self.faces[number - 1]
        yield number
        if face.kind in _ROUND:
            yield from face.whole
