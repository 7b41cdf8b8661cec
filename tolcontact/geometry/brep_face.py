"""The faces of a part, described: those of a STEP file's boundary representation, or smooth pieces. Lengths in mm."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import trimesh

from tolcontact.declaration.vectors import Vector
from tolcontact.errors import shown
from tolcontact.geometry.analytic_surfaces import AnalyticSurface, Plane, Sphere
from tolcontact.geometry.edges import smooth_pieces
from tolcontact.geometry.files import BREP, FACE_NAMES, SURFACES
from tolcontact.geometry.fitting import fit_surface
from tolcontact.readable import Readable

FIT = 1e-3  # [mm] a face none of whose vertices is farther off a plane, cylinder, cone or sphere is on one
DESCRIBED = "described"


@dataclass(frozen=True, repr=False)
class FaceInFile(Readable):
    """A B-rep face of a body, in the body's own frame.

    number      from 1 in the file's order, for `tc.Brep`
    kind        plane, cylinder, cone, sphere, torus, or "general"
    point       a point on it [mm]
    direction   outward normal of a plane; axis of a cylinder, cone or torus; None of others
    radius      [mm] of a cylinder or sphere, or of a torus' circle; None of others
    is_inner    whether a round face is a hollow: its outside lies towards its axis or centre
    area        [mm2], of its triangles
    residual    [mm] how far its vertices lie off it at most, if it was fitted to them; 0 if the file states it
    name        what the file calls it, which may be what it calls others; empty if it has no name
    """

    number: int
    kind: str
    point: Vector
    direction: Vector | None
    radius: float | None
    is_inner: bool
    area: float
    residual: float = 0.0
    name: str = ""

    def __str__(self) -> str:
        called = f'"{shown(self.name)}", ' if self.name else ""
        words = [f"{self.number}. {called}{'inner ' if self.is_inner else ''}{self.kind}"]
        if self.radius is not None:
            words.append(f"radius {self.radius:.6g} mm")
        if self.direction is not None:
            words.append("along ({:g}, {:g}, {:g})".format(*(round(c, 6) + 0.0 for c in self.direction)))
        if self.residual:
            words.append(f"fitted within {self.residual:.1g} mm")
        return ", ".join([*words, f"{self.area:.4g} mm2", "at ({:.4g}, {:.4g}, {:.4g})".format(*self.point)])


def numbered(mesh: trimesh.Trimesh) -> tuple[np.ndarray, Sequence[AnalyticSurface | None]]:
    """The number of each triangle's face (face,), from 0, and the surfaces that are stated: of the B-rep faces of a STEP file.

    Other meshes have smooth pieces instead, of which nothing is stated.
    """
    if BREP in mesh.face_attributes:
        return np.asarray(mesh.face_attributes[BREP]).ravel(), mesh.metadata[SURFACES]
    pieces = smooth_pieces(mesh, np.arange(len(mesh.faces)))
    return pieces, [None] * (int(pieces.max(initial=-1)) + 1)


def described(mesh: trimesh.Trimesh) -> tuple[FaceInFile, ...]:
    """The faces of a part. It keeps them: fitting surfaces takes time."""
    if DESCRIBED not in mesh.metadata:
        number_of, stated = numbered(mesh)
        order = np.argsort(number_of, kind="stable")
        groups = np.split(order, np.searchsorted(number_of[order], np.arange(1, len(stated))))
        surfaces = enumerate(zip(groups, stated, strict=True), start=1)
        found = (_described(mesh, number, own, surface) for number, (own, surface) in surfaces)
        names = mesh.metadata.get(FACE_NAMES) or [""] * len(stated)
        mesh.metadata[DESCRIBED] = tuple(replace(face, name=name) for face, name in zip(found, names, strict=True))
    return mesh.metadata[DESCRIBED]  # type: ignore[no-any-return]


def _described(mesh: trimesh.Trimesh, number: int, own: np.ndarray, surface: AnalyticSurface | None) -> FaceInFile:
    """The face of a number that consists of the triangles `own` (face,), on the `surface` that the file states."""
    areas, normals = np.asarray(mesh.area_faces)[own], np.asarray(mesh.face_normals)[own]
    surface = surface or fit_surface(np.asarray(mesh.triangles)[own], FIT)
    largest = int(areas.argmax())
    point, area = np.asarray(mesh.triangles_center)[own[largest]], float(areas.sum())
    if surface is None:
        return FaceInFile(number, "general", in_words(point), None, None, False, area)
    point = surface.project(point[None])[0]
    _, outward = surface.distance(point[None] + 1e-6 * normals[largest])
    is_inward = float(outward[0] @ normals[largest]) < 0
    is_plane = isinstance(surface, Plane)
    direction = None if isinstance(surface, Sphere) else in_words(-surface.axis if is_plane and is_inward else surface.axis)
    radius = surface.radius if "radius" in surface.sizes else None
    is_inner = is_inward and not is_plane
    return FaceInFile(number, surface.kind, in_words(point), direction, radius, is_inner, area, surface.residual)


def in_words(numbers: np.ndarray) -> Vector:
    """Three numbers as a script writes them."""
    x, y, z = (float(number) + 0.0 for number in numbers)
    return x, y, z
