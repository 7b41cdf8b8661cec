"""The surfaces of a part that the records of PMI mean: B-rep faces of one surface together. Part's own frame, mm."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import trimesh

from tolcontact.declaration.values import Vector
from tolcontact.geometry.brep_face import FaceInFile, FaceOnSurface, are_one_surface, describe_faces, faces_on_surfaces
from tolcontact.geometry.files import BREP, FACE_RECORDS

MAX_OPPOSED_ERROR = 1e-3  # [rad] between two planes that count as parallel
MAX_DISTANCE, SAME_DISTANCE = 1e-3, 1e-9  # of a part's size: of a point from its face, and between faces that meet in it
_ROUND = ("cylinder", "cone", "sphere", "torus")


class TolerancedSurfaces:
    """The surfaces of a part, found by the numbers of the records of their faces.

    faces   the faces of the part, by their numbers less 1
    """

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self._mesh = mesh
        self._numbers = {record: number for number, record in enumerate(mesh.metadata[FACE_RECORDS], start=1) if record}
        self._surfaces: Sequence[FaceOnSurface] = faces_on_surfaces(mesh)
        self.faces: Sequence[FaceInFile] = describe_faces(mesh)

    def numbers(self, records: Iterable[int]) -> list[int]:
        """Return the numbers of the faces that some records are, without those that are not on this part."""
        return [self._numbers[record] for record in records if record in self._numbers]

    def numbers_at(self, points: Iterable[Vector]) -> Iterator[int]:
        """Yield the numbers of the faces on which points lie, for those that lie on one face alone."""
        brep = np.asarray(self._mesh.face_attributes[BREP]).ravel()
        for point in points:
            places = np.tile(point, (len(brep), 1))
            distances = np.linalg.norm(trimesh.triangles.closest_point(self._mesh.triangles, places) - places, axis=1)
            hits = np.unique(brep[distances < distances.min() + SAME_DISTANCE * self._mesh.scale])
            if len(hits) == 1 and distances.min() < MAX_DISTANCE * self._mesh.scale:
                yield int(hits[0]) + 1

    def surfaces(self, numbers: Iterable[int]) -> list[frozenset[int]]:
        """Return the surfaces that some faces make up, each with all of its faces.

        Planes are one surface if they lie in one plane. A round face stands for the whole surface around its axis.
        """
        remaining = list(dict.fromkeys(number for stated in numbers for number in self._whole(stated)))
        surfaces = []
        while remaining:
            first = self._surfaces[remaining[0] - 1]
            members = [n for n in remaining if n == remaining[0] or are_one_surface(self._mesh, first, self._surfaces[n - 1])]
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

    def _whole(self, number: int) -> Iterator[int]:
        face = self.faces[number - 1]
        yield number
        if face.kind in _ROUND:
            yield from face.whole
