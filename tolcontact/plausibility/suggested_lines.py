"""Lines of a script that a message suggests: they choose faces, and declare contact and overlaps."""

import keyword
import re
from typing import NamedTuple

import numpy as np

from tolcontact.declaration.values import DIRECTIONS, direction
from tolcontact.discretization import Nominal, NominalPart
from tolcontact.geometry.analytic_surfaces import Plane
from tolcontact.geometry.brep_face import number_faces
from tolcontact.geometry.files import BREP
from tolcontact.interference import Interference, Watch

SAME_DIRECTION = 1e-4  # of the cosine of an angle


class ClashPlace(NamedTuple):
    """A place where two bodies interfere.

    triangles   candidates of the mesh of each body: several at an edge and its ends
    position    (3,) [mm] in the nominal assembly
    """

    triangles: tuple[np.ndarray, np.ndarray]
    position: np.ndarray

    @classmethod
    def of(cls, watch: Watch, pair: tuple[int, int], interference: Interference, row: int) -> "ClashPlace":
        """Return the place of a realization."""
        sides = []
        for body, triangle in zip(pair, interference.triangles[row], strict=True):
            solid = watch.solid(body)
            assert solid is not None
            if triangle >= 0:
                numbers = np.array([triangle])
            else:
                numbers = np.flatnonzero(np.isin(solid.faces, solid.edges[-1 - triangle]).any(axis=1))
            sides.append(solid.sources[numbers])
        return cls((sides[0], sides[1]), interference.places[row].mean(axis=0))

    def is_beyond(self, faces: list[tuple[np.ndarray, np.ndarray]]) -> bool:
        """Return whether the place lies on none of some pairs of faces, triangles of both bodies."""
        first, second = self.triangles
        return not any(np.isin(first, moving).any() and np.isin(second, reference).any() for moving, reference in faces)

    def facing(self, nominal: Nominal, pair: tuple[int, int]) -> tuple[int, int]:
        """Return the triangle of each body there that faces the other body most directly."""
        normals = [
            np.asarray(nominal.parts[body].body.face_normals)[triangles]
            for body, triangles in zip(pair, self.triangles, strict=True)
        ]
        first, second = np.unravel_index(int((normals[0] @ normals[1].T).argmin()), (len(normals[0]), len(normals[1])))
        return int(self.triangles[0][first]), int(self.triangles[1][second])


def variable_of(name: str) -> str:
    """Return a variable that a script may use for a declared thing."""
    word = re.sub(r"\W+", "_", name).strip("_") or "part"
    return f"_{word}" if word[0].isdigit() or keyword.iskeyword(word) else word


def face_line(part: NominalPart, triangle: int) -> str:
    """Return the expression that chooses the face of a part with a triangle of its mesh."""
    mesh, variable = part.mesh, variable_of(part.name)
    normal = np.asarray(mesh.face_normals)[triangle]
    if BREP in mesh.face_attributes:
        face_of, faces = number_faces(mesh)
        number = int(face_of[triangle])
        stated, names = faces[number], [face.name for face in faces]
        face = f'"{stated.name}"' if stated.name and names.count(stated.name) == 1 else str(number + 1)
        whole = "" if stated.surface is None or isinstance(stated.surface, Plane) else ", whole=True"
        return f"{variable}.face(tc.select.Brep({face}{whole}))"
    for side in DIRECTIONS:
        if normal @ np.array(direction(side)) > 1 - SAME_DIRECTION:
            return f'{variable}.face("{side}")'
    return f"{variable}.face()"


def contact_line(nominal: Nominal, pair: tuple[int, int], place: ClashPlace) -> str:
    """Return the line that declares the contact of two bodies at the faces that meet in a place."""
    faces = [face_line(nominal.parts[body], triangle) for body, triangle in zip(pair, place.facing(nominal, pair), strict=True)]
    is_first = moving_first(nominal, pair)[0] is nominal.parts[pair[0]]
    moving, reference = faces if is_first else faces[::-1]
    names, title, number = {declared.name for declared in nominal.pairs}, _title(nominal, pair), 1
    while title in names:
        number += 1
        title = f"{_title(nominal, pair)} {number}"
    owner = variable_of(nominal.parts[pair[0]].station) if nominal.parts[pair[0]].station else "assembly"
    return f'{owner}.contact("{title}", moving={moving}, reference={reference})'


def _title(nominal: Nominal, pair: tuple[int, int]) -> str:
    return " on ".join(part.name for part in moving_first(nominal, pair))


def moving_first(nominal: Nominal, pair: tuple[int, int]) -> tuple[NominalPart, NominalPart]:
    """Return two bodies, the moving one first: the one with locators, or the one that is declared later."""
    first, second = (nominal.parts[body] for body in pair)
    return (first, second) if len(first.locators) and not len(second.locators) else (second, first)


def overlap_line(nominal: Nominal, pair: tuple[int, int]) -> str:
    """Return the line that declares that two bodies may overlap."""
    return f"assembly.may_overlap({', '.join(variable_of(nominal.parts[body].name) for body in pair)})"
